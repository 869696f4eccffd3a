"""The own log of an autopilot that drives our mission by itself, a file for each boot."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from stopgo.bridge.mavlink.simulated.vehicle import Vehicle
from stopgo.mission.mavlink.items import Item
from stopgo.mission.mavlink.recognise import TRIGGERS
from stopgo.mission.run.events import Pose
from tests.recordings.logs.writing import write_dataflash, write_ulog
from tests.recordings.replay.auto_vehicle import ORIGIN

Kept = Callable[[int, str], bool]
"""Does the log keep a message, by its time in nanoseconds and its name?"""
POSE, ITEM, PICTURE = "LOCAL_POSITION_NED", "MISSION_CURRENT", "CAMERA_IMAGE_CAPTURED"
POSE_EVERY_NS = 10**8


@dataclass
class Boot:
    """Rows of one log; times in nanoseconds of the run, `since` is that of the boot."""

    since_ns: int
    poses: list[tuple[int, Pose]] = field(default_factory=list)
    modes: list[tuple[int, str]] = field(default_factory=list)
    lists: list[tuple[int, tuple[Item, ...]]] = field(default_factory=list)
    begun: list[tuple[int, int, Item]] = field(default_factory=list)
    """Items that the vehicle began: time, number and item."""
    pictures: list[tuple[int, int, Item]] = field(default_factory=list)
    """Items that triggered the scanner."""


@dataclass
class BlackBox:
    """A vehicle's own logs, while it drives."""

    boots: list[Boot] = field(default_factory=list)

    def watch(self, vehicle: Vehicle) -> None:
        """Write down what the vehicle does from now on."""
        advance, events = vehicle.advance, vehicle.auto._events

        def advanced() -> None:
            advance()
            self._look(vehicle)

        def current(number: int) -> None:
            items = vehicle.store.stored.mission
            if number < len(items) and self.boots and vehicle.auto.state == "active":
                self.boots[-1].begun.append((vehicle.now_ns, number, items[number]))
            events.current(number)

        def trigger(number: int, seconds: float, now_ns: int) -> None:
            if self.boots:
                self.boots[-1].pictures.append((now_ns, *_trigger_after(vehicle)))
            events.trigger(number, seconds, now_ns)

        vehicle.advance = advanced  # type: ignore[method-assign]
        vehicle.auto._events = replace(events, current=current, trigger=trigger)

    def _look(self, vehicle: Vehicle) -> None:
        since, now = vehicle.time.booted_ns, vehicle.now_ns
        if not self.boots or self.boots[-1].since_ns != since:
            self.boots.append(Boot(since))
        boot = self.boots[-1]
        if not boot.poses or now >= boot.poses[-1][0] + POSE_EVERY_NS:
            boot.poses.append((now, vehicle.motion().pose))
        if not boot.modes or boot.modes[-1][1] != vehicle.mode:
            boot.modes.append((now, vehicle.mode))
        items = vehicle.store.stored.mission
        if items and (not boot.lists or boot.lists[-1][1] != items):
            boot.lists.append((now, items))


def _trigger_after(vehicle: Vehicle) -> tuple[int, Item]:
    """The trigger that comes next in the list."""
    items, since = vehicle.store.stored.mission, vehicle.auto.current
    return next((k, item) for k, item in enumerate(items) if k >= since and item.command in TRIGGERS)


KINDS = {
    "XKF1": ("QBffff", "TimeUS,C,PN,PE,PD,Yaw"),
    "ORGN": ("QBLLf", "TimeUS,Type,Lat,Lng,Alt"),
    "MODE": ("QMB", "TimeUS,Mode,ModeNum"),
    "CMD": ("QHHHffffLLfB", "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame"),
    "MISE": ("QHHHffffLLfB", "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame"),
}
MODE_NUMBERS = {"manual": 0, "hold": 4, "auto": 10, "guided": 15}
NAV_STATES = {"manual": 0, "hold": 4, "auto": 3, "guided": 14}


def dataflash_of(boot: Boot, path: Path, kept: Kept) -> Path:
    """An ArduPilot .BIN, without the date: no GPS receiver is in a building."""
    site = (round(ORIGIN.lat * 1e7), round(ORIGIN.lon * 1e7), ORIGIN.alt)
    rows: list[tuple[int, str, tuple[Any, ...]]] = [(boot.since_ns, "ORGN", (kind, *site)) for kind in (1, 0)]
    rows += [(ns, "MODE", (MODE_NUMBERS[mode],) * 2) for ns, mode in boot.modes]
    for ns, items in boot.lists:
        rows += [(ns, "CMD", _command(number, item, len(items))) for number, item in enumerate(items)]
    total = len(boot.lists[-1][1]) if boot.lists else 0
    begun = [*(boot.begun if kept(0, ITEM) else ()), *(boot.pictures if kept(0, PICTURE) else ())]
    rows += [(ns, "MISE", _command(number, item, total)) for ns, number, item in begun]
    for ns, pose in boot.poses:
        if kept(ns, POSE):
            yaw = math.degrees(math.pi / 2 - pose.heading) % 360
            rows.append((ns, "XKF1", (0, pose.y, pose.x, 0.0, yaw)))
    timed = [
        (name, ((ns - boot.since_ns) // 1000 + 10**6, *values))
        for ns, name, values in sorted(rows, key=lambda row: row[0])
    ]
    return write_dataflash(path, timed, KINDS)


def _command(number: int, item: Item, total: int) -> tuple[Any, ...]:
    return (total, number, item.command, *item.params, item.x, item.y, item.z, item.frame)


LOCAL = (
    *("uint64_t timestamp", "float x", "float y", "float z", "float heading"),
    *("double ref_lat", "double ref_lon", "float ref_alt"),
    *("bool xy_valid", "bool z_valid", "bool xy_global", "bool z_global"),
)


def ulog_of(boot: Boot, path: Path, kept: Kept) -> Path:
    """A PX4 .ulg."""

    def us(ns: int) -> int:
        return (ns - boot.since_ns) // 1000 + 10**6

    site = (ORIGIN.lat, ORIGIN.lon, ORIGIN.alt)
    places = [
        (us(ns), pose.y, pose.x, 0.0, math.pi / 2 - pose.heading, *site, *(True,) * 4)
        for ns, pose in boot.poses
        if kept(ns, POSE)
    ]
    tables: dict[str, Any] = {
        "vehicle_local_position": (LOCAL, places),
        "vehicle_status": (
            ("uint64_t timestamp", "uint8_t nav_state"),
            [(us(ns), NAV_STATES[mode]) for ns, mode in boot.modes],
        ),
    }
    if kept(0, PICTURE):
        shots = [(us(ns), number) for number, (ns, *_) in enumerate(boot.pictures)]
        tables["camera_trigger"] = (("uint64_t timestamp", "uint32_t seq"), shots)
    return write_ulog(path, tables)
