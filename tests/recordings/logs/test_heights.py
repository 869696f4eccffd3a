"""Heights of poses, upwards whatever the format counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from stopgo.recordings.logs import read_log
from tests.recordings.logs.writing import (
    BEGIN_NS,
    ODOMETRY,
    Messages,
    write_bag,
    write_dataflash,
    write_telemetry_log,
    write_ulog,
)

HEIGHTS = [0.5 * k for k in range(20)]


def tum(folder: Path) -> Path:
    path = folder / "a.tum"
    path.write_text("".join(f"{k} 0 0 {z} 0 0 0 1\n" for k, z in enumerate(HEIGHTS)))
    return path


def table(folder: Path) -> Path:
    path = folder / "a.csv"
    path.write_text("time,x,y,z\n" + "".join(f"{k},0,0,{z}\n" for k, z in enumerate(HEIGHTS)))
    return path


def bag(folder: Path, suffix: str) -> Path:
    messages = Messages(suffix != ".bag")

    def told(k: int, z: float) -> Any:
        message = messages.odometry(BEGIN_NS + k * 10**9, (0.0, 0.0, 0.0))
        message.pose.pose.position.z = z
        return message

    rows = [("/odom", ODOMETRY, BEGIN_NS + k * 10**9, told(k, z)) for k, z in enumerate(HEIGHTS)]
    return write_bag(folder / f"a{suffix}", rows)


def dataflash(folder: Path) -> Path:
    kinds = {"XKF1": ("QBffff", "TimeUS,C,PN,PE,PD,Yaw")}
    rows = [("XKF1", (k * 10**6, 0, 0.0, 0.0, -z, 0.0)) for k, z in enumerate(HEIGHTS)]
    return write_dataflash(folder / "a.BIN", rows, kinds)


def telemetry(folder: Path) -> Path:
    told = [
        (BEGIN_NS + k * 10**9, 1, dialect.MAVLink_local_position_ned_message(k * 1000, 0, 0, -z, 0, 0, 0))
        for k, z in enumerate(HEIGHTS)
    ]
    return write_telemetry_log(folder / "a.tlog", told)


def ulog(folder: Path) -> Path:
    fields = ("uint64_t timestamp", "float x", "float y", "float z", "float heading")
    rows = [(k * 10**6, 0.0, 0.0, -z, 0.0) for k, z in enumerate(HEIGHTS)]
    return write_ulog(folder / "a.ulg", {"vehicle_local_position": (fields, rows)})


@pytest.mark.parametrize(
    "write",
    [tum, table, lambda folder: bag(folder, ".bag"), lambda folder: bag(folder, ".mcap"),
     dataflash, telemetry, ulog],
    ids=["tum", "csv", "bag", "mcap", "BIN", "tlog", "ulg"],
)  # fmt: skip
def test_heights_count_upwards_in_every_format(write: Any, tmp_path: Path) -> None:
    (track,) = read_log(write(tmp_path)).poses
    assert track.height is not None
    assert np.allclose(track.height, HEIGHTS, atol=1e-6)
