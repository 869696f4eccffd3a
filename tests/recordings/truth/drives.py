"""Drives with a known truth: which stops were scanned, each within its tolerance and for long enough."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from msgspec.structs import replace as changed

from stopgo.mission.document import Mission, Point, with_digest
from tests.recordings.replay.driving import Drive, wandering

STOPS = 8
STOREY_M = 3.2


@dataclass(frozen=True)
class Visit:
    """One standstill of a drive."""

    stop: int | None
    """Index of the stop; None for a halt on the way to the next one."""
    off: Point = (0.0, 0.0)
    """Position error, metres."""
    stay: float = 1.0
    """Fraction of the planned time."""


@dataclass(frozen=True)
class Tour:
    """A drive of a mission."""

    mission: Mission
    """The mission that the log is compared with."""
    drive: Drive
    good: tuple[bool, ...]
    """True for each stop that was scanned as planned."""
    height: Callable[[np.ndarray], np.ndarray] = np.zeros_like
    """Height over the mission's level at seconds (n,)."""
    away: bool = False
    """True if the drive is of another mission: a log of it should be refused, or told as a no."""

    @property
    def answer(self) -> str:
        return "yes" if all(self.good) else "no"


def mission_with_return(seed: int) -> Mission:
    """A mission of eight stops that returns to its start by the way it came from the last stop."""
    plain = wandering(seed, stops=STOPS)
    last = plain.stops[-1]
    corner = (last.x, plain.start.y)
    return with_digest(changed(plain, return_=((last.x, last.y), corner, (plain.start.x, plain.start.y))))


def toured(mission: Mission, visits: list[Visit], *, home: bool = True) -> Drive:
    """Drive the visits in their order: to the plan's next stop by its approach, else in a straight line."""
    robot = mission.robot
    pace = {"speed": robot.speed, "turn_rate": robot.turn_rate}
    drive = Drive(mission.start.x, mission.start.y, mission.start.heading)
    drive.rows.append((0.0, drive.x, drive.y, drive.heading))
    drive.stay(3.0)
    drive.halts.clear()
    before = -1
    for visit, following in pairwise([*visits, Visit(None)]):
        if visit.stop is None:
            _halt_on_the_way(drive, mission, following.stop, visit.stay)
            continue
        stop = mission.stops[visit.stop]
        path = stop.approach[1:] if visit.stop == before + 1 else ((stop.x, stop.y),)
        for point in path[:-1]:
            drive.go(point, **pace)
        drive.go((stop.x + visit.off[0], stop.y + visit.off[1]), **pace)
        before = visit.stop
        if visit.stay > 0:
            drive.turn(stop.heading, turn_rate=robot.turn_rate)
            drive.stay(visit.stay * (stop.settle_s + stop.scan.duration_s), visit.stop)
    for point in (mission.return_ or ()) if home else ():
        drive.go(point, **pace)
    if home:
        drive.stay(20.0)
        drive.halts.pop()
    return drive


def _halt_on_the_way(drive: Drive, mission: Mission, to: int | None, stay: float) -> None:
    """Stand somewhere between here and the next stop, then go on."""
    if to is None:
        return
    point = mission.stops[to].approach[1]
    middle = ((drive.x + point[0]) / 2, (drive.y + point[1]) / 2)
    drive.go(middle, speed=mission.robot.speed, turn_rate=mission.robot.turn_rate)
    drive.stay(20.0 * stay)


def truth_of(mission: Mission, drive: Drive) -> tuple[bool, ...]:
    """Return for each stop: was there a standstill within its tolerance, long enough for its scan?"""
    return tuple(
        any(
            math.dist((halt.x, halt.y), (stop.x, stop.y)) <= stop.tolerance_m
            and halt.end_s - halt.begin_s >= 0.95 * (stop.settle_s + stop.scan.duration_s)
            for halt in drive.halts
        )
        for stop in mission.stops
    )


def _tour(mission: Mission, visits: list[Visit], *, home: bool = True) -> Tour:
    drive = toured(mission, visits, home=home)
    return Tour(mission, drive, truth_of(mission, drive))


Mishap = Callable[[Mission, np.random.Generator], Tour]


def _all(mission: Mission) -> list[Visit]:
    return [Visit(k) for k in range(len(mission.stops))]


def as_planned(mission: Mission, chance: np.random.Generator) -> Tour:
    """Every stop within 10 mm."""
    return _tour(mission, [replace(one, off=_off(chance, 0.0, 0.01)) for one in _all(mission)])


def _off(chance: np.random.Generator, least: float, most: float) -> Point:
    far, turn = chance.uniform(least, most), chance.uniform(0, math.tau)
    return (far * math.cos(turn), far * math.sin(turn))


def one_skipped(mission: Mission, chance: np.random.Generator) -> Tour:
    """One stop in the middle is passed without a standstill."""
    left = int(chance.integers(1, STOPS - 1))
    return _tour(mission, [replace(one, stay=0.0) if one.stop == left else one for one in _all(mission)])


def ends_skipped(mission: Mission, chance: np.random.Generator) -> Tour:
    """The first or the last stop is passed without a standstill."""
    left = int(chance.choice([0, STOPS - 1]))
    return _tour(mission, [replace(one, stay=0.0) if one.stop == left else one for one in _all(mission)])


def one_left_out(mission: Mission, chance: np.random.Generator) -> Tour:
    """One stop in the middle is not driven to: the robot goes straight to the next one."""
    left = int(chance.integers(1, STOPS - 1))
    return _tour(mission, [one for one in _all(mission) if one.stop != left])


def one_off(mission: Mission, chance: np.random.Generator) -> Tour:
    """One scan is made 0.1 to 0.5 m off its stop."""
    where, off = int(chance.integers(STOPS)), _off(chance, 0.1, 0.5)
    return _tour(mission, [replace(one, off=off) if one.stop == where else one for one in _all(mission)])


def one_far_off(mission: Mission, chance: np.random.Generator) -> Tour:
    """One scan is made 1.2 to 2 m off its stop."""
    where, off = int(chance.integers(STOPS)), _off(chance, 1.2, 2.0)
    return _tour(mission, [replace(one, off=off) if one.stop == where else one for one in _all(mission)])


def one_just_off(mission: Mission, chance: np.random.Generator) -> Tour:
    """One scan is made 15 to 30 mm outside its tolerance of 50 mm."""
    where, off = int(chance.integers(STOPS)), _off(chance, 0.065, 0.08)
    return _tour(mission, [replace(one, off=off) if one.stop == where else one for one in _all(mission)])


def all_off_alike(mission: Mission, chance: np.random.Generator) -> Tour:
    """Every scan is made 0.12 m off its stop, all to the same side: only poses of a map can show it."""
    off = _off(chance, 0.12, 0.12)
    return _tour(mission, [replace(one, off=off) for one in _all(mission)])


def one_short(mission: Mission, chance: np.random.Generator) -> Tour:
    """One standstill is a third as long as its scan."""
    where = int(chance.integers(STOPS))
    return _tour(mission, [replace(one, stay=0.33) if one.stop == where else one for one in _all(mission)])


def short_then_long(mission: Mission, chance: np.random.Generator) -> Tour:
    """A stop is tried for a third of its time, left, and visited again for all of it."""
    where = int(chance.integers(1, STOPS))
    visits = _all(mission)
    visits[where : where + 1] = [Visit(where, stay=0.33), Visit(where - 1), Visit(where)]
    return _tour(mission, visits)


def repeated(mission: Mission, chance: np.random.Generator) -> Tour:
    """Two stops are visited twice."""
    where = int(chance.integers(1, STOPS))
    visits = _all(mission)
    visits[where + 1 : where + 1] = [Visit(where - 1), Visit(where)]
    return _tour(mission, visits)


def another_order(mission: Mission, chance: np.random.Generator) -> Tour:
    """All stops are visited, two of them exchanged."""
    where = int(chance.integers(0, STOPS - 1))
    visits = _all(mission)
    visits[where], visits[where + 1] = visits[where + 1], visits[where]
    return _tour(mission, visits)


def shuffled(mission: Mission, chance: np.random.Generator) -> Tour:
    """All stops are visited, in any order."""
    return _tour(mission, [Visit(int(k)) for k in chance.permutation(STOPS)])


def backwards(mission: Mission, chance: np.random.Generator) -> Tour:
    """All stops are visited, the last one first."""
    return _tour(mission, _all(mission)[::-1])


def skipped_till_the_end(mission: Mission, chance: np.random.Generator) -> Tour:
    """A stop is passed, and visited after the last one."""
    where = int(chance.integers(1, STOPS - 2))
    visits = [replace(one, stay=0.0) if one.stop == where else one for one in _all(mission)]
    return _tour(mission, [*visits, Visit(where)])


def waits_on_the_way(mission: Mission, chance: np.random.Generator) -> Tour:
    """The robot waits on the way, three times."""
    visits: list[Visit] = []
    waits = set(chance.choice(STOPS, 3, replace=False).tolist())
    for one in _all(mission):
        visits += [Visit(None), one] if one.stop in waits else [one]
    return _tour(mission, visits)


def given_up(mission: Mission, chance: np.random.Generator) -> Tour:
    """The run is given up in the middle, and the robot drives home."""
    last = int(chance.integers(3, STOPS - 1))
    return _tour(mission, _all(mission)[:last])


def twice_in_one_log(mission: Mission, chance: np.random.Generator) -> Tour:
    """A run is given up in the middle; a second one, from the start, is whole."""
    last = int(chance.integers(3, STOPS - 1))
    drive = toured(mission, _all(mission)[:last])
    again = toured(mission, _all(mission))
    return _joined(mission, drive, again)


def whole_and_given_up(mission: Mission, chance: np.random.Generator) -> Tour:
    """A whole run, and a second one that is given up."""
    last = int(chance.integers(3, STOPS - 1))
    return _joined(mission, toured(mission, _all(mission)), toured(mission, _all(mission)[:last]))


def _joined(mission: Mission, one: Drive, other: Drive) -> Tour:
    rows = [(one.seconds + s, x, y, heading) for s, x, y, heading in other.rows[1:]]
    halts = [
        replace(halt, begin_s=halt.begin_s + one.seconds, end_s=halt.end_s + one.seconds)
        for halt in other.halts
    ]
    whole = Drive(
        other.x, other.y, other.heading, one.seconds + other.seconds, one.rows + rows, one.halts + halts
    )
    return Tour(mission, whole, truth_of(mission, whole))


def another_storey(mission: Mission, chance: np.random.Generator) -> Tour:
    """The whole run is driven three storeys higher."""
    tour = as_planned(mission, chance)
    return replace(tour, good=(False,) * STOPS, height=lambda s: np.full_like(s, 3 * STOREY_M))


def climbs(mission: Mission, chance: np.random.Generator) -> Tour:
    """After a stop in the middle the robot drives on, one storey higher."""
    tour, last = as_planned(mission, chance), int(chance.integers(2, STOPS - 2))
    from_s = next(halt for halt in tour.drive.halts if halt.stop == last).end_s
    return replace(
        tour,
        good=tuple(k <= last for k in range(STOPS)),
        height=lambda s: np.clip((s - from_s) / 3, 0, 1) * STOREY_M,
    )


def mirrored(mission: Mission, chance: np.random.Generator) -> Tour:
    """The drawing was mirrored: the robot drove the mirror image."""
    flipped = _mapped(mission, lambda x, y: (x, -y))
    drive = toured(flipped, _all(flipped))
    return Tour(mission, drive, truth_of(mission, drive), away=True)


def another_mission(mission: Mission, chance: np.random.Generator) -> Tour:
    """The robot drove another mission of the same floor, whose stops lie between."""
    return replace(shifted(mission, (0.9, -0.7)), away=True)


def shifted(mission: Mission, by: Point) -> Tour:
    """The robot drove from its start to stops that all lie off the mission's."""
    other = _mapped(mission, lambda x, y: (x + by[0], y + by[1]))
    drive = toured(other, _all(other))
    return Tour(mission, drive, truth_of(mission, drive))


def about_the_start(mission: Mission, turn: float, scale: float = 1.0) -> Tour:
    """The whole drive is turned about the start, or stretched from it."""
    start, cos, sin = mission.start, scale * math.cos(turn), scale * math.sin(turn)

    def moved(x: float, y: float) -> Point:
        x, y = x - start.x, y - start.y
        return (start.x + cos * x - sin * y, start.y + sin * x + cos * y)

    other = _mapped(mission, moved)
    stops = tuple(changed(stop, heading=stop.heading + turn) for stop in other.stops)
    drive = toured(changed(other, stops=stops), _all(other))
    return Tour(mission, drive, truth_of(mission, drive))


def turned_map(mission: Mission, chance: np.random.Generator) -> Tour:
    """The robot's map is turned by 0.4 to 3 degrees against the drawing."""
    return about_the_start(mission, float(chance.choice([-1, 1]) * chance.uniform(0.007, 0.05)))


def stretched_map(mission: Mission, chance: np.random.Generator) -> Tour:
    """The robot's map is 1 to 3 % larger or smaller than the drawing."""
    return about_the_start(mission, 0.0, 1.0 + float(chance.choice([-1, 1]) * chance.uniform(0.01, 0.03)))


def _mapped(mission: Mission, to: Callable[[float, float], Point]) -> Mission:
    stops = []
    for stop in mission.stops:
        x, y = to(stop.x, stop.y)
        stops.append(changed(stop, x=x, y=y, approach=tuple(to(*point) for point in stop.approach)))
    back = tuple(to(*point) for point in mission.return_ or ())
    return changed(mission, stops=tuple(stops), return_=back)


MISHAPS: tuple[Mishap, ...] = (
    as_planned,
    one_skipped,
    ends_skipped,
    one_left_out,
    one_off,
    one_far_off,
    one_just_off,
    all_off_alike,
    one_short,
    short_then_long,
    repeated,
    another_order,
    shuffled,
    backwards,
    skipped_till_the_end,
    waits_on_the_way,
    given_up,
    twice_in_one_log,
    whole_and_given_up,
    another_storey,
    climbs,
    mirrored,
    another_mission,
    turned_map,
    stretched_map,
)
