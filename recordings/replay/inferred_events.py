"""Events of a run, inferred from standstills and from what the log contains.

A log without scans has stops that are `Unconfirmed`: the robot was stationary as long as a scan takes, and no
more is known. A standstill that was too short is `Failed`, a stop that was passed is `Skipped`.
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
from stopgo.mission.run.tolerance import is_outside
from stopgo.recordings.logs.field_log import Remark
from stopgo.recordings.replay.matching import ENOUGH, SLACK_S, Match, long_enough
from stopgo.recordings.replay.standstills import Standstill


@dataclass(frozen=True)
class InferredEvent:
    """Event without the fields that all events have."""

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
    """Return the events of a run according to its standstills; it is over if the last stop was visited."""
    began, ended = _begin(track, matches, remarks), int(track.ns[-1])
    inferred = [InferredEvent(began, Started, {"commander": "not in the log"})]
    inferred += sorted(_stop_events(matches, mission, track, remarks), key=lambda item: item.ns)
    if len(mission.stops) - 1 in {match.stop for match in matches}:
        inferred.append(InferredEvent(ended, Finished, {}))
    about = {
        "robot": robot, "boot_id": "", "run_id": run_id,
        "mission_id": mission.id, "revision": mission.revision,
    }  # fmt: skip
    return tuple(
        item.kind(
            number=number, robot_ns=item.ns, mission_time_s=(item.ns - began) / 1e9, **about, **item.fields
        )
        for number, item in enumerate(inferred, 1)
    )


def _begin(track: Track, matches: Sequence[Match], remarks: Sequence[Remark]) -> int:
    """Return when the vehicle last began its mission before the first stop, else the log's begin."""
    first = next((match.standstill.begin_ns for match in matches if match.stop is not None), None)
    modes = [remark.ns for remark in remarks if remark.kind == "mode" and remark.text in DRIVES]
    before = [ns for ns in modes if first is None or ns <= first]
    return max(before[-1], int(track.ns[0])) if before else int(track.ns[0])


DRIVES = ("AUTO", "MISSION")
"""Modes in which a vehicle follows its mission."""


def _stop_events(
    matches: Sequence[Match], mission: Mission, track: Track, remarks: Sequence[Remark]
) -> Iterator[InferredEvent]:
    farthest, left_ns = -1, int(track.ns[0])
    counted = _counted(matches, mission, remarks)
    for match in matches:
        if match.stop is None or counted.get(match.stop) is not match:
            continue
        for passed in range(farthest + 1, match.stop):
            if passed in counted:
                continue
            left_ns = _passing_ns(mission.stops[passed], track, left_ns, match.standstill.begin_ns)
            reason = "no standstill there in the log"
            yield InferredEvent(left_ns, Skipped, {"stop": mission.stops[passed].id, "reason": reason})
        farthest, left_ns = max(farthest, match.stop), match.standstill.end_ns
        yield from _visit(mission.stops[match.stop], match.standstill, remarks)


def _counted(matches: Sequence[Match], mission: Mission, remarks: Sequence[Remark]) -> dict[int, Match]:
    """Return the standstill that counts for each stop: that of its scan, as far as the log shows it.

    A standstill with a trigger comes before those without, one long enough for a scan before a shorter one,
    one within tolerance before one outside, and the later of equals.
    """
    counted: dict[int, Match] = {}
    ranks: dict[int, tuple[bool, bool, bool]] = {}
    for match in _without_parking(matches, mission):
        if match.stop is None:
            continue
        stop, standstill = mission.stops[match.stop], match.standstill
        triggered = any(remark.kind == "trigger" and _during(standstill, remark) for remark in remarks)
        within = not is_outside(match.away_m, stop.tolerance_m)
        rank = (triggered, long_enough(standstill, stop), within)
        if match.stop not in counted or rank >= ranks[match.stop]:
            counted[match.stop], ranks[match.stop] = match, rank
    return counted


def _without_parking(matches: Sequence[Match], mission: Mission) -> Iterator[Match]:
    """Yield the matches but those after the last stop that lie nearer to the return's end than to a stop."""
    last, parking = len(mission.stops) - 1, (mission.return_ or ())[-1:]
    over = False
    for match in matches:
        again = over and match.how in ("again", "back")
        if again and any(math.dist(match.standstill.xy, end) < match.away_m for end in parking):
            continue
        yield match
        over = over or match.stop == last


def _during(standstill: Standstill, remark: Remark) -> bool:
    return standstill.begin_ns - 10**9 <= remark.ns <= standstill.end_ns + 10**9


def _scan_evidence(trigger: Remark | None, standstill: Standstill, remarks: Sequence[Remark]) -> str:
    """Return the log's evidence of a scan, and the time waited for it."""
    if trigger is None:
        return "no scan in the log"
    items = [remark for remark in remarks if remark.kind == "command" and remark.ns >= trigger.ns]
    waits = (
        items[:1] if items and items[0].text.startswith("NAV_DELAY") and _during(standstill, items[0]) else []
    )
    if len(items) < 2 or not waits:
        return f"{trigger.text} in the log"
    return f"{trigger.text}, then waited {(items[1].ns - waits[0].ns) / 1e9:.2f} s"


def _passing_ns(stop: Stop, track: Track, after_ns: int, before_ns: int) -> int:
    """Return when the robot was nearest to a skipped stop, on its path to the next standstill."""
    poses = track.between(after_ns + 1, before_ns - 1)
    if not len(poses):
        return after_ns + 1
    return int(poses.ns[int(np.hypot(*(poses.xy - (stop.x, stop.y)).T).argmin())])


FAILED = ", failed"
"""End of the text of a picture that the camera reports as failed."""


def _left_after_s(triggers: Sequence[Remark], standstill: Standstill) -> float:
    """Return the time from the first trigger that begins a scan to the end of the standstill; else infinite.

    A report of a picture, and a camera's own event, may come at the end of its scan.
    """
    begins = [item.ns for item in triggers if item.text.startswith(BEGINS) or item.text.endswith(")")]
    return (standstill.end_ns - begins[0]) / 1e9 if begins else math.inf


BEGINS = ("camera_trigger", "trigger ")
"""Begin of the text of a trigger that begins a scan; so does an item, whose text ends with its number."""


def _visit(stop: Stop, standstill: Standstill, remarks: Sequence[Remark]) -> Iterator[InferredEvent]:
    pose = Pose(x=standstill.x, y=standstill.y, heading=standstill.heading)
    deviation_m = math.dist(standstill.xy, (stop.x, stop.y))
    yield InferredEvent(
        standstill.begin_ns, Arrived, {"stop": stop.id, "pose": pose, "deviation_m": deviation_m}
    )
    triggers = [remark for remark in remarks if remark.kind == "trigger" and _during(standstill, remark)]
    trigger = next((remark for remark in triggers if not remark.text.endswith(FAILED)), None)
    if triggers and trigger is None:
        reason = f"stationary {standstill.seconds:.1f} s; {triggers[-1].text}, in the log"
        yield InferredEvent(standstill.end_ns, Failed, {"stop": stop.id, "reason": reason})
        return
    if trigger is not None:
        yield InferredEvent(max(trigger.ns, standstill.begin_ns), Settled, {"stop": stop.id, "pose": pose})
    evidence = f"; {_scan_evidence(trigger, standstill, remarks)}"
    left_s = _left_after_s(triggers, standstill)
    if not long_enough(standstill, stop) or left_s < ENOUGH * stop.scan.duration_s - SLACK_S:
        planned = stop.settle_s + stop.scan.duration_s
        reason = f"stationary {standstill.seconds:.1f} s of {planned:.1f} s{evidence}"
        if long_enough(standstill, stop):
            reason += f"; left {left_s:.1f} s after the trigger of a scan of {stop.scan.duration_s:.1f} s"
        yield InferredEvent(standstill.end_ns, Failed, {"stop": stop.id, "reason": reason})
    else:
        reason = f"stationary {standstill.seconds:.1f} s{evidence}"
        yield InferredEvent(standstill.end_ns, Unconfirmed, {"stop": stop.id, "pose": pose, "reason": reason})
