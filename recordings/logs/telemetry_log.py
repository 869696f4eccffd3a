"""Reader of MAVLink telemetry logs (.tlog): packets that a station received, each after its time.

Packets are found by their lengths. If a packet does not follow another one, the search continues to the next
packet with a valid checksum. Only messages that a replay needs are decoded.
"""

from __future__ import annotations

import os
import struct
from array import array
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

os.environ.setdefault("MAVLINK20", "1")
from pymavlink.dialects.v20 import ardupilotmega as dialect

from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import file_digest
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.mavlink.autopilots import autopilot_named, autopilot_of
from stopgo.mission.mavlink.autopilots.kind import ROVERS
from stopgo.mission.mavlink.items import Command, Item
from stopgo.recordings.logs.clock_steps import ALONE_NS, STEP_NS
from stopgo.recordings.logs.field_log import (
    Channel,
    FieldLog,
    LoggedMission,
    Poses,
    Reading,
    Remark,
    fixes_of,
    poses_of,
)

FORMAT = "MAVLink tlog"
STAMP = 8
MAGIC_1, MAGIC_2 = 0xFE, 0xFD
SIGNED = 1
OLDEST_US, NEWEST_US = 10**14, 4 * 10**15
"""Range of valid time stamps, 1973 to 2096: it distinguishes a packet from similar bytes."""
TICK_EVERY = 50_000
MOST_LOOKS = 1000
"""Times that go back, for which a repeated range is searched: each search takes the whole log."""
STATIONS = 250
"""Least system number of ground stations."""
DECODED = (
    "HEARTBEAT", "SYS_STATUS", "SYSTEM_TIME", "ATTITUDE", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT",
    "MISSION_ITEM", "MISSION_ITEM_INT", "MISSION_CURRENT", "MISSION_COUNT", "MISSION_ITEM_REACHED",
    "MISSION_ACK", "GPS_GLOBAL_ORIGIN", "COMMAND_LONG", "ODOMETRY", "VISION_POSITION_ESTIMATE",
    "BATTERY_STATUS", "STATUSTEXT", "CAMERA_IMAGE_CAPTURED", "CAMERA_TRIGGER",
)  # fmt: skip
"""Messages that are decoded."""
NUMBERS = frozenset(dialect.__dict__[f"MAVLINK_MSG_ID_{name}"] for name in DECODED)


class Packet(NamedTuple):
    """Packet of the log, not decoded."""

    ns: int
    number: int
    system: int
    component: int
    raw: bytes


class ReceivedMessage(NamedTuple):
    """Decoded message, and the time at which a station received it."""

    ns: int
    system: int
    message: Any


def read_telemetry_log(path: Path, reading: Reading) -> FieldLog:
    """Read a .tlog to its end.

    Raises
    ------
    InputError
        When no packet in it can be read.
    """
    scan = _FrameScan(path, reading)
    sorter = _VehicleSorter()
    for packet in scan.packets():
        sorter.take(packet)
    if not sorter.counts:
        raise InputError(f"{path}: no readable packet; check that it is a MAVLink .tlog")
    return FieldLog(
        path=str(path),
        format=FORMAT,
        digest=file_digest(path),
        messages=sum(sorter.counts.values()),
        clock="wall",
        begin_ns=sorter.span[0],
        end_ns=sorter.span[1],
        channels=sorter.channels(),
        poses=tuple(sorter.poses()),
        uploads=tuple(sorter.uploads),
        remarks=tuple(sorter.remarks),
        battery=tuple(sorter.battery),
        lost=scan.lost,
        oddities=(*sorter.oddities(), *scan.oddities),
    )


def messages_of(path: Path) -> Iterator[ReceivedMessage]:
    """Yield the messages of DECODED again, to follow the vehicle's run."""
    decoder = _Decoder()
    for packet in _FrameScan(path, Reading()).packets():
        message = decoder.message(packet)
        if message is not None:
            yield ReceivedMessage(packet.ns, packet.system, message)


class _Decoder:
    """Decoder of packets; one with a wrong checksum gives no message."""

    def __init__(self) -> None:
        self._mavlink = dialect.MAVLink(None)

    def message(self, packet: Packet) -> Any | None:
        return self.decoded(packet.raw) if packet.number in NUMBERS else None

    def decoded(self, raw: bytes) -> Any | None:
        try:
            return self._mavlink.decode(bytearray(raw))
        except (dialect.MAVError, struct.error, IndexError, UnicodeDecodeError):
            return None


class _FrameScan:
    """Search through a file from packet to packet."""

    def __init__(self, path: Path, reading: Reading) -> None:
        self._path, self._tick = path, reading.tick
        self._decoder = _Decoder()
        self.lost_bytes = self.size = self.tail_bytes = 0
        self.clock_lines: list[str] = []
        """Steps of the station's clock, one line each."""
        self.repeated = 0
        """Packets that are in the log again."""

    @property
    def lost(self) -> str:
        return f"{self.lost_bytes} of {self.size} bytes are invalid" if self.lost_bytes else ""

    @property
    def oddities(self) -> tuple[str, ...]:
        steps = tuple(self.clock_lines)
        if self.repeated:
            steps = (*steps, f"{self.repeated} packets are in the log twice, with their times; left out")
        if not self.tail_bytes:
            return steps
        text = f"the last packet is truncated ({self.tail_bytes} bytes), as when a station is switched off"
        return (*steps, text)

    def packets(self) -> Iterator[Packet]:
        """Yield the packets with times that count on where the station's clock was set back.

        A stamp far from those before and after it counts as that before it.
        """
        self.clock_lines = []
        last_ns, offset_ns = 0, 0
        for number, (packet, following) in enumerate(_with_next(self._stamped_packets()), 1):
            ns = packet.ns + offset_ns
            step_ns = ns - last_ns if last_ns else 0
            if step_ns < -STEP_NS or step_ns > ALONE_NS:
                if following is not None and abs(following.ns - packet.ns) > STEP_NS:
                    ns = last_ns  # a wrong stamp
                elif step_ns < 0:
                    offset_ns -= step_ns
                    ns = last_ns
                    self.clock_lines.append(
                        f"the station's clock steps back by {-step_ns / 1e9:.1f} s at packet {number}; "
                        "times continue in the order of writing"
                    )
            last_ns = ns
            yield packet._replace(ns=ns)

    def _stamped_packets(self) -> Iterator[Packet]:
        with self._path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
            self.size, self.lost_bytes, self.repeated = len(data), 0, 0
            repeated = _RepeatedRanges(data)
            at = steps = 0
            synchronised = False
            while at + STAMP < len(data):
                packet, end = _packet(data, at)
                followed = packet is not None and (end == len(data) or _packet(data, end)[0] is not None)
                if packet is None or not (
                    (followed and synchronised) or self._decoder.decoded(packet.raw) is not None
                ):
                    if packet is None and end > len(data) and synchronised:  # the log ends within a packet
                        self.tail_bytes = len(data) - at
                        break
                    at, synchronised = at + 1, False
                    self.lost_bytes += 1
                    continue
                if repeated.has(at, end, packet.ns):
                    self.repeated += 1
                else:
                    yield packet
                at, synchronised, steps = end, True, steps + 1
                if steps % TICK_EVERY == 0:
                    self._tick(at / self.size)


class _RepeatedRanges:
    """Ranges of a log that follow in it again, byte by byte with their times, as in overlapping parts.

    A restart would be seen there, and the vehicle's progress since then be lost.
    """

    def __init__(self, data: mmap) -> None:
        self._data = data
        self._stamps, self._begins, self._ends = array("q"), array("q"), array("q")
        """Times of the packets that are no repetition, and where they are."""
        self._next: int | None = None
        """Packet that the next one of a repeated range equals."""
        self._looks = MOST_LOOKS

    def has(self, begin: int, end: int, ns: int) -> bool:
        """Return True if a packet, stamp included, is a repetition; else remember it."""
        known = self._next
        if known is None or not self._equals(known, begin, end):
            known = self._begin_of_range(begin, end, ns)
        self._next = None if known is None else known + 1
        if known is not None:
            return True
        for column, value in ((self._stamps, ns), (self._begins, begin), (self._ends, end)):
            column.append(value)
        return False

    def _begin_of_range(self, begin: int, end: int, ns: int) -> int | None:
        """Return the packet that one equals whose time lies far back."""
        if not self._stamps or ns > self._stamps[-1] - STEP_NS or not self._looks:
            return None
        self._looks -= 1
        same = np.flatnonzero(np.array(self._stamps) == ns)
        return next((known for known in same.tolist() if self._equals(known, begin, end)), None)

    def _equals(self, known: int, begin: int, end: int) -> bool:
        if known >= len(self._stamps):
            return False
        return self._data[self._begins[known] : self._ends[known]] == self._data[begin:end]


def _with_next(packets: Iterator[Packet]) -> Iterator[tuple[Packet, Packet | None]]:
    """Yield each packet and the one after it."""
    before = next(packets, None)
    for packet in packets:
        if before is not None:
            yield before, packet
        before = packet
    if before is not None:
        yield before, None


def _packet(data: mmap, at: int) -> tuple[Packet | None, int]:
    """Return the packet whose stamp may begin here, and its end."""
    if at + STAMP + 12 > len(data) + 4:
        return None, len(data) + 1
    (stamp,) = struct.unpack_from(">Q", data, at)
    begin = at + STAMP
    if not OLDEST_US < stamp < NEWEST_US or data[begin] not in (MAGIC_1, MAGIC_2):
        return None, 0
    if data[begin] == MAGIC_1:
        end = begin + 8 + data[begin + 1]
        head = data[begin : begin + 6]
        system, component, number = head[3], head[4], head[5]
    else:
        head = data[begin : begin + 10]
        if len(head) < 10:
            return None, len(data) + 1
        end = begin + 12 + head[1] + (13 if head[2] & SIGNED else 0)
        system, component, number = head[5], head[6], int.from_bytes(head[7:10], "little")
    if end > len(data):
        return None, end
    return Packet(stamp * 1000, number, system, component, data[begin:end]), end


@dataclass
class _Vehicle:
    """Data of one system, while it is read."""

    kind: str = "generic"
    attitude: list[tuple[int, float]] = field(default_factory=list)
    local: list[tuple[int, float, float, float]] = field(default_factory=list)
    earth: list[tuple[int, float, float, float]] = field(default_factory=list)
    odometry: list[tuple[int, float, float, float, float]] = field(default_factory=list)
    origin: SiteOrigin | None = None
    mode: str = ""
    boots: int = 0
    boot_ms: int = 0
    compared: tuple[int, int] | None = None
    """Time of receipt, and ns since boot, of the last message whose clocks were compared."""
    rates: list[float] = field(default_factory=list)
    """Seconds of the vehicle in a second of receipt, between two messages that are WINDOW_NS apart."""

    def note_clock(self, ns: int, boot_ms: int) -> None:
        """Compare the vehicle's clock with that of the station."""
        before = None if boot_ms < self.boot_ms else self.compared
        now = (ns, boot_ms * 10**6)
        if before is None:
            self.compared = now
        elif ns - before[0] >= WINDOW_NS:
            self.rates.append((now[1] - before[1]) / (ns - before[0]))
            self.compared = now

    @property
    def rate(self) -> float:
        """The usual one of the rates; 1 where they are few, or the vehicle reports no time."""
        usual = float(np.median(self.rates)) if len(self.rates) >= FEWEST_WINDOWS else 1.0
        return usual if usual > 0 else 1.0


WINDOW_NS, FEWEST_WINDOWS = 2 * 10**9, 3
CHECKED = 5
UNKNOWN_BEARING = 65_535
MISSION_TYPE = 0
WITHOUT_ORIGIN = 3
"""Rank of metres from an unknown origin, where there are latitudes and longitudes."""


@dataclass
class _VehicleSorter:
    """Reads packets one after another, each by its type."""

    counts: Counter[tuple[int, int]] = field(default_factory=Counter)
    """Number of messages by system and message number."""
    vehicles: dict[int, _Vehicle] = field(default_factory=dict)
    uploads: list[LoggedMission] = field(default_factory=list)
    remarks: list[Remark] = field(default_factory=list)
    battery: list[tuple[int, float]] = field(default_factory=list)
    span: tuple[int, int] = (0, 0)
    bad: Counter[tuple[int, int]] = field(default_factory=Counter)
    """Messages with a wrong checksum; of messages that are not decoded, the first few are checked."""
    _decoder: _Decoder = field(default_factory=_Decoder)
    _items: dict[int, Item] = field(default_factory=dict)
    _announced: tuple[int, int] | None = None
    """Time at which an upload was announced, and its number of items."""
    _read_back: bool = False
    """True if the vehicle announced it: a station reads the list back."""

    def take(self, packet: Packet) -> None:
        self.counts[packet.system, packet.number] += 1
        self.span = (min(self.span[0] or packet.ns, packet.ns), max(self.span[1], packet.ns))
        if packet.number not in NUMBERS:
            self._check(packet)
            return
        message = self._decoder.message(packet)
        if message is None:
            self.bad[packet.system, packet.number] += 1
            return
        handler = getattr(self, f"_{message.get_type().lower()}", None)
        if handler is not None:
            handler(packet, message, self.vehicles.setdefault(packet.system, _Vehicle()))

    def _check(self, packet: Packet) -> None:
        key = (packet.system, packet.number)
        if self.bad[key] == self.counts[key] - 1 < CHECKED and self._decoder.decoded(packet.raw) is None:
            self.bad[key] += 1

    def _heartbeat(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        if packet.system >= STATIONS or message.autopilot == dialect.MAV_AUTOPILOT_INVALID:
            return
        kind = autopilot_of(message.autopilot)
        vehicle.kind = kind.name
        mode = kind.mode_name(message) if message.type in ROVERS else f"mode {message.custom_mode}"
        if mode != vehicle.mode:
            vehicle.mode = mode
            self.remarks.append(Remark(packet.ns, "mode", mode))

    def _attitude(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        vehicle.attitude.append((packet.ns, message.yaw))
        vehicle.note_clock(packet.ns, message.time_boot_ms)
        if message.time_boot_ms + 1000 < vehicle.boot_ms:
            vehicle.boots += 1
        vehicle.boot_ms = message.time_boot_ms

    def _local_position_ned(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        vehicle.local.append((packet.ns, message.y, message.x, -message.z))

    def _global_position_int(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        bearing = np.nan if message.hdg == UNKNOWN_BEARING else message.hdg / 100
        vehicle.earth.append((packet.ns, message.lat / 1e7, message.lon / 1e7, bearing))

    def _odometry(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        w, x, y, z = message.q
        yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        vehicle.odometry.append((packet.ns, message.y, message.x, np.pi / 2 - yaw, -message.z))

    def _gps_global_origin(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        vehicle.origin = SiteOrigin(
            lat=message.latitude / 1e7,
            lon=message.longitude / 1e7,
            alt=message.altitude / 1000,
            heading_deg=0.0,
        )

    def _sys_status(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        if 0 <= message.battery_remaining <= 100:
            self.battery.append((packet.ns, message.battery_remaining / 100))

    _battery_status = _sys_status

    def _statustext(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        self.remarks.append(Remark(packet.ns, "text", str(message.text).rstrip("\0")))

    def _command_long(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        self.remarks.append(Remark(packet.ns, "command", _command(message.command)))

    def _mission_item_reached(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        last = next((remark for remark in reversed(self.remarks) if remark.kind == "reached"), None)
        if last is None or last.number != message.seq:  # vehicles repeat it, in case one is lost
            self.remarks.append(Remark(packet.ns, "reached", f"item {message.seq}", message.seq))

    def _camera_image_captured(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        result = "" if message.capture_result == 1 else ", failed"
        self.remarks.append(
            Remark(packet.ns, "trigger", f"image {message.image_index}{result}", message.image_index)
        )

    def _camera_trigger(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        self.remarks.append(Remark(packet.ns, "trigger", f"trigger {message.seq}", message.seq))

    def _mission_count(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        if getattr(message, "mission_type", MISSION_TYPE) == MISSION_TYPE:
            self._items, self._announced = {}, (packet.ns, message.count)
            self._read_back = packet.system < STATIONS

    def _mission_item_int(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        if getattr(message, "mission_type", MISSION_TYPE) == MISSION_TYPE:
            params = (message.param1, message.param2, message.param3, message.param4)
            self._item(
                packet,
                message.seq,
                Item(message.command, message.frame, params, message.x, message.y, message.z),
            )

    def _mission_item(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        if getattr(message, "mission_type", MISSION_TYPE) == MISSION_TYPE:
            params = (message.param1, message.param2, message.param3, message.param4)
            x, y = (round(value * 1e7) for value in (message.x, message.y))
            self._item(packet, message.seq, Item(message.command, message.frame, params, x, y, message.z))

    def _item(self, packet: Packet, sequence: int, item: Item) -> None:
        self._items[sequence] = item
        if self._announced is not None and len(self._items) >= self._announced[1]:
            self._store_upload(self._announced[0], complete=True)

    def _mission_ack(self, packet: Packet, message: Any, vehicle: _Vehicle) -> None:
        if self._announced is not None and self._items:
            self._store_upload(self._announced[0], complete=False)

    def _store_upload(self, ns: int, *, complete: bool) -> None:
        """Store the list of items, complete or interrupted."""
        kinds = [vehicle.kind for vehicle in self.vehicles.values() if vehicle.kind != "generic"]
        kind = autopilot_named(kinds[0] if kinds else "generic")
        items = [
            item for sequence, item in sorted(self._items.items()) if not (kind.home_first and sequence == 0)
        ]
        home = self._items.get(0) if kind.home_first else None
        upload = LoggedMission(ns, tuple(items), kind.name, complete, _site(home), self._read_back)
        if not self._known(upload):
            self.uploads.append(upload)
        self._items, self._announced = {}, None

    def _known(self, upload: LoggedMission) -> bool:
        """True for a list that was announced twice, and for a read-back of what the vehicle holds already."""
        twice = any(known.ns == upload.ns and known.items == upload.items for known in self.uploads)
        if not (upload.read_back and self.uploads):
            return twice
        interrupted = not upload.complete
        return twice or interrupted or self.uploads[-1].items == upload.items

    def channels(self) -> tuple[Channel, ...]:
        """Return channels by name; with the system if several have the same."""
        several = len({system for system, _ in self.counts}) > 1
        return tuple(
            Channel(f"{system}/{_name(number)}" if several else _name(number), "", count)
            for (system, number), count in sorted(
                self.counts.items(), key=lambda item: (item[0][0], _name(item[0][1]))
            )
        )

    def poses(self) -> Iterator[Poses]:
        for system, vehicle in self.vehicles.items():
            for track in _tracks(str(system), vehicle):
                if track is not None:
                    yield track

    def oddities(self) -> tuple[str, ...]:
        lines = [
            f"{self.counts[key] if count == CHECKED else count} messages {_name(key[1])} of system {key[0]} "
            "have a wrong checksum or another dialect; left out"
            for key, count in sorted(self.bad.items())
            if count
        ]
        lines += [
            f"system {system} restarted {vehicle.boots} times"
            for system, vehicle in self.vehicles.items()
            if vehicle.boots
        ]
        return tuple(lines)


def _command(number: int) -> str:
    known = dialect.enums["MAV_CMD"].get(number)
    return f"{known.name.removeprefix('MAV_CMD_')} ({number})" if known is not None else f"command {number}"


def _site(home: Item | None) -> SiteOrigin | None:
    if home is None or home.command != Command.NAV_WAYPOINT or (home.x, home.y) == (0, 0):
        return None
    return SiteOrigin(lat=home.x / 1e7, lon=home.y / 1e7, alt=home.z, heading_deg=0.0)


def _name(number: int) -> str:
    known = dialect.mavlink_map.get(number)
    return str(known.msgname) if known is not None else f"message {number}"


def _tracks(robot: str, vehicle: _Vehicle) -> Iterator[Poses | None]:
    rule = autopilot_named(vehicle.kind).rule
    clock: dict[str, Any] = {"own_clock": True, "rate": vehicle.rate}
    if vehicle.local:
        ns, table = _columns(vehicle.local)
        heading = np.pi / 2 - _yaw_at(vehicle, ns)
        rank = 1 if vehicle.origin is not None or not vehicle.earth else WITHOUT_ORIGIN
        yield poses_of(
            "LOCAL_POSITION_NED",
            "local",
            ns,
            table[:, :2],
            heading,
            height=table[:, 2],
            robot=robot,
            rank=rank,
            origin=vehicle.origin,
            rule=rule,
            **clock,
        )
    if vehicle.odometry:
        ns, table = _columns(vehicle.odometry)
        xy, heading, height = table[:, :2], table[:, 2], table[:, 3]
        yield poses_of("ODOMETRY", "odometry", ns, xy, heading, height=height, robot=robot, rank=3, **clock)
    if vehicle.earth:
        ns, table = _columns(vehicle.earth)
        degrees, bearing = table[:, :2], table[:, 2]
        yield fixes_of("GLOBAL_POSITION_INT", rule, ns, degrees, bearing, robot=robot, rank=2, **clock)


def _columns(rows: list[Any]) -> tuple[IntArray, FloatArray]:
    return np.array([row[0] for row in rows], np.int64), np.array([row[1:] for row in rows], float)


def _yaw_at(vehicle: _Vehicle, ns: IntArray) -> FloatArray:
    """Return the yaw clockwise from north at given times."""
    if not vehicle.attitude:
        return np.full(len(ns), np.nan)
    times, yaw = _columns(vehicle.attitude)
    order = np.argsort(times, kind="stable")
    return np.interp(ns, times[order], np.unwrap(yaw[order, 0]))
