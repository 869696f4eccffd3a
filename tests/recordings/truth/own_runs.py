"""Runs of stopgo's own robots with a known truth: what a station hears of them, with every loss and fault.

A run is reported event by event, as a robot's journal has it. A robot signs its events: what they say of
a scan is the truth, unless the poses that the robot sent meanwhile contradict it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from stopgo.mission.comparing.run_collector import RunCollector
from stopgo.mission.comparing.run_verdict import Judgement, judge
from stopgo.mission.document import Mission
from stopgo.mission.run.events import (
    Aborted,
    AnyEvent,
    Arrived,
    Failed,
    Finished,
    Held,
    Pose,
    PoseReport,
    Scanned,
    Settled,
    Skipped,
    Started,
    Unconfirmed,
)
from stopgo.recordings.logs import read_log
from stopgo.recordings.page.reviewed import review
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.replaying import replay
from stopgo.recordings.runs.field import FieldRecording
from tests.recordings.replay.driving import BEGIN_NS
from tests.recordings.truth.drives import STOPS, mission_with_return

SCAN = {"file": "a.e57", "size": 1, "sha256": "0" * 64, "points": 1}
LEG_S, STAY_S = 20.0, 14.0


@dataclass(frozen=True)
class OwnRun:
    """Reports of a run, and its truth."""

    mission: Mission
    events: tuple[AnyEvent, ...]
    poses: tuple[PoseReport, ...]
    good: tuple[bool | None, ...]
    """True for each stop that was scanned within tolerance; None where nobody can know."""
    lost: bool = False
    """True if reports were lost that the truth of a stop hangs on."""

    @property
    def answer(self) -> str:
        """`yes`, `no`, or `unknown` where nobody can know."""
        if False in self.good:
            return "no"
        return "unknown" if None in self.good else "yes"


Told = list[tuple[type, float, dict[str, object]]]
"""Kind of event, seconds after the arrival, and its fields."""
Ending = Callable[[Mission, int], tuple[Told, bool | None]]


def _pose(mission: Mission, k: int, off: float = 0.01) -> Pose:
    stop = mission.stops[k]
    return Pose(x=stop.x + off, y=stop.y, heading=stop.heading)


def _arrival(mission: Mission, k: int, off: float = 0.01) -> Told:
    about: dict[str, object] = {"stop": mission.stops[k].id, "pose": _pose(mission, k, off)}
    return [(Arrived, 0.0, {**about, "deviation_m": off}), (Settled, 2.0, about)]


def scanned(mission: Mission, k: int) -> tuple[Told, bool | None]:
    about = {"stop": mission.stops[k].id, "pose": _pose(mission, k)}
    return [*_arrival(mission, k), (Scanned, STAY_S, {**about, **SCAN})], True


def scanned_beside(mission: Mission, k: int) -> tuple[Told, bool | None]:
    """The scan is made 0.2 m off the stop."""
    about = {"stop": mission.stops[k].id, "pose": _pose(mission, k, 0.2)}
    return [*_arrival(mission, k, 0.2), (Scanned, STAY_S, {**about, **SCAN})], False


def blocked_and_skipped(mission: Mission, k: int) -> tuple[Told, bool | None]:
    """The way is blocked, and the operator skips the stop."""
    skip = (Skipped, 10.0, {"stop": mission.stops[k].id, "reason": "by me"})
    return [(Held, -5.0, {"reason": "blocked"}), skip], False


def scanner_failed(mission: Mission, k: int) -> tuple[Told, bool | None]:
    """The scanner fails, and the operator skips the stop."""
    failed = {"stop": mission.stops[k].id, "reason": "scanner"}
    return [
        *_arrival(mission, k),
        (Failed, 8.0, failed),
        (Skipped, 20.0, failed | {"reason": "by me"}),
    ], False


def failed_and_scanned(mission: Mission, k: int) -> tuple[Told, bool | None]:
    """The scanner fails, and the second try is good."""
    failed = (Failed, 5.0, {"stop": mission.stops[k].id, "reason": "scanner"})
    found, _ = scanned(mission, k)
    return [*_arrival(mission, k), failed, *found], True


def unconfirmed(mission: Mission, k: int) -> tuple[Told, bool | None]:
    """The camera reported nothing."""
    about = {"stop": mission.stops[k].id, "pose": _pose(mission, k), "reason": "no word of the camera"}
    return [*_arrival(mission, k), (Unconfirmed, STAY_S, about)], None


MISHAPS = (scanned, scanned_beside, blocked_and_skipped, scanner_failed, failed_and_scanned, unconfirmed)


def own_run(seed: int, mishap: Ending, *, given_up: bool = False) -> OwnRun:
    """Return a run in which one stop ends by a mishap; `given_up`: it is aborted two stops later."""
    chance = np.random.default_rng(seed)
    mission, where = mission_with_return(seed), int(chance.integers(STOPS - 3))
    told: Told = [(Started, 0.0, {"commander": "me"})]
    good: list[bool | None] = []
    for k in range(STOPS):
        if given_up and k == where + 2:
            break
        events, fine = (mishap if k == where else scanned)(mission, k)
        told += [(kind, 60.0 * k + LEG_S + at, fields) for kind, at, fields in events]
        good.append(fine)
    good += [False] * (STOPS - len(good))
    end = told[-1][1] + 20.0
    told.append((Aborted, end, {"reason": "by me"}) if given_up else (Finished, end, {}))
    events = tuple(_event(mission, number, *item) for number, item in enumerate(told, 1))
    return OwnRun(mission, events, tuple(_poses(mission, events)), tuple(good))


def _event(mission: Mission, number: int, kind: type, seconds: float, fields: dict[str, object]) -> AnyEvent:
    about = {
        "number": number, "robot": "r1", "boot_id": "a", "run_id": "run-1", "mission_id": mission.id,
        "revision": 1, "robot_ns": BEGIN_NS + round(seconds * 1e9), "mission_time_s": seconds,
    }  # fmt: skip
    made: AnyEvent = kind(**{**about, **fields})
    return made


def _poses(mission: Mission, events: tuple[AnyEvent, ...]) -> Iterator[PoseReport]:
    """Yield a pose each half second: at a stop that of its events, else between them."""
    known = [(event.robot_ns, event.pose) for event in events if getattr(event, "pose", None) is not None]
    known = [(BEGIN_NS, Pose(x=mission.start.x, y=mission.start.y, heading=0.0)), *known]
    times = np.arange(BEGIN_NS, events[-1].robot_ns, 5 * 10**8)
    columns = [
        np.interp(times, [ns for ns, _ in known], [getattr(pose, name) for _, pose in known])
        for name in ("x", "y", "heading")
    ]
    for number, (ns, x, y, heading) in enumerate(zip(times.tolist(), *columns, strict=True), 1):
        yield PoseReport(
            robot="r1", boot_id="a", seq=number, robot_ns=ns, run_id="run-1",
            mission_time_s=(ns - BEGIN_NS) / 1e9, pose=Pose(x=x, y=y, heading=heading), speed=0.0,
        )  # fmt: skip


Loss = Callable[[OwnRun, np.random.Generator], OwnRun]


def all_heard(run: OwnRun, chance: np.random.Generator) -> OwnRun:
    return run


def poses_lost(run: OwnRun, chance: np.random.Generator) -> OwnRun:
    """A third of the poses is missing in one piece."""
    begin = int(chance.integers(len(run.poses) // 2))
    return replace(run, poses=run.poses[:begin] + run.poses[begin + len(run.poses) // 3 :])


def no_poses(run: OwnRun, chance: np.random.Generator) -> OwnRun:
    return replace(run, poses=())


def events_lost(run: OwnRun, chance: np.random.Generator) -> OwnRun:
    """Four events in a row are missing."""
    begin = int(chance.integers(1, max(2, len(run.events) - 7)))
    return replace(run, events=run.events[:begin] + run.events[begin + 4 :], lost=True)


def begin_lost(run: OwnRun, chance: np.random.Generator) -> OwnRun:
    """The station came late: the first events are missing."""
    return replace(run, events=run.events[int(chance.integers(2, 8)) :], lost=True)


def end_not_heard(run: OwnRun, chance: np.random.Generator) -> OwnRun:
    """The station went in the middle of the run."""
    kept = int(chance.integers(5, len(run.events) - 2))
    last_ns = run.events[kept - 1].robot_ns
    poses = tuple(pose for pose in run.poses if pose.robot_ns <= last_ns)
    return replace(run, events=run.events[:kept], poses=poses, lost=True)


def told_twice(run: OwnRun, chance: np.random.Generator) -> OwnRun:
    """Events come again, and in another order."""
    events = [*run.events, *run.events[:4]]
    return replace(run, events=tuple(events[int(k)] for k in chance.permutation(len(events))))


def restarted(run: OwnRun, chance: np.random.Generator) -> OwnRun:
    """The robot restarts between two stops, and its clock is an hour behind."""
    cut = next(k for k, event in enumerate(run.events) if isinstance(event, Scanned | Skipped) and k > 4) + 1
    at_ns, back = run.events[cut].robot_ns, 3600 * 10**9
    later = [
        msgspec.structs.replace(event, boot_id="b", robot_ns=event.robot_ns - back)
        for event in run.events[cut:]
    ]
    poses = tuple(
        pose
        if pose.robot_ns < at_ns
        else msgspec.structs.replace(pose, boot_id="b", robot_ns=pose.robot_ns - back)
        for pose in run.poses
    )
    return replace(run, events=(*run.events[:cut], *later), poses=poses)


def poses_contradict(run: OwnRun, chance: np.random.Generator) -> OwnRun:
    """At one scanned stop the poses sent meanwhile lie 3.5 m away: one of both is wrong."""
    scans = [event for event in run.events if isinstance(event, Scanned)]
    scan = scans[int(chance.integers(len(scans)))]
    number = [stop.id for stop in run.mission.stops].index(scan.stop)
    poses = tuple(
        msgspec.structs.replace(pose, pose=msgspec.structs.replace(pose.pose, x=pose.pose.x + 3.5))
        if abs(pose.robot_ns - scan.robot_ns) < 20 * 10**9
        else pose
        for pose in run.poses
    )
    good = tuple(None if k == number and fine else fine for k, fine in enumerate(run.good))
    return replace(run, poses=poses, good=good)


LOSSES: tuple[Loss, ...] = (
    all_heard,
    poses_lost,
    no_poses,
    events_lost,
    begin_lost,
    end_not_heard,
    told_twice,
    restarted,
    poses_contradict,
)


@dataclass(frozen=True)
class OwnAnswer:
    """Answer to a run, next to its truth."""

    name: str
    truth: str
    answer: str
    lost: bool
    text: str

    @property
    def kind(self) -> str:
        if self.answer != "unknown":
            return "right" if self.answer == self.truth else f"false {self.answer}"
        return "open" if self.lost or self.truth == "unknown" else "untold"


def own_answers(seed: int = 1) -> Iterator[OwnAnswer]:
    """Yield the answer to each mishap with each loss, in a run that ends and in one that is given up."""
    number = 0
    for mishap in MISHAPS:
        for loss in LOSSES:
            for given_up in (False, True):
                number += 1
                case = 1000 * seed + number
                run = own_run(case, mishap, given_up=given_up)
                heard = loss(run, np.random.default_rng(case))
                judged = judge_of(heard)
                name = f"{mishap.__name__} / {loss.__name__}{' / given up' if given_up else ''} #{case}"
                yield OwnAnswer(name, heard.answer, judged.answer, heard.lost, judged.text)


def recorded_answers(folder: Path, seed: int = 1, every: int = 1) -> Iterator[OwnAnswer]:
    """Yield the answers of `review` and of `replay` to recordings (.rrd) of these runs."""
    runs = [(mishap, loss, given_up) for mishap in MISHAPS for loss in LOSSES for given_up in (False, True)]
    for number, (mishap, loss, given_up) in enumerate(runs[::every], 1):
        case = 1000 * seed + number
        heard = loss(own_run(case, mishap, given_up=given_up), np.random.default_rng(case))
        path = recorded(folder / f"{case}.rrd", heard)
        for name, judged in (("review", _reviewed(path)), ("replay", _replayed(path, heard.mission))):
            about = f"{mishap.__name__} / {loss.__name__}{' / given up' if given_up else ''} / {name} #{case}"
            yield OwnAnswer(about, heard.answer, judged.answer, heard.lost, judged.text)


def recorded(path: Path, run: OwnRun) -> Path:
    """The recording of a station that heard a run."""
    reports = [*run.poses, *run.events]
    with FieldRecording(path, run.mission) as recording:
        for report in sorted(reports, key=lambda one: (one.boot_id, one.robot_ns)):
            if isinstance(report, PoseReport):
                recording.pose(report)
            else:
                recording.event(report)
    return path


def _reviewed(path: Path) -> Judgement:
    (compared,) = review([path]).comparisons
    return judge(compared)


def _replayed(path: Path, mission: Mission) -> Judgement:
    return drive_verdict(replay(read_log(path), mission, Placing()))


def judge_of(run: OwnRun) -> Judgement:
    """Return the verdict of a station that heard these reports."""
    collector = RunCollector()
    collector.mission(run.mission)
    for report in run.events:
        collector.event(report)
    for pose in run.poses:
        collector.pose(pose)
    compared = collector.compared()
    assert compared is not None
    return judge(compared)
