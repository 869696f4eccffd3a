"""Halts and what a log tells -> the events of a run, as a robot of stopgo would have told them.

A log that tells nothing of scans has stops that are `Unconfirmed`: the robot stood there as long as a scan
takes, and that is all that is known. A halt that was too short is `Failed`, a stop that was passed `Skipped`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stopgo.mission.document import Mission, Stop
from stopgo.mission.run.events import (
    AnyEvent,
    Arrived,
    Failed,
    Finished,
    Pose,
    Settled,
    Skipped,
    Started,
    Unconfirmed,
)
from stopgo.mission.run.run_log import Track
from stopgo.recordings.logs.field_log import Remark
from stopgo.recordings.replay.matching import Match, long_enough
from stopgo.recordings.replay.standstills import Standing


@dataclass(frozen=True)
class Happening:
    """An event without what all events have."""

    ns: int
    kind: type
    fields: dict[str, Any]


def events_of(
    matches: Sequence[Match],
    mission: Mission,
    track: Track,
    remarks: Sequence[Remark],
    *,
    run_id: str,
    robot: str,
) -> tuple[AnyEvent, ...]:
    """The events of a run that drove as the halts say; it is over if the last stop was visited."""
    began, ended = _begin(track, matches, remarks), int(track.ns[-1])
    told = [Happening(began, Started, {"commander": "not told by the log"})]
    told += sorted(_told(matches, mission, track, remarks), key=lambda item: item.ns)
    if len(mission.stops) - 1 in {match.stop for match in matches}:
        told.append(Happening(ended, Finished, {}))
    about = {
        "robot": robot, "boot_id": "", "run_id": run_id,
        "mission_id": mission.id, "revision": mission.revision,
    }  # fmt: skip
    return tuple(
        item.kind(
            number=number, robot_ns=item.ns, mission_time_s=(item.ns - began) / 1e9, **about, **item.fields
        )
        for number, item in enumerate(told, 1)
    )


def _begin(track: Track, matches: Sequence[Match], remarks: Sequence[Remark]) -> int:
    """When the vehicle began its mission last before the first stop, if the log tells; else with the log."""
    first = next((match.standing.begin_ns for match in matches if match.stop is not None), None)
    modes = [remark.ns for remark in remarks if remark.kind == "mode" and remark.text in DRIVES]
    before = [ns for ns in modes if first is None or ns <= first]
    return max(before[-1], int(track.ns[0])) if before else int(track.ns[0])


DRIVES = ("AUTO", "MISSION")
"""Modes in which a vehicle follows its mission."""


def _told(
    matches: Sequence[Match], mission: Mission, track: Track, remarks: Sequence[Remark]
) -> Iterator[Happening]:
    farthest, left_ns, stood = -1, int(track.ns[0]), set[int]()
    for match in matches:
        if match.stop is None:
            continue
        for passed in range(farthest + 1, match.stop):
            left_ns = _passing_ns(mission.stops[passed], track, left_ns, match.standing.begin_ns)
            reason = "no halt there in the log"
            yield Happening(left_ns, Skipped, {"stop": mission.stops[passed].id, "reason": reason})
        farthest, left_ns = max(farthest, match.stop), match.standing.end_ns
        stop = mission.stops[match.stop]
        enough = long_enough(match.standing, stop)
        if enough or match.stop not in stood:  # a short halt takes nothing from a long one before
            yield from _visit(stop, match.standing, remarks)
        stood |= {match.stop} if enough else set()


def _during(halt: Standing, remark: Remark) -> bool:
    return halt.begin_ns - 10**9 <= remark.ns <= halt.end_ns + 10**9


def _of_scan(trigger: Remark | None, halt: Standing, remarks: Sequence[Remark]) -> str:
    """What the log tells of a scan, and of how long was waited for it."""
    if trigger is None:
        return "nothing in the log tells of a scan"
    items = [remark for remark in remarks if remark.kind == "command" and remark.ns >= trigger.ns]
    waits = items[:1] if items and items[0].text.startswith("NAV_DELAY") and _during(halt, items[0]) else []
    if len(items) < 2 or not waits:
        return f"{trigger.text} in the log"
    return f"{trigger.text}, then waited {(items[1].ns - waits[0].ns) / 1e9:.2f} s"


def _passing_ns(stop: Stop, track: Track, after_ns: int, before_ns: int) -> int:
    """When the robot was nearest to a stop that it left out, on its way to the next halt."""
    poses = track.between(after_ns + 1, before_ns - 1)
    if not len(poses):
        return after_ns + 1
    return int(poses.ns[int(np.hypot(*(poses.xy - (stop.x, stop.y)).T).argmin())])


def _visit(stop: Stop, halt: Standing, remarks: Sequence[Remark]) -> Iterator[Happening]:
    pose = Pose(x=halt.x, y=halt.y, heading=halt.heading)
    away = math.dist(halt.xy, (stop.x, stop.y))
    yield Happening(halt.begin_ns, Arrived, {"stop": stop.id, "pose": pose, "deviation_m": away})
    trigger = next((remark for remark in remarks if remark.kind == "trigger" and _during(halt, remark)), None)
    if trigger is not None:
        yield Happening(max(trigger.ns, halt.begin_ns), Settled, {"stop": stop.id, "pose": pose})
    word = f"; {_of_scan(trigger, halt, remarks)}"
    if not long_enough(halt, stop):
        planned = stop.settle_s + stop.scan.duration_s
        reason = f"stood {halt.seconds:.1f} s of {planned:.1f} s{word}"
        yield Happening(halt.end_ns, Failed, {"stop": stop.id, "reason": reason})
    else:
        reason = f"stood {halt.seconds:.1f} s{word}"
        yield Happening(halt.end_ns, Unconfirmed, {"stop": stop.id, "pose": pose, "reason": reason})
