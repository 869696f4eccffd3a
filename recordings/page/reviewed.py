"""Review of recordings: plans and runs read together, each run compared with its plan."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from msgspec import UNSET

from stopgo.mission.comparing.compare import compare
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.comparison_text import comparison_json, comparison_text
from stopgo.mission.comparing.run_verdict import exit_code_of, judge
from stopgo.mission.document import Mission, floor_plan_id
from stopgo.mission.errors import InputError
from stopgo.mission.stages.sight import Sight
from stopgo.recordings.drawing import entities
from stopgo.recordings.embedded.checking import problems_of
from stopgo.recordings.embedded.reading import Recording, read_each
from stopgo.recordings.embedded.same_mission import agreeing, contradiction, of_its_mission
from stopgo.recordings.page.runs_together import RunsTogether, follow_up_command, together

SUFFIX = ".rrd"


@dataclass(frozen=True, eq=False)
class RecordingReview:
    """One recording, and its runs compared with any plan of their mission that was read."""

    recording: Recording
    comparisons: tuple[Comparison, ...]
    problems: tuple[str, ...]
    """Contradictions and missing data, one line each."""

    @property
    def plan(self) -> dict[str, Any] | None:
        """Results of the plan's stages; None without a plan."""
        return self.recording.contents.properties.get(entities.PROPERTY_PLAN)

    def as_json(self) -> dict[str, Any]:
        """Return everything, for `--json`."""
        contents = self.recording.contents
        return {
            "file": str(self.recording.path),
            "recording_id": contents.recording_id,
            "mission_id": self.recording.mission_id,
            "complete": contents.complete,
            "problems": list(self.problems),
            "timelines": list(contents.timelines),
            "entities": len(contents.rows),
            "rows": contents.total_rows,
            "plan": self.plan,
            "runs": [comparison_json(comparison) for comparison in self.comparisons],
        }

    def as_text(self, *, alone: bool = True) -> str:
        """Return the review for a person; without what to do next if there are more runs of the mission."""
        contents = self.recording.contents
        lines = [
            f"{self.recording.path}: recording {contents.recording_id}, mission {self.recording.mission_id}",
            f"  timelines {', '.join(contents.timelines)};"
            f" {len(contents.rows)} entities, {contents.total_rows} rows",
            *(f"  problem: {problem}" for problem in self.problems),
        ]
        if self.plan is not None:
            lines += [f"  {name}: {value}" for name, value in self.plan.items()]
        for item in self.comparisons:
            lines += ["", comparison_text(item), *(what_next(item, self.recording.path) if alone else ())]
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Review:
    """Several recordings; an unreadable file does not hide the others."""

    recordings: tuple[RecordingReview, ...]
    faults: tuple[str, ...]
    """Errors of unreadable files, one line each."""

    @property
    def comparisons(self) -> tuple[Comparison, ...]:
        return tuple(item for review in self.recordings for item in review.comparisons)

    @cached_property
    def together(self) -> dict[str, RunsTogether]:
        """Runs of every plan of a floor that has several, or several missions, by the plan's id."""
        found = {}
        for plan_id, items in self._by_plan.items():
            runs = [run for item in items for run in item.comparisons]
            if len(runs) > 1 or (runs and runs[0].mission.share is not UNSET):
                with suppress(InputError):  # runs of different missions are reported alone
                    read = agreeing([item.recording for item in items])
                    found[plan_id] = together(runs, missions_of(read), sights_of(read))
        return found

    def next_together(self, plan_id: str) -> tuple[str, ...]:
        """Return the command for one follow-up mission after all runs of a plan, if one is needed."""
        items = self._by_plan[plan_id]
        return self.together[plan_id].what_next(item.recording.path for item in items if item.comparisons)

    @property
    def _by_plan(self) -> dict[str, list[RecordingReview]]:
        found: dict[str, list[RecordingReview]] = {}
        for item in self.recordings:
            found.setdefault(plan_id_of(item.recording), []).append(item)
        return found

    def as_text(self) -> str:
        """Return the review for a person: each recording, then the runs of each plan of a floor together."""
        each = [
            item.as_text(alone=plan_id_of(item.recording) not in self.together) for item in self.recordings
        ]
        both = [
            "\n".join((*runs.verdicts, *runs.sentences, *self.next_together(plan_id)))
            for plan_id, runs in self.together.items()
        ]
        return "\n\n".join([*each, *both])

    @property
    def exit_code(self) -> int:
        """2 if a file cannot be read, else the code of the worst run."""
        if self.faults:
            return InputError.exit_code
        return exit_code_of(map(judge, self.comparisons))

    @property
    def check_code(self) -> int:
        """1 if a recording is incomplete or contradicts itself, else the exit code."""
        return 1 if any(item.problems for item in self.recordings) else self.exit_code


def what_next(run: Comparison, path: Path) -> tuple[str, ...]:
    """Return the command for a follow-up mission, if a finished run in `path` acquired too little."""
    acquired, floor = run.acquired, run.mission.origin.floor
    if acquired is None or acquired.answer != "no" or not run.log.ended or not floor:
        return ()
    return (follow_up_command([path], floor),)


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
    """Compare the runs of recordings with the plans among them."""
    return Review(tuple(_review(item, read) for item in read), tuple(faults))


def files_in(paths: Iterable[Path]) -> Iterator[Path]:
    """Yield the given files, and every recording in a given folder, by name."""
    for path in paths:
        if not path.is_dir():
            yield path
            continue
        found = sorted(item for item in path.iterdir() if item.suffix == SUFFIX and item.is_file())
        if not found:
            raise InputError(f"{path}: no {SUFFIX} file in this folder; name another folder")
        yield from found


def _review(recording: Recording, read: Sequence[Recording]) -> RecordingReview:
    of_mission = of_its_mission(recording, read)
    missions, sights = missions_of(of_mission), sights_of(of_mission)
    comparisons = [compare(log, missions, sights) for log in recording.logs] if missions else []
    problems = (*problems_of(recording), *filter(None, (contradiction(recording, item) for item in read)))
    return RecordingReview(recording, tuple(comparisons), problems)


def plan_id_of(recording: Recording) -> str:
    """Return the id of the plan of a floor that a recording is of: its mission's, unless that shares it."""
    shared = (floor_plan_id(mission) for mission in recording.missions if mission.share is not UNSET)
    return next(shared, recording.mission_id)


def missions_of(recordings: Iterable[Recording]) -> tuple[Mission, ...]:
    """Return every revision once, in ascending order."""
    found = {mission.digest: mission for item in recordings for mission in item.missions}
    return tuple(sorted(found.values(), key=lambda mission: mission.revision))


def sights_of(recordings: Iterable[Recording]) -> tuple[Sight, ...]:
    """Return what the stops of every revision see, once."""
    found = {sight.digest: sight for item in recordings for sight in item.sights}
    return tuple(sorted(found.values(), key=lambda sight: sight.revision))
