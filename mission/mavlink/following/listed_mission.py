"""Assignment of a list's items to stops, so that an item's number shows the vehicle's progress."""

from __future__ import annotations

from dataclasses import dataclass

from msgspec.structs import replace

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.items import Command, ItemList, Placed


@dataclass(frozen=True)
class StopItems:
    """A stop's items by their indices in an `ItemList`."""

    stop: str
    first: int
    """First item of the leg to the stop: its first corner, or its waypoint."""
    at: int
    """Its waypoint."""
    scan: int
    """First item after settling: the trigger, or the wait for the scan."""
    after: int
    """First item after the scan."""


@dataclass(frozen=True)
class ListedMission:
    """A mission and the list by which a vehicle drives it."""

    mission: Mission
    sent: ItemList
    stops: tuple[StopItems, ...]
    """One for each of the mission's stops, in their order."""
    address: str = ""
    """Options of a command to this vehicle, after a space; empty if it is only observed."""

    @property
    def end(self) -> int:
        """The index that means that all is done."""
        return len(self.sent.placed)

    def place(self, sequence: int) -> int:
        """Return the index in the list of a sequence number on the vehicle; home counts as the first."""
        return max(0, min(self.end, autopilot_named(self.sent.autopilot).index(sequence)))

    def sequence(self, place: int) -> int:
        """Return the sequence number on the vehicle of the item at an index of the list."""
        return autopilot_named(self.sent.autopilot).sequence(place)

    def wait_s(self, first: int, end: int) -> float:
        """Return the waiting time of the items from `first` up to `end`, without that one, in seconds."""
        waiting = (Command.NAV_DELAY, Command.NAV_WAYPOINT)
        items = (placed.item for placed in self.sent.placed[max(0, first) : end])
        return sum(item.params[0] for item in items if item.command in waiting)

    @property
    def speed(self) -> float | None:
        """Speed of the first change of speed in the list, metres per second."""
        return next((one.item.params[1] for one in self.sent.placed if one.role == "speed"), None)


def listed_mission(mission: Mission, sent: ItemList, address: str = "") -> ListedMission:
    """Return a mission with the list that it was sent as.

    Raises
    ------
    InputError
        If a stop of the mission is not in the list.
    """
    stops = tuple(_stop_items(stop.id, sent.placed) for stop in mission.stops)
    return ListedMission(_forward(mission), sent, stops, address)


def _forward(mission: Mission) -> Mission:
    """Return the mission without returns, which AUTO cannot do: "home" at a stop becomes "ask"."""
    stops = (replace(stop, on_failure="ask") if stop.on_failure == "home" else stop for stop in mission.stops)
    return replace(mission, stops=tuple(stops))


def _stop_items(stop: str, placed: tuple[Placed, ...]) -> StopItems:
    own = [
        place for place, one in enumerate(placed) if one.stop == stop and one.role not in ("speed", "return")
    ]
    at = next((place for place in own if placed[place].role == "stop"), None)
    if at is None:
        raise InputError(f"stop {stop}: not among the sent items; push the mission again")
    settles = [place for place in own if placed[place].role == "settle"]
    return StopItems(stop, own[0], at, max([at, *settles]) + 1, own[-1] + 1)
