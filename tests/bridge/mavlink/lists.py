"""Item lists for the uploader's tests, and what a scripted vehicle holds of them."""

from __future__ import annotations

from stopgo.bridge.mavlink.vehicle_link.messages import item_message
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.items import Command, Item, ItemList, MavFrame, Placed
from stopgo.mission.mavlink.read_back import upload_of
from stopgo.mission.mavlink.telemetry import Message
from tests.bridge.mavlink.scripted import VEHICLE

SITE = SiteOrigin(lat=47.0, lon=8.0, alt=0.0, heading_deg=0.0)


def stops(count: int, autopilot: str = "generic", *, east: int = 0) -> ItemList:
    """For each of so many stops, each 100 steps of 1e-7 degrees on, a waypoint and a delay."""
    placed = (one for number in range(1, count + 1) for one in _stop(number, autopilot, east))
    return ItemList(autopilot, SITE, tuple(placed))


def _stop(number: int, autopilot: str, east: int) -> tuple[Placed, Placed]:
    frame = autopilot_named(autopilot).frame
    x, y = 470_000_000 + 100 * number, 80_000_000 + east
    there = Item(Command.NAV_WAYPOINT, frame, params=(1.0, 0.0, 0.0, 0.0), x=x, y=y)
    wait = Item(Command.NAV_DELAY, MavFrame.MISSION, params=(2.5, -1.0, -1.0, -1.0))
    return Placed(there, "stop", f"S{number}"), Placed(wait, "scan", f"S{number}")


def held(sent: ItemList) -> list[Message]:
    """Items that a vehicle holds after an upload of the list."""
    keep = autopilot_named(sent.autopilot).kept
    return [item_message(keep(item), seq, VEHICLE) for seq, item in enumerate(upload_of(sent))]
