"""What recordings tell of plans and runs: read together, each run beside its plan; for `stopgo review`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Any

from stopgo.mission.comparing.compare import compare
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.comparison_text import comparison_json, comparison_text
from stopgo.mission.comparing.run_verdict import judge
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.stages.sight import Sight
from stopgo.recordings.drawing import entities
from stopgo.recordings.embedded.checking import problems_of
from stopgo.recordings.embedded.reading import Recording, read_each

SUFFIX = ".rrd"


@dataclass(frozen=True, eq=False)
class RecordingReview:
    """One recording, and its runs compared with whatever plan of their mission was read."""

    recording: Recording
    comparisons: tuple[Comparison, ...]
    problems: tuple[str, ...]
    """What contradicts itself or is missing, a line each."""

    @property
    def plan(self) -> dict[str, Any] | None:
        """Results of the plan's stages, if a plan is in it."""
        return self.recording.contents.properties.get(entities.PROPERTY_PLAN)

    def as_json(self) -> dict[str, Any]:
        """Everything, for `--json`."""
        held = self.recording.contents
        return {
            "file": str(self.recording.path),
            "recording_id": held.recording_id,
            "mission_id": self.recording.mission_id,
            "complete": held.complete,
            "problems": list(self.problems),
            "timelines": list(held.timelines),
            "entities": len(held.rows),
            "rows": held.total_rows,
            "plan": self.plan,
            "runs": [comparison_json(comparison) for comparison in self.comparisons],
        }

    def as_text(self) -> str:
        """The same for a person."""
        held = self.recording.contents
        lines = [
            f"{self.recording.path}: recording {held.recording_id} (mission of the same id)",
            f"  timelines {', '.join(held.timelines)}; {len(held.rows)} entities, {held.total_rows} rows",
            *(f"  problem: {problem}" for problem in self.problems),
        ]
        if self.plan is not None:
            lines += [f"  {name}: {value}" for name, value in self.plan.items()]
        for item in self.comparisons:
            lines += ["", comparison_text(item), *what_next(item, self.recording.path)]
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Review:
    """Several recordings; those that cannot be read hide none of the others."""

    recordings: tuple[RecordingReview, ...]
    faults: tuple[str, ...]
    """Why a file cannot be read, a line each."""

    @property
    def comparisons(self) -> tuple[Comparison, ...]:
        return tuple(item for review in self.recordings for item in review.comparisons)

    @property
    def exit_code(self) -> int:
        """2 where a file cannot be read, else that of the worst run."""
        if self.faults:
            return InputError.exit_code
        codes = {judge(comparison).exit_code for comparison in self.comparisons}
        return next((code for code in (1, 3) if code in codes), 0)

    @property
    def check_code(self) -> int:
        """1 where a recording contradicts itself or is incomplete, else the exit code."""
        return 1 if any(item.problems for item in self.recordings) else self.exit_code


def what_next(run: Comparison, path: Path) -> tuple[str, ...]:
    """What plans a further mission, where a run that `path` tells of is over and saw less than was asked."""
    acquired, floor = run.acquired, run.mission.origin.floor
    if acquired is None or acquired.answer != "no" or not run.log.ended or not floor:
        return ()
    command = f"stopgo replay {quote(str(path))} --mission mission.json --floor FLOOR --top-up next.json"
    return (f"For what is missing, a further mission (FLOOR is the file of {floor}): {command}",)


def review(paths: Iterable[Path]) -> Review:
    """Read recordings, and folders of recordings, to their ends."""
    read: list[Recording] = []
    faults: list[str] = []
    for _, found in read_each(list(files_in(paths))):
        if isinstance(found, InputError):
            faults.append(str(found))
        else:
            read.append(found)
    return reviewed(read, faults)


def reviewed(read: Sequence[Recording], faults: Sequence[str] = ()) -> Review:
    """Set the runs of recordings beside the plans that are among them."""
    return Review(tuple(_review(item, read) for item in read), tuple(faults))


def files_in(paths: Iterable[Path]) -> Iterator[Path]:
    """The files as they were named, and every recording that lies in a folder, by name."""
    for path in paths:
        if not path.is_dir():
            yield path
            continue
        found = sorted(item for item in path.iterdir() if item.suffix == SUFFIX and item.is_file())
        if not found:
            raise InputError(f"{path}: there is no {SUFFIX} file in this folder; name another")
        yield from found


def _review(recording: Recording, read: Sequence[Recording]) -> RecordingReview:
    mine = [item for item in read if item.mission_id == recording.mission_id]
    missions, sights = missions_of(mine), sights_of(mine)
    comparisons = [compare(log, missions, sights) for log in recording.logs] if missions else []
    return RecordingReview(recording, tuple(comparisons), problems_of(recording))


def missions_of(recordings: Iterable[Recording]) -> tuple[Mission, ...]:
    """Every revision once, in ascending order."""
    found = {mission.digest: mission for item in recordings for mission in item.missions}
    return tuple(sorted(found.values(), key=lambda mission: mission.revision))


def sights_of(recordings: Iterable[Recording]) -> tuple[Sight, ...]:
    """What the stops of every revision see, once."""
    found = {sight.digest: sight for item in recordings for sight in item.sights}
    return tuple(sorted(found.values(), key=lambda sight: sight.revision))
