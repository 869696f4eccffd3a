"""Visits of stops that a robot reported itself; where it reports them, poses are not used to infer them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, groupby

from stopgo.mission.document import Mission
from stopgo.mission.run.events import AnyEvent, Arrived, Homing, Pose
from stopgo.recordings.replay.matching import Match, VisitKind
from stopgo.recordings.replay.standstills import Standstill


def reported_visits(
    events: Sequence[AnyEvent], mission: Mission, standstills: Iterable[Standstill]
) -> tuple[Match, ...]:
    """Return the visits that a run reports, and standstills from its poses outside these visits."""
    visits = list(_visits(events, mission))
    reported = [match.standstill for match in visits]
    extra = [
        _extra(standstill, mission)
        for standstill in standstills
        if not any(_overlap(standstill, one) for one in reported)
    ]
    return tuple(sorted([*visits, *extra], key=lambda match: match.standstill.begin_ns))


def _visits(events: Sequence[AnyEvent], mission: Mission) -> Iterator[Match]:
    """Yield visits: from an arrival to the last event of that stop before another stop or the return."""
    numbers = {stop.id: k for k, stop in enumerate(mission.stops)}
    known: set[int] = set()
    homing = accumulate(isinstance(event, Homing) for event in events)
    of_stops = [
        (str(stop), home, event)
        for event, home in zip(events, homing, strict=True)
        if (stop := getattr(event, "stop", None)) in numbers
    ]
    for (stop, _), stop_events in groupby(of_stops, key=lambda item: item[:2]):
        group = [event for _, _, event in stop_events]
        arrived = next((k for k, event in enumerate(group) if isinstance(event, Arrived)), None)
        if arrived is None:
            continue
        number = numbers[stop]
        how: VisitKind = "back" if number in known else "visit"
        known.add(number)
        standstill = _standstill(group[arrived:])
        position = mission.stops[number]
        yield Match(standstill, how, number, math.dist(standstill.xy, (position.x, position.y)), number)


def _standstill(events: Sequence[AnyEvent]) -> Standstill:
    poses = [pose for event in events if isinstance(pose := getattr(event, "pose", None), Pose)]
    last = poses[-1]
    moved = max(math.dist((pose.x, pose.y), (last.x, last.y)) for pose in poses)
    return Standstill(events[0].robot_ns, events[-1].robot_ns, last.x, last.y, last.heading, moved)


def _extra(standstill: Standstill, mission: Mission) -> Match:
    away = [math.dist(standstill.xy, (stop.x, stop.y)) for stop in mission.stops]
    return Match(standstill, "extra", None, min(away), away.index(min(away)))


def _overlap(one: Standstill, other: Standstill) -> bool:
    return one.begin_ns <= other.end_ns and other.begin_ns <= one.end_ns
