"""When a robot stood at its stops by its own word: nothing is inferred from poses where it was told."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, groupby

from stopgo.mission.document import Mission
from stopgo.mission.run.events import AnyEvent, Arrived, Homing, Pose
from stopgo.recordings.replay.matching import HaltKind, Match
from stopgo.recordings.replay.standstills import Standing


def told_visits(events: Sequence[AnyEvent], mission: Mission, halts: Iterable[Standing]) -> tuple[Match, ...]:
    """The visits that a run tells of, and of the halts seen in its poses those at no time of a visit."""
    visits = list(_visits(events, mission))
    taken = [match.standing for match in visits]
    extra = [_extra(halt, mission) for halt in halts if not any(_overlap(halt, one) for one in taken)]
    return tuple(sorted([*visits, *extra], key=lambda match: match.standing.begin_ns))


def _visits(events: Sequence[AnyEvent], mission: Mission) -> Iterator[Match]:
    """From an arrival to the last that is told of the stop before another one, or before the way home."""
    numbers = {stop.id: k for k, stop in enumerate(mission.stops)}
    known: set[int] = set()
    homeward = accumulate(isinstance(event, Homing) for event in events)
    of_stops = [
        (str(stop), home, event)
        for event, home in zip(events, homeward, strict=True)
        if (stop := getattr(event, "stop", None)) in numbers
    ]
    for (stop, _), told in groupby(of_stops, key=lambda item: item[:2]):
        group = [event for _, _, event in told]
        arrived = next((k for k, event in enumerate(group) if isinstance(event, Arrived)), None)
        if arrived is None:
            continue
        number = numbers[stop]
        how: HaltKind = "back" if number in known else "visit"
        known.add(number)
        halt = _standing(group[arrived:])
        place = mission.stops[number]
        yield Match(halt, how, number, math.dist(halt.xy, (place.x, place.y)), number)


def _standing(events: Sequence[AnyEvent]) -> Standing:
    poses = [pose for event in events if isinstance(pose := getattr(event, "pose", None), Pose)]
    last = poses[-1]
    moved = max(math.dist((pose.x, pose.y), (last.x, last.y)) for pose in poses)
    return Standing(events[0].robot_ns, events[-1].robot_ns, last.x, last.y, last.heading, moved)


def _extra(halt: Standing, mission: Mission) -> Match:
    away = [math.dist(halt.xy, (stop.x, stop.y)) for stop in mission.stops]
    return Match(halt, "extra", None, min(away), away.index(min(away)))


def _overlap(one: Standing, other: Standing) -> bool:
    return one.begin_ns <= other.end_ns and other.begin_ns <= one.end_ns
