"""Which items of a list belong to which stop, so that an item's number tells what a vehicle is doing."""

from __future__ import annotations

from dataclasses import dataclass

from msgspec.structs import replace

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.items import ItemList, Placed


@dataclass(frozen=True)
class StopItems:
    """A stop's items by their places in an `ItemList`."""

    stop: str
    first: int
    """Where the way to the stop begins: its first corner, or its waypoint."""
    at: int
    """Its waypoint."""
    scan: int
    """What follows settling: the trigger, or the wait for the scan."""
    after: int
    """What comes once the scan is over."""


@dataclass(frozen=True)
class ListedMission:
    """A mission and the list by which a vehicle drives it."""

    mission: Mission
    sent: ItemList
    stops: tuple[StopItems, ...]
    """One for each of the mission's stops, in their order."""

    @property
    def end(self) -> int:
        """The place that means that all is done."""
        return len(self.sent.placed)

    def place(self, sequence: int) -> int:
        """Place in the list of a sequence number on the vehicle; home counts as the first."""
        return max(0, min(self.end, autopilot_named(self.sent.autopilot).index(sequence)))

    def sequence(self, place: int) -> int:
        """Number on the vehicle of the item at a place of the list."""
        return autopilot_named(self.sent.autopilot).sequence(place)

    @property
    def speed(self) -> float | None:
        """What the first change of speed in the list sets, metres per second."""
        return next((one.item.params[1] for one in self.sent.placed if one.role == "speed"), None)


def listed_mission(mission: Mission, sent: ItemList) -> ListedMission:
    """A mission that was sent as this list.

    Raises
    ------
    InputError
        If a stop of the mission is not in the list.
    """
    return ListedMission(
        _forward(mission), sent, tuple(_stop_items(stop.id, sent.placed) for stop in mission.stops)
    )


def _forward(mission: Mission) -> Mission:
    """The mission as AUTO can do it, forward only: where a stop says "home", somebody must decide."""
    stops = (replace(stop, on_failure="ask") if stop.on_failure == "home" else stop for stop in mission.stops)
    return replace(mission, stops=tuple(stops))


def _stop_items(stop: str, placed: tuple[Placed, ...]) -> StopItems:
    own = [
        place for place, one in enumerate(placed) if one.stop == stop and one.role not in ("speed", "return")
    ]
    at = next((place for place in own if placed[place].role == "stop"), None)
    if at is None:
        raise InputError(f"stop {stop} is not among the items that were sent; push the mission again")
    settles = [place for place in own if placed[place].role == "settle"]
    return StopItems(stop, own[0], at, max([at, *settles]) + 1, own[-1] + 1)
