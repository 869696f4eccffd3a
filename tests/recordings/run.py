"""A run as a robot would report it: every report of a mission driven as planned, 3 cm to the left."""

from __future__ import annotations

import math
from collections.abc import Iterator

import msgspec

from stopgo.mission.document import Mission
from stopgo.mission.run.events import (
    AnyEvent,
    Arrived,
    Event,
    Finished,
    Pose,
    PoseReport,
    RevisionTaken,
    Scanned,
    Settled,
    Skipped,
    Started,
    State,
    StateReport,
    StopState,
)
from stopgo.recordings.plan.drive import planned_drive

BEGAN_NS = 1_795_000_000_000_000_000
RUN = "run-1"
OFFSET = 0.03
"""Metres to the left of the planned pose."""


def reports(mission: Mission, *, run: str = RUN) -> Iterator[StateReport | PoseReport | AnyEvent]:
    """Everything the robot reports, in order; poses are those of the planned drive."""
    teller = _Teller(mission, run)
    drive = planned_drive(mission)
    poses = list(zip(drive.seconds, drive.poses, strict=True))
    yield teller.event(Started, 0.0, commander="surveyor")
    yield teller.state(0.0, "RUNNING")
    for number, stop in enumerate(mission.stops):
        leaving = float(drive.leaving_s[number])
        arrival = leaving - stop.settle_s - stop.scan.duration_s
        begin = 0.0 if number == 0 else float(drive.leaving_s[number - 1])
        yield teller.state(begin, "RUNNING", stop.id, "NAVIGATING")
        for seconds, (x, y, heading) in poses:
            if begin <= seconds <= arrival:
                yield teller.pose(seconds, x, y, heading)
        at = teller.pose(arrival, stop.x, stop.y, stop.heading).pose
        yield teller.event(Arrived, arrival, stop=stop.id, pose=at, deviation_m=OFFSET)
        yield teller.state(arrival, "RUNNING", stop.id, "SETTLING")
        yield teller.event(Settled, arrival + stop.settle_s, stop=stop.id, pose=at)
        yield teller.state(arrival + stop.settle_s, "RUNNING", stop.id, "SCANNING")
        scan = {"file": f"{stop.id}.e57", "size": 10, "sha256": "0" * 64, "points": 1000}
        yield teller.event(Scanned, leaving, stop=stop.id, pose=at, **scan)
        teller.done.append(stop.id)
    yield teller.event(Finished, float(drive.seconds[-1]))
    yield teller.state(float(drive.seconds[-1]), "FINISHED")


def reports_with_a_skip(mission: Mission, stop: str) -> Iterator[StateReport | PoseReport | AnyEvent]:
    """The same run, but that somebody leaves out a stop: its leg is driven, and nothing is done there."""
    for report in reports(mission):
        if isinstance(report, Arrived) and report.stop == stop:
            common = {name: getattr(report, name) for name in Event.__struct_fields__}
            yield Skipped(stop=stop, reason="skip by ann", **common)
        elif not (isinstance(report, Arrived | Settled | Scanned) and report.stop == stop):
            yield report


def reports_of_two(
    before: Mission, after: Mission, *, behind: str
) -> Iterator[StateReport | PoseReport | AnyEvent]:
    """A run that goes on by the revision `after` once the stop `behind` has been scanned."""
    begun, rest = list(reports(before)), list(reports(after))
    yield from begun[: _scanned(begun, behind) + 1]
    taken = begun[_scanned(begun, behind)]
    assert isinstance(taken, Scanned)
    common = {name: getattr(taken, name) for name in RevisionTaken.__struct_fields__ if name != "before"}
    common |= {"number": taken.number + 1, "revision": after.revision}
    yield RevisionTaken(before=before.revision, **common)
    for report in rest[_scanned(rest, behind) + 1 :]:
        later = {"number": report.number + 1} if isinstance(report, Event) else {}
        yield msgspec.structs.replace(report, **later)


def _scanned(told: list[StateReport | PoseReport | AnyEvent], stop: str) -> int:
    """Index of the report of a stop's scan in a run."""
    return next(k for k, item in enumerate(told) if isinstance(item, Scanned) and item.stop == stop)


class _Teller:
    def __init__(self, mission: Mission, run: str) -> None:
        self.mission, self.run = mission, run
        self.number = self.seq = 0
        self.done: list[str] = []

    def event(self, kind, seconds: float, **fields) -> AnyEvent:
        self.number += 1
        return kind(
            number=self.number,
            robot="r1",
            boot_id="b1",
            run_id=self.run,
            mission_id=self.mission.id,
            revision=self.mission.revision,
            robot_ns=_ns(seconds),
            mission_time_s=seconds,
            **fields,
        )

    def state(
        self, seconds: float, state: State, stop: str | None = None, stop_state: StopState | None = None
    ) -> StateReport:
        self.seq += 1
        return StateReport(
            robot="r1",
            boot_id="b1",
            seq=self.seq,
            robot_ns=_ns(seconds),
            state=state,
            run_id=self.run,
            mission_id=self.mission.id,
            revision=self.mission.revision,
            stop=stop,
            stop_state=stop_state,
            done=tuple(self.done),
            skipped=(),
            battery=max(0.2, 1.0 - seconds / 1000),
            last_event=self.number,
        )

    def pose(self, seconds: float, x: float, y: float, heading: float) -> PoseReport:
        self.seq += 1
        left = (-OFFSET * math.sin(heading), OFFSET * math.cos(heading))
        return PoseReport(
            robot="r1",
            boot_id="b1",
            seq=self.seq,
            robot_ns=_ns(seconds),
            run_id=self.run,
            mission_time_s=seconds,
            pose=Pose(x=x + left[0], y=y + left[1], heading=heading),
            speed=0.5,
        )


def _ns(seconds: float) -> int:
    return BEGAN_NS + round(seconds * 1e9)
