"""What each autopilot takes and keeps, and whether what was read back is what it should be."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from mission.document import Point, SiteOrigin
from mission.errors import InputError
from mission.geodesy import STEPS_PER_DEGREE, from_geodetic, from_steps
from mission.mavlink.items import Command, Frame, Item, ItemList, Placed
from mission.mavlink.keeping import ardupilot_keeps, as_sent, px4_keeps

UINT16_MAX = 65_535
CLOSE = 1e-6
"""Relative difference within which two float32 numbers are the same: some sixteen of their steps."""


@dataclass(frozen=True)
class Autopilot:
    """A kind of autopilot, as a mission's writer sees it."""

    name: str
    rule: str
    """How it turns degrees into metres, one of `mission.geodesy.RULES`."""
    frame: int
    """MAV_FRAME in which places are sent; altitude 0 is the robot's floor."""
    max_items: int
    """How many items it holds, home included where item 0 is home."""
    home_first: bool
    """Item 0 is home, which the vehicle overwrites with its own."""
    commands: frozenset[int]
    """The commands that a mission of scan stops may use on it."""
    keep: Callable[[Item], Item]
    brake_hold_s: int
    """Hold (whole seconds) without which it does not stop at a waypoint."""
    keeps_arrival: bool
    """Keeps a waypoint's acceptance radius and heading."""
    reached: str
    """Where it counts a waypoint as reached, in words."""
    turns: bool
    """A rover turns to a heading that it keeps."""
    max_delay_s: float

    def kept(self, item: Item) -> Item:
        """The item as the vehicle will read it back."""
        return self.keep(item)

    def sequence(self, index: int) -> int:
        """Sequence number on the vehicle of the item at `index` of an `ItemList`."""
        return index + 1 if self.home_first else index

    def index(self, sequence: int) -> int:
        """Place in an `ItemList` of a sequence number on the vehicle; home is -1."""
        return sequence - 1 if self.home_first else sequence


# ArduPilot, source: get_next_nav_cmd gives a waypoint without hold its next leg, and AR_WPNav then calls it
# reached when the moving target passes it ("fast waypoint"), the robot being behind or cutting the corner.
# With a hold of a second or more it stops there first. Delays are milliseconds in uint32 (mode_auto.cpp).
# PX4, source: navigation.h allows 500 items on flight controllers (2 000 in older releases, 50 on the
# smallest boards, 65 534 on Linux); only multicopters brake for a hold (Mission::setActiveMissionItems),
# wait for a heading, and take a waypoint's own radius (MissionBlock::is_mission_item_reached).
AUTOPILOTS: dict[str, Autopilot] = {
    "ardupilot": Autopilot(
        name="ardupilot", rule="ardupilot", frame=Frame.GLOBAL_RELATIVE_ALT_INT, max_items=655,
        home_first=True, keep=ardupilot_keeps, brake_hold_s=1, keeps_arrival=False, max_delay_s=4_294_967.0,
        reached="within its parameter WP_RADIUS, or once past it", turns=False,
        commands=frozenset({
            Command.NAV_WAYPOINT, Command.NAV_DELAY, Command.DO_CHANGE_SPEED, Command.NAV_SCRIPT_TIME,
            Command.DO_SEND_SCRIPT_MESSAGE, Command.IMAGE_START_CAPTURE,
        }),
    ),
    "px4": Autopilot(
        name="px4", rule="px4", frame=Frame.GLOBAL_RELATIVE_ALT_INT, max_items=500,
        home_first=False, keep=px4_keeps, brake_hold_s=0, keeps_arrival=True, max_delay_s=4_294_967.0,
        reached="within its parameter NAV_ACC_RAD, 10 m unless set",
        turns=False,
        commands=frozenset({
            Command.NAV_WAYPOINT, Command.NAV_DELAY, Command.DO_CHANGE_SPEED, Command.IMAGE_START_CAPTURE,
        }),
    ),
    "generic": Autopilot(
        name="generic", rule="wgs84", frame=Frame.GLOBAL_RELATIVE_ALT_INT, max_items=UINT16_MAX,
        home_first=False, keep=as_sent, brake_hold_s=0, keeps_arrival=True, max_delay_s=4_294_967.0,
        reached="within the acceptance radius that is sent", turns=True,
        commands=frozenset({
            Command.NAV_WAYPOINT, Command.NAV_DELAY, Command.DO_CHANGE_SPEED, Command.IMAGE_START_CAPTURE,
        }),
    ),
}  # fmt: skip
"""`generic` is the specification: everything is kept, degrees are WGS84."""


def autopilot_named(name: str) -> Autopilot:
    """One of `AUTOPILOTS`.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in AUTOPILOTS:
        raise InputError(f"autopilot {name!r} is not known; it is one of {', '.join(AUTOPILOTS)}")
    return AUTOPILOTS[name]


def point_at(sent: ItemList, lat: int, lon: int) -> Point:
    """The point of the site that the vehicle of a list means by a place in steps of 1e-7 degrees."""
    return from_geodetic(sent.origin, from_steps(lat, lon), autopilot_named(sent.autopilot).rule)


def home_item(origin: SiteOrigin) -> Item:
    """The item that stands for home: the site's origin, above the sea."""
    lat, lon = (round(angle * STEPS_PER_DEGREE) for angle in (origin.lat, origin.lon))
    return Item(Command.NAV_WAYPOINT, Frame.GLOBAL_INT, x=lat, y=lon, z=origin.alt)


def upload_of(sent: ItemList) -> tuple[Item, ...]:
    """The items as they go over the wire, numbered from 0: with home in front where the vehicle wants it."""
    home = (home_item(sent.origin),) if autopilot_named(sent.autopilot).home_first else ()
    return (*home, *sent.items)


def placed_at(sent: ItemList, sequence: int) -> Placed | None:
    """The item with a sequence number on the vehicle, as MISSION_CURRENT tells it; None for home."""
    index = autopilot_named(sent.autopilot).index(sequence)
    return sent.placed[index] if 0 <= index < len(sent.placed) else None


def differences(sent: ItemList, read: Sequence[Item], autopilot: Autopilot | None = None) -> tuple[str, ...]:
    """How what a vehicle holds differs from what it should hold, a line each; empty when it does not.

    `read` is all that the vehicle gave, its home included; homes are not compared. Each field is compared
    with what the autopilot (that of the list, unless another is given) keeps of it.
    """
    vehicle = autopilot or autopilot_named(sent.autopilot)
    own = list(read[1:] if vehicle.home_first else read)
    if len(own) != len(sent.placed):
        return (f"the vehicle holds {len(own)} items, {len(sent.placed)} were sent",)
    return tuple(
        line
        for index, (placed, item) in enumerate(zip(sent.placed, own, strict=True))
        for line in _item_differences(vehicle, vehicle.sequence(index), placed, item)
    )


def _item_differences(vehicle: Autopilot, sequence: int, placed: Placed, read: Item) -> Iterator[str]:
    sent, predicted = _fields(placed.item), _fields(vehicle.kept(placed.item))
    what = placed.role if placed.stop is None else f"{placed.role} of {placed.stop}"
    for field, value in _fields(read).items():
        if not _equal(value, predicted[field]):
            yield (
                f"item {sequence} ({what}): {field} sent {sent[field]:.10g}, "
                f"should be kept as {predicted[field]:.10g}, is {value:.10g}"
            )


def _fields(item: Item) -> dict[str, float]:
    named = {f"param{number}": value for number, value in enumerate(item.params, start=1)}
    return {
        "command": item.command,
        "frame": item.frame,
        **named,
        "x": item.x,
        "y": item.y,
        "z": item.z,
        "autocontinue": int(item.autocontinue),
    }


def _equal(one: float, other: float) -> bool:
    if isinstance(one, int) and isinstance(other, int):
        return one == other
    return (math.isnan(one) and math.isnan(other)) or math.isclose(one, other, rel_tol=CLOSE, abs_tol=CLOSE)
