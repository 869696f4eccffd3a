"""An item list on a vehicle: its upload, and the comparison of the items read back with the sent ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from stopgo.mission.document import Point
from stopgo.mission.frames.geodesy import Geodetic, from_geodetic, from_steps, to_steps
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.items import Command, Item, ItemList, MavFrame, Placed

CLOSE = 1e-6
"""Relative difference within which two float32 numbers are the same: some sixteen of their steps."""


NO_PLACE = (MavFrame.MISSION, MavFrame.GLOBAL)
"""Frames in which a release returns an item without a position; the choice between them means nothing.

Measured: MISSION by ArduPilot Rover 4.7-dev, GLOBAL by 4.8-dev.
"""


def point_at(sent: ItemList, lat: int, lon: int) -> Point:
    """Return the point of the site for the vehicle's position in steps of 1e-7 degrees."""
    return from_geodetic(sent.origin, from_steps(lat, lon), autopilot_named(sent.autopilot).rule)


def home_item(origin: SiteOrigin) -> Item:
    """Return the home item: the site's origin, with its altitude above the sea."""
    lat, lon = to_steps(Geodetic(lat=origin.lat, lon=origin.lon))
    return Item(Command.NAV_WAYPOINT, MavFrame.GLOBAL_INT, x=lat, y=lon, z=origin.alt)


def upload_of(sent: ItemList) -> tuple[Item, ...]:
    """Return the items as sent, numbered from 0, with home in front if the vehicle requires it."""
    home = (home_item(sent.origin),) if autopilot_named(sent.autopilot).home_first else ()
    return (*home, *sent.items)


def differences(sent: ItemList, read: Sequence[Item], autopilot: Autopilot | None = None) -> tuple[str, ...]:
    """Return the differences between a vehicle's items and the expected ones, a line each; empty if none.

    `read` holds all items of the vehicle, with its home; homes are not compared. Each field is compared with
    the value that the autopilot (that of the list, unless another is given) keeps of it.
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
    if predicted["frame"] == MavFrame.MISSION and read.frame in NO_PLACE:
        predicted["frame"] = read.frame
    for field, value in _fields(read).items():
        if not _equal(value, predicted[field]):
            yield (
                f"item {sequence} ({what}): {field} sent {sent[field]:.10g}, "
                f"expected back {predicted[field]:.10g}, is {value:.10g}"
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
