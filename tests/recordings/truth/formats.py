"""Writers of a drive's poses in every format of robots' logs, each with the options that place it."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.frames.transform import Transform
from tests.recordings.logs.writing import (
    BEGIN_NS,
    ODOMETRY,
    Messages,
    foxglove_pose,
    foxglove_time,
    write_bag,
    write_dataflash,
    write_json_mcap,
    write_ulog,
)
from tests.recordings.truth.disturbances import Sensed

FRAME = Transform(x=5.0, y=-3.0, heading=0.8)
"""Pose of the site in the frame of logs that do not know the earth."""
MAP = "--map=5,-3,45.83662361046586"
FIRST, FITTED = "--align=first", "--align=stops"


@dataclass(frozen=True)
class LogFile:
    """A log that was written, and the options for its replay."""

    path: Path
    options: tuple[str, ...]


Writer = Callable[[Path, Mission, Sensed], Path]


def _framed(poses: Sensed) -> Sensed:
    """Return the poses in the log's own frame."""
    return replace(poses, xy=FRAME.points(poses.xy), heading=poses.heading + FRAME.heading)


def _rows(poses: Sensed) -> Iterator[tuple[int, list[float], float, float]]:
    """Yield the time, position, height and heading of each pose."""
    return zip(
        poses.ns.tolist(), poses.xy.tolist(), poses.height.tolist(), poses.heading.tolist(), strict=True
    )


def csv_table(folder: Path, mission: Mission, poses: Sensed) -> Path:
    """Seconds since 1970, metres and radians."""
    poses, path = _framed(poses), folder / "run.csv"
    rows = _rows(poses)
    turn = "" if poses.headless else ",heading"
    with path.open("w") as file:
        file.write(f"time,x,y,z{turn}\n")
        for ns, (x, y), z, heading in rows:
            file.write(f"{ns // 10**9}.{ns % 10**9:09},{x:.6f},{y:.6f},{z:.3f}")
            file.write("\n" if poses.headless else f",{heading:.6f}\n")
    return path


def comma_table(folder: Path, mission: Mission, poses: Sensed) -> Path:
    """A table as Excel writes it where the decimal sign is a comma: milliseconds, and degrees."""
    poses, path = _framed(poses), folder / "run.csv"
    lines = ["timestamp_ms;x_m;y_m;z_m;yaw_deg"]
    for ns, (x, y), z, heading in zip(
        poses.ns.tolist(), poses.xy.tolist(), poses.height.tolist(), poses.heading.tolist(), strict=True
    ):
        cells = (ns / 1e6, x, y, z, math.degrees(heading))
        lines.append(";".join(f"{cell:.5f}".replace(".", ",") for cell in cells))
    path.write_text("\n".join(lines) + "\n")
    return path


def _quaternions(heading: np.ndarray) -> np.ndarray:
    half = heading / 2
    return np.stack([np.zeros_like(half), np.zeros_like(half), np.sin(half), np.cos(half)], axis=-1)


def tum(folder: Path, mission: Mission, poses: Sensed) -> Path:
    poses, path = _framed(poses), folder / "run.tum"
    turns = _quaternions(poses.heading)
    rows = zip(poses.ns.tolist(), poses.xy.tolist(), poses.height.tolist(), turns.tolist(), strict=True)
    path.write_text(
        "".join(
            f"{ns // 10**9}.{ns % 10**9:09} {x:.6f} {y:.6f} {z:.3f} {' '.join(f'{q:.7f}' for q in turn)}\n"
            for ns, (x, y), z, turn in rows
        )
    )
    return path


def euroc(folder: Path, mission: Mission, poses: Sensed) -> Path:
    poses, path = _framed(poses), folder / "run.csv"
    turns = _quaternions(poses.heading)[:, [3, 0, 1, 2]]
    rows = zip(poses.ns.tolist(), poses.xy.tolist(), poses.height.tolist(), turns.tolist(), strict=True)
    path.write_text(
        "#timestamp [ns],p_x [m],p_y,p_z,q_w,q_x,q_y,q_z\n"
        + "".join(
            f"{ns},{x:.6f},{y:.6f},{z:.3f},{','.join(f'{q:.7f}' for q in turn)}\n"
            for ns, (x, y), z, turn in rows
        )
    )
    return path


CAMERA = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Axes of KITTI's camera in the robot's: x right, y down, z forward."""


def kitti(folder: Path, mission: Mission, poses: Sensed) -> Path:
    """Matrices of a camera, and their times."""
    poses, path = _framed(poses), folder / "run.txt"
    cos, sin = np.cos(poses.heading), np.sin(poses.heading)
    zero, one = np.zeros_like(cos), np.ones_like(cos)
    turn = np.array([[cos, -sin, zero], [sin, cos, zero], [zero, zero, one]]).transpose(2, 0, 1)
    at = np.column_stack([poses.xy, poses.height]) @ CAMERA.T
    rows = np.concatenate([CAMERA @ turn @ CAMERA.T, at[:, :, None]], axis=2).reshape(-1, 12)
    path.write_text("".join(" ".join(f"{value:.7e}" for value in row) + "\n" for row in rows.tolist()))
    (folder / "times.txt").write_text("".join(f"{ns // 10**9}.{ns % 10**9:09}\n" for ns in poses.ns.tolist()))
    return path


def foxglove(folder: Path, mission: Mission, poses: Sensed) -> Path:
    """Foxglove's JSON in MCAP, in the order of writing."""
    poses, start = _framed(poses), int(poses.ns[0])
    frame = "map" if poses.tied else "odom"
    rows = [
        (
            "/pose",
            "foxglove.PoseInFrame",
            start + number * 10**8,
            {"timestamp": foxglove_time(ns), "frame_id": frame, "pose": foxglove_pose((x, y, heading), z)},
        )
        for number, (ns, (x, y), z, heading) in enumerate(_rows(poses))
    ]
    return write_json_mcap(folder / "run.mcap", rows)


def _ros(suffix: str) -> Writer:
    def write(folder: Path, mission: Mission, poses: Sensed) -> Path:
        poses, messages = _framed(poses), Messages(suffix != ".bag")
        frame = "map" if poses.tied else "odom"
        rows, start = [], int(poses.ns[0])
        for number, (ns, (x, y), z, heading) in enumerate(_rows(poses)):
            message = messages.odometry(ns, (x, y, heading), frame)
            message.pose.pose.position.z = z
            rows.append(("/odom", ODOMETRY, start + number * 10**8, message))
        path = write_bag(folder / f"run{suffix}", rows)
        return path if path.is_file() else next(path.glob(f"*{suffix}"))

    write.__name__ = suffix[1:]
    return write


KINDS = {
    "XKF1": ("QBffff", "TimeUS,C,PN,PE,PD,Yaw"),
    "ORGN": ("QBLLf", "TimeUS,Type,Lat,Lng,Alt"),
    "MODE": ("QMB", "TimeUS,Mode,ModeNum"),
}
BOOT_US = 20_000 * 10**6


def _boot_us(poses: Sensed) -> list[int]:
    return ((poses.ns - BEGIN_NS) // 1000 + BOOT_US).tolist()


def dataflash(folder: Path, mission: Mission, poses: Sensed) -> Path:
    """An ArduPilot log whose filter has the mission's origin; home, the start, is set first and last."""
    site = mission.georeference
    assert site is not None
    lat, lon, times = round(site.lat * 1e7), round(site.lon * 1e7), _boot_us(poses)
    home = (times[0], 1, lat + 700, lon - 500, site.alt)
    rows: list[tuple[str, tuple[Any, ...]]] = [
        ("ORGN", home), ("ORGN", (times[0], 0, lat, lon, site.alt)), ("MODE", (times[0], 10, 10)),
    ]  # fmt: skip
    for us, (x, y), z, heading in zip(
        times, poses.xy.tolist(), poses.height.tolist(), poses.heading.tolist(), strict=True
    ):
        rows.append(("XKF1", (us, 0, y, x, -z, math.degrees(math.pi / 2 - heading) % 360)))
    return write_dataflash(folder / "run.BIN", [*rows, ("ORGN", home)], KINDS)


ULOG = (
    "uint64_t timestamp", "float x", "float y", "float z", "float heading", "double ref_lat",
    "double ref_lon",
    "float ref_alt", "bool xy_valid", "bool z_valid", "bool xy_global", "bool z_global",
)  # fmt: skip


def ulog(folder: Path, mission: Mission, poses: Sensed) -> Path:
    site = mission.georeference
    assert site is not None
    rows = [
        (us, y, x, -z, math.pi / 2 - heading, site.lat, site.lon, site.alt, True, True, True, True)
        for us, (x, y), z, heading in zip(
            _boot_us(poses), poses.xy.tolist(), poses.height.tolist(), poses.heading.tolist(), strict=True
        )
    ]
    return write_ulog(folder / "run.ulg", {"vehicle_local_position": (ULOG, rows)})


def telemetry(folder: Path, mission: Mission, poses: Sensed) -> Path:
    """A station's log of an ArduPilot Rover; nobody uploaded a mission while it was written."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    site = mission.georeference
    assert site is not None
    origin = (round(site.lat * 1e7), round(site.lon * 1e7), round(site.alt * 1000))
    link = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    data = bytearray()

    def add(ns: int, message: Any) -> None:
        data.extend(struct.pack(">Q", ns // 1000) + message.pack(link))

    add(int(poses.ns[0]), dialect.MAVLink_heartbeat_message(10, 3, 1 | 128, 10, 4, 3))
    add(int(poses.ns[0]), dialect.MAVLink_gps_global_origin_message(*origin))
    for us, ns, (x, y), z, heading in zip(
        _boot_us(poses), poses.ns.tolist(), poses.xy.tolist(), poses.height.tolist(), poses.heading.tolist(),
        strict=True,
    ):  # fmt: skip
        ms, yaw = us // 1000 % 2**32, math.remainder(math.pi / 2 - heading, math.tau)
        add(ns, dialect.MAVLink_attitude_message(ms, 0, 0, yaw, 0, 0, 0))
        add(ns, dialect.MAVLink_local_position_ned_message(ms, y, x, -z, 0, 0, 0))
    path = folder / "run.tlog"
    path.write_bytes(data)
    return path


TABLES: tuple[Writer, ...] = (csv_table, comma_table, tum, euroc, kitti)
BAGS: tuple[Writer, ...] = (_ros(".mcap"), _ros(".bag"), _ros(".db3"), foxglove)
VEHICLES: tuple[Writer, ...] = (dataflash, ulog, telemetry)
WRITERS = (*TABLES, *BAGS, *VEHICLES)


def write_log(writer: Writer, folder: Path, mission: Mission, poses: Sensed, placing: str) -> LogFile:
    """Write a log; `placing` counts only where nothing in the log places it."""
    options = () if writer in VEHICLES else (placing,)
    return LogFile(writer(folder, mission, poses), options)
