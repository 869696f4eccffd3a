"""Roles of items, for lists that come from a vehicle or from a third-party file.

A list is read waypoint by waypoint: the items after a waypoint, up to the next, are executed there. Waypoints
with a wait or a trigger are stops, those between are corners of the route.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.items import Command, Item, ItemRole, MavFrame, Placed
from stopgo.mission.mavlink.stop_numbers import stop_numbered

PLACES = frozenset({Command.NAV_WAYPOINT, Command.NAV_LOITER_TIME})
"""Commands with a position to drive to; param1 is the seconds to stay."""
WAITS = frozenset({Command.NAV_DELAY, Command.NAV_SCRIPT_TIME})
TRIGGERS = frozenset(
    {Command.DO_SEND_SCRIPT_MESSAGE, Command.IMAGE_START_CAPTURE, Command.DO_DIGICAM_CONTROL}
)
GLOBAL_FRAMES = frozenset({
    MavFrame.GLOBAL, MavFrame.MISSION, MavFrame.GLOBAL_RELATIVE_ALT, MavFrame.GLOBAL_INT,
    MavFrame.GLOBAL_RELATIVE_ALT_INT, MavFrame.GLOBAL_TERRAIN_ALT, MavFrame.GLOBAL_TERRAIN_ALT_INT,
})  # fmt: skip


@dataclass(frozen=True)
class _Group:
    """A waypoint and the actions there; the first group of a list may have no waypoint."""

    index: int
    items: tuple[Item, ...]

    @property
    def place(self) -> Item | None:
        return self.items[0] if self.items and self.items[0].command in PLACES else None

    @property
    def acts(self) -> bool:
        return any(item.command in WAITS | TRIGGERS for item in self.items)

    @property
    def trigger(self) -> int | None:
        """Index of the trigger within the group."""
        return next((i for i, item in enumerate(self.items) if item.command in TRIGGERS), None)


def recognise(
    items: Sequence[Item], *, mission: Mission | None = None, first: int = 1, plain_stops: bool = False
) -> tuple[Placed, ...]:
    """Return each item with its role.

    If no item waits or triggers, waypoints with a hold are the stops; if none has a hold either, all are
    if `plain_stops`.

    Parameters
    ----------
    items
        In order, without home.
    mission
        Owner of the triggers' numbers; without it a stop's id is its number, or its index from 1.
    first
        Number of the first item in error messages.

    Raises
    ------
    InputError
        If an item has no meaning in a mission of scan stops, or there is no stop.
    """
    for number, item in enumerate(items, start=first):
        _check_item(item, number)
    groups = _groups(items)
    for group in groups:
        _check_group(group, first)
    stops = _stops_among(groups, plain_stops)
    if not stops:
        raise InputError("no item waits, triggers or holds: the scan stops among the waypoints are unknown")
    ids = dict(zip(stops, _ids([groups[at] for at in stops], mission), strict=True))
    placed: list[Placed] = []
    for at, group in enumerate(groups):
        ahead = bisect_left(stops, at)
        stop = ids[stops[ahead]] if ahead < len(stops) else None
        placed.extend(_placed(group, here=at in ids, stop=stop))
    return tuple(placed)


def stops_of(items: Sequence[Item], mission: Mission) -> tuple[str | None, ...]:
    """Return for each item (without home) the id of the mission's stop that it belongs to or leads to."""
    return tuple(one.stop for one in recognise(items, mission=mission))


def number_carried(item: Item) -> int | None:
    """Return the stop's number that an item carries; None if it carries none."""
    carried = {
        Command.DO_SEND_SCRIPT_MESSAGE: item.params[1],
        Command.IMAGE_START_CAPTURE: item.params[3],
        Command.NAV_SCRIPT_TIME: float(item.x),
    }.get(item.command, math.nan)
    return int(carried) if 0 <= carried < math.inf and carried == math.floor(carried) else None


def _check_item(item: Item, number: int) -> None:
    if item.command == Command.DO_CHANGE_SPEED or item.command in WAITS | TRIGGERS:
        return
    if item.command not in PLACES:
        raise InputError(
            f"item {number}: {item.name} has no meaning in a mission of scan stops; leave it out "
            "(waypoints, delays, triggers and changes of speed have)"
        )
    if item.frame not in GLOBAL_FRAMES:
        raise InputError(f"item {number}: {item.name} is in frame {item.frame}; give latitude and longitude")
    if (item.x, item.y) == (0, 0):
        raise InputError(f"item {number}: {item.name} is at 0, 0, which is no position; give a position")


def _groups(items: Sequence[Item]) -> list[_Group]:
    starts = [index for index, item in enumerate(items) if item.command in PLACES]
    starts = starts if starts[:1] == [0] else [0, *starts]
    ends = [*starts[1:], len(items)]
    return [_Group(start, tuple(items[start:end])) for start, end in zip(starts, ends, strict=True)]


def _check_group(group: _Group, first: int) -> None:
    if group.place is None and group.acts:
        raise InputError(f"item {first}: waits or triggers come before the first waypoint; add a waypoint")
    triggers = [group.index + i for i, item in enumerate(group.items) if item.command in TRIGGERS]
    if len(triggers) > 1:
        raise InputError(
            f"items {first + triggers[0]} and {first + triggers[1]} both trigger at one waypoint; "
            "a stop has one scan"
        )


def _stops_among(groups: Sequence[_Group], plain_stops: bool) -> list[int]:
    """Return the indices of the groups that are stops."""
    acting = [at for at, group in enumerate(groups) if group.acts]
    places = [(at, group.place) for at, group in enumerate(groups) if group.place is not None]
    holding = [at for at, place in places if place.params[0] > 0]
    return acting or holding or ([at for at, _ in places] if plain_stops else [])


def _ids(groups: Sequence[_Group], mission: Mission | None) -> list[str]:
    """Return an id for each stop: its number if all have different ones, else its index."""
    numbers = [_group_number(group) for group in groups]
    known = [number for number in numbers if number is not None]
    if len(set(known)) != len(groups):
        known = list(range(1, len(groups) + 1))
        if mission is not None and len(mission.stops) == len(groups):
            return [stop.id for stop in mission.stops]
    ids = [None if mission is None else stop_numbered(mission, number) for number in known]
    return [str(number) if name is None else name for number, name in zip(known, ids, strict=True)]


def _group_number(group: _Group) -> int | None:
    return next((number for item in group.items if (number := number_carried(item)) is not None), None)


def _placed(group: _Group, *, here: bool, stop: str | None) -> Iterator[Placed]:
    passing: ItemRole = "return" if stop is None else "corner"
    for at, item in enumerate(group.items):
        if item.command == Command.DO_CHANGE_SPEED:
            yield Placed(item, "speed")
        elif item.command in PLACES:
            yield Placed(item, "stop" if here else passing, stop)
        elif item.command in TRIGGERS:
            yield Placed(item, "trigger", stop)
        else:
            yield Placed(item, "settle" if _settles(group, at) else "scan", stop)


def _settles(group: _Group, at: int) -> bool:
    """Return True for a wait before the scan: before the trigger, or, without one, before another wait."""
    if group.trigger is not None:
        return at < group.trigger
    return any(item.command in WAITS for item in group.items[at + 1 :])
