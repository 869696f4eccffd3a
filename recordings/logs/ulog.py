"""Reader of PX4's own logs (.ulg), with pyulog."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from stopgo.mission.console.table import counted
from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import file_digest
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.geometry import FloatArray
from stopgo.mission.mavlink.autopilots.kind import Mode
from stopgo.mission.mavlink.autopilots.px4 import PX4
from stopgo.mission.mavlink.items import Item
from stopgo.recordings.logs.field_log import Channel, FieldLog, Poses, Reading, Remark, fixes_of, poses_of

WANTED = [
    "vehicle_local_position", "vehicle_global_position", "vehicle_gps_position", "vehicle_attitude",
    "vehicle_status", "vehicle_command", "battery_status", "camera_capture", "camera_trigger",
    "vehicle_local_position_groundtruth", "vehicle_attitude_groundtruth",
]  # fmt: skip
QUATERNION = tuple(f"q[{k}]" for k in range(4))
LARGE = 200 << 20
"""File size in bytes from which on only wanted messages are read into memory."""
NAVIGATION = {
    0: (1, 0), 1: (2, 0), 2: (3, 0), 3: (4, 4), 4: (4, 3), 5: (4, 5), 10: (5, 0), 14: (6, 0), 15: (7, 0),
    17: (4, 2), 18: (4, 6),
}  # fmt: skip
"""PX4's nav_state, with main and sub mode as in a heartbeat."""


def read_ulog(path: Path, reading: Reading) -> FieldLog:
    """Read a .ulg to its end.

    Raises
    ------
    InputError
        When nothing in it can be read.
    """
    log = _opened(path)
    reading.tick(1.0)
    offset = _since_1970_us(log)
    begin, end = ((int(us) + offset) * 1000 for us in (log.start_timestamp, log.last_timestamp))
    return FieldLog(
        path=str(path),
        format="PX4 ULog",
        digest=file_digest(path),
        messages=sum(len(data.data["timestamp"]) for data in log.data_list),
        clock="wall" if offset else "since boot",
        begin_ns=begin,
        end_ns=end,
        channels=tuple(_channels(log)),
        poses=tuple(track for track in _poses(log, offset) if track is not None),
        remarks=tuple(sorted(_remarks(log, offset), key=lambda remark: remark.ns)),
        battery=tuple(_battery(log, offset)),
        lost="damaged parts of the file were skipped" if log.file_corruption else "",
        oddities=(*_dropouts(log), *_invalid(log)),
    )


def _opened(path: Path) -> Any:
    from pyulog import ULog
    from pyulog.exceptions import ULogException

    only = WANTED if path.stat().st_size > LARGE else None
    try:
        with redirect_stdout(io.StringIO()):  # it prints damage, where a command prints its answer
            log = ULog(str(path), only, disable_str_exceptions=True)
    except (
        ULogException,
        TypeError,
        ValueError,
        KeyError,
        IndexError,
        struct.error,
        AttributeError,
        UnicodeDecodeError,
    ) as error:
        reason = " ".join(str(error).split())[:80]
        raise InputError(f"{path}: cannot be read as a PX4 ULog ({reason}); incomplete copy?") from None
    log.data_list[:] = [data for data in log.data_list if "timestamp" in data.data]
    if not log.data_list:
        raise InputError(f"{path}: no readable message; incomplete copy?")
    return log


def _channels(log: Any) -> Iterator[Channel]:
    for data in sorted(log.data_list, key=lambda data: (data.name, data.multi_id)):
        name = data.name if data.multi_id == 0 else f"{data.name}/{data.multi_id}"
        yield Channel(name, "", len(data.data["timestamp"]))


def _dropouts(log: Any) -> tuple[str, ...]:
    if not log.dropouts:
        return ()
    seconds = sum(item.duration for item in log.dropouts) / 1000
    return (f"{counted(len(log.dropouts), 'dropout')} in the log, {seconds:.3f} s together",)


def _invalid(log: Any) -> tuple[str, ...]:
    local = _columns(log, "vehicle_local_position", "x", "xy_valid")
    if local is None or local["xy_valid"].any():
        return ()
    return (f"vehicle_local_position: none of its {len(local['x'])} positions is marked valid",)


def _columns(log: Any, name: str, *needed: str) -> dict[str, Any] | None:
    """Return a topic's columns; None if it has no message, or lacks one of the columns."""
    for data in log.data_list:
        if data.name == name and data.multi_id == 0 and len(data.data["timestamp"]):
            return data.data if data.data.keys() >= set(needed) else None
    return None


def _since_1970_us(log: Any) -> int:
    """Return the offset from boot time to 1970, if a GPS receiver gave the date; else 0."""
    gps = _columns(log, "vehicle_gps_position", "time_utc_usec")
    if gps is None:
        return 0
    dated = np.flatnonzero(gps["time_utc_usec"] > 0)
    return int(gps["time_utc_usec"][dated[0]]) - int(gps["timestamp"][dated[0]]) if len(dated) else 0


def _ns(columns: dict[str, Any], offset_us: int) -> np.ndarray:
    return (columns["timestamp"].astype(np.int64) + offset_us) * 1000


def _poses(log: Any, offset_us: int) -> Iterator[Poses | None]:
    for name, truth in (("vehicle_local_position", False), ("vehicle_local_position_groundtruth", True)):
        local = _columns(log, name, "x", "y")
        if local is not None:
            yield _local(log, name, local, offset_us, truth=truth)
    placed = _columns(log, "vehicle_global_position", "lat", "lon")
    if placed is not None:
        degrees = np.stack([placed["lat"], placed["lon"]], axis=-1)
        ns = _ns(placed, offset_us)
        yield fixes_of(
            "vehicle_global_position",
            "px4",
            ns,
            degrees,
            np.degrees(_yaw(log, placed)),
            rank=2,
            own_clock=True,
        )


def _local(log: Any, name: str, local: dict[str, Any], offset_us: int, *, truth: bool) -> Poses | None:
    """Return north and east metres from the estimator's origin, where its position is valid."""
    valid = local["xy_valid"].astype(bool) if "xy_valid" in local else np.ones(len(local["x"]), bool)
    xy = np.stack([local["y"], local["x"]], axis=-1).astype(float)
    xy[~valid] = np.nan
    heading = np.pi / 2 - _yaw(log, local)
    ns = _ns(local, offset_us)
    height = -np.asarray(local["z"], float) if "z" in local else None
    return poses_of(
        name,
        "local",
        ns,
        xy,
        heading,
        rank=1,
        origin=_origin(local),
        rule="px4",
        truth=truth,
        height=height,
        own_clock=True,
    )


def _yaw(log: Any, columns: dict[str, Any]) -> FloatArray:
    """Return the yaw clockwise from north, radians."""
    for name in ("heading", "yaw"):
        if name in columns:
            return np.asarray(columns[name], float)
    attitude = _columns(log, "vehicle_attitude", *QUATERNION)
    if attitude is None:
        return np.full(len(columns["timestamp"]), np.nan)
    w, x, y, z = (np.asarray(attitude[name], float) for name in QUATERNION)
    yaw = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    return np.interp(columns["timestamp"], attitude["timestamp"], yaw)


def _origin(local: dict[str, Any]) -> SiteOrigin | None:
    if not {"ref_lat", "ref_lon", "xy_global"} <= local.keys() or not local["xy_global"].any():
        return None
    last = int(np.flatnonzero(local["xy_global"])[-1])
    lat, lon = float(local["ref_lat"][last]), float(local["ref_lon"][last])
    lat, lon = (value / 1e7 if abs(value) > 360 else value for value in (lat, lon))
    return SiteOrigin(lat=lat, lon=lon, alt=0.0, heading_deg=0.0)


def _remarks(log: Any, offset_us: int) -> Iterator[Remark]:
    status = _columns(log, "vehicle_status", "nav_state")
    if status is not None:
        states = status["nav_state"].astype(int)
        changed = np.flatnonzero(np.concatenate([[True], np.diff(states) != 0]))
        for ns, state in zip(_ns(status, offset_us)[changed].tolist(), states[changed].tolist(), strict=True):
            known = NAVIGATION.get(state)
            yield Remark(ns, "mode", PX4.modes.name(Mode(*known)) if known else f"nav_state {state}")
    command = _columns(log, "vehicle_command", "command")
    if command is not None:
        for ns, number in zip(_ns(command, offset_us).tolist(), command["command"].tolist(), strict=True):
            yield Remark(ns, "command", Item(int(number), 0).name)
    for name in ("camera_capture", "camera_trigger"):
        shots = _columns(log, name)
        for ns in _ns(shots, offset_us).tolist() if shots is not None else ():
            yield Remark(ns, "trigger", name)
    for message in log.logged_messages:
        yield Remark((int(message.timestamp) + offset_us) * 1000, "text", message.message)


def _battery(log: Any, offset_us: int) -> Iterator[tuple[int, float]]:
    battery = _columns(log, "battery_status", "remaining")
    if battery is not None:
        for ns, fraction in zip(_ns(battery, offset_us).tolist(), battery["remaining"].tolist(), strict=True):
            if 0 <= fraction <= 1:
                yield ns, float(fraction)
