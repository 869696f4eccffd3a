"""What a recording tells of a plan and of runs, as one noun: for `stopgo review`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mission.errors import InputError
from recordings import entities
from recordings.read import Contents, check_apart, chunks, rows


@dataclass
class RunReview:
    """One run, from its events."""

    run_id: str
    revisions: list[int] = field(default_factory=list)
    """Those of the mission that the run followed, in this order; none in recordings that do not tell."""
    scanned: list[str] = field(default_factory=list)
    unconfirmed: list[str] = field(default_factory=list)
    """Worked off by an autopilot that told nothing of a scan."""
    skipped: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    deviation_m: dict[str, float] = field(default_factory=dict)
    """Distance from each stop when the robot arrived there."""
    ended: str | None = None
    """`Finished` or `Aborted`; None while it runs, or when the recording stops before."""
    seconds: float = 0.0
    """Mission time of the last event."""


@dataclass(frozen=True)
class Review:
    """A recording in short."""

    contents: Contents
    plan: dict[str, Any] | None
    """Results of the plan's stages, if a plan is in it."""
    runs: tuple[RunReview, ...]

    @property
    def mission_id(self) -> str:
        """Plan and field recordings carry the mission's id as their own."""
        return self.contents.recording_id

    def as_json(self) -> dict[str, Any]:
        """Everything, for `--json`."""
        return {
            "recording_id": self.contents.recording_id,
            "mission_id": self.mission_id,
            "complete": self.contents.complete,
            "timelines": list(self.contents.timelines),
            "entities": len(self.contents.rows),
            "rows": self.contents.total_rows,
            "plan": self.plan,
            "runs": [vars(run) for run in self.runs],
        }

    def as_text(self) -> str:
        """The same for a person."""
        held = self.contents
        ended = "" if held.complete else "; not closed: its writer was stopped, or had no room on the disk"
        lines = [
            f"recording {held.recording_id} (mission of the same id){ended}",
            f"  timelines {', '.join(held.timelines)}; {len(held.rows)} entities, {held.total_rows} rows",
        ]
        if self.plan is not None:
            lines += [f"  {name}: {value}" for name, value in self.plan.items()]
        for run in self.runs:
            lines += _run_lines(run)
        return "\n".join(lines)


def review(path: Path) -> Review:
    """Read a recording to its end.

    Raises
    ------
    InputError
        When the file cannot be read, or was not written by stopgo.
    """
    contents = check_apart(path)
    if contents.application != entities.APPLICATION:
        raise InputError(f"{path}: is a recording of {contents.application}, not of {entities.APPLICATION}")
    runs: dict[str, RunReview] = {}
    for run_id, event in sorted(_events(path), key=lambda pair: pair[1]["number"]):
        _take(runs.setdefault(run_id, RunReview(run_id)), event)
    return Review(contents, contents.properties.get(entities.PROPERTY_PLAN), tuple(runs.values()))


def _events(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Run id and values of every event."""
    for chunk in chunks(path):
        run_id = entities.run_of_events(str(chunk.entity_path))
        if run_id is not None:
            for seconds, values in rows(chunk):
                yield run_id, {**values, "seconds": seconds}


def _take(run: RunReview, event: dict[str, Any]) -> None:
    kind, stop = event["event"], event.get("stop", "")
    outcomes = {
        "Scanned": run.scanned, "Unconfirmed": run.unconfirmed, "Skipped": run.skipped, "Failed": run.failed,
    }  # fmt: skip
    if kind in outcomes:
        outcomes[kind].append(stop)
    elif kind == "Arrived":
        run.deviation_m[stop] = event["deviation_m"]
    elif kind in ("Finished", "Aborted"):
        run.ended = kind
    run.seconds = event["seconds"]
    revision = event.get("revision")
    if revision is not None and revision not in run.revisions:
        run.revisions.append(revision)


def _run_lines(run: RunReview) -> list[str]:
    unsure = f" {len(run.unconfirmed)} unconfirmed," if run.unconfirmed else ""
    lines = [
        f"  run {run.run_id}: {len(run.scanned)} scanned,{unsure} {len(run.skipped)} skipped,"
        f" {len(run.failed)} failed; {run.ended or 'not ended'} after {run.seconds:.1f} s"
    ]
    if len(run.revisions) > 1:
        lines.append(f"    revisions {', '.join(map(str, run.revisions))} of the mission, one after another")
    if run.deviation_m:
        worst = max(run.deviation_m, key=lambda stop: run.deviation_m[stop])
        lines.append(f"    greatest deviation {run.deviation_m[worst] * 1000:.1f} mm, at {worst}")
        lines += [f"    {stop}: {metres * 1000:.1f} mm" for stop, metres in run.deviation_m.items()]
    return lines
