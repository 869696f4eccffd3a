"""Autopilots' logs: columns of a .BIN, packets of a .tlog, and what is made of damaged ones."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from stopgo.mission.errors import InputError
from stopgo.recordings.logs import read_log
from tests.recordings.logs.writing import BEGIN_NS, write_dataflash, write_telemetry_log, write_ulog

KINDS = {
    "POS": ("QLLf", "TimeUS,Lat,Lng,Alt"),
    "ATT": ("Qc", "TimeUS,Yaw"),
    "XKF1": ("QBfff", "TimeUS,C,PN,PE,Yaw"),
    "ORGN": ("QBLL", "TimeUS,Type,Lat,Lng"),
    "CMD": ("QHHHffffLLfB", "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame"),
    "MODE": ("QMB", "TimeUS,Mode,ModeNum"),
}
LAT, LON = 470_000_000, 80_000_000


def flash_rows(count: int = 100) -> list[tuple[str, tuple]]:
    """North at 1 m/s, reported ten times a second; in AUTO from the beginning, with a mission of one item."""
    rows: list[tuple[str, tuple]] = [
        ("ORGN", (0, 0, LAT, LON)),
        ("CMD", (0, 2, 0, 16, 0.0, 0.0, 0.0, 0.0, LAT, LON, 5.0, 0)),
        ("CMD", (0, 2, 1, 16, 1.0, 0.0, 0.0, 0.0, LAT + 900, LON, 0.0, 3)),
        ("MODE", (0, 10, 10)),
    ]
    for k in range(count):
        us = k * 100_000
        rows.append(("ATT", (us, 0)))
        rows.append(("XKF1", (us, 0, 0.1 * k, 0.0, 0.0)))
        rows.append(("XKF1", (us, 1, 99.0, 99.0, 0.0)))
        rows.append(("POS", (us, LAT + round(0.1 * k / 0.011131884502145034), LON, 0.0)))
    return rows


def test_a_dataflash_log_gives_the_first_filters_metres(tmp_path: Path) -> None:
    log = read_log(write_dataflash(tmp_path / "a.BIN", flash_rows(), KINDS))
    tracks = {track.source: track for track in log.poses}
    filtered = tracks["XKF1"]
    assert np.allclose(filtered.xy, [(0.0, 0.1 * k) for k in range(100)], atol=1e-6)
    assert np.allclose(filtered.heading, math.pi / 2)
    assert filtered.origin is not None
    assert (filtered.origin.lat, filtered.origin.lon) == (47.0, 8.0)
    assert np.allclose(tracks["POS"].xy, filtered.xy, atol=0.006)
    assert [remark.text for remark in log.remarks] == ["AUTO"]
    (upload,) = log.uploads
    assert upload.complete
    assert [(item.command, item.x) for item in upload.items] == [(16, LAT + 900)]
    assert (log.clock, log.lost, log.messages) == ("since boot", "", len(KINDS) + 4 + 400)


def test_noise_inside_a_dataflash_log_is_passed_over_and_counted(tmp_path: Path) -> None:
    path = write_dataflash(tmp_path / "a.BIN", flash_rows(), KINDS)
    data = path.read_bytes()
    path.write_bytes(data[:-200] + b"\xa3\x95\xff noise" + data[-200:])
    log = read_log(path)
    assert log.lost.startswith("9 of ")
    assert len(next(track for track in log.poses if track.source == "XKF1").ns) == 100


def test_a_vehicle_that_is_switched_off_cuts_its_last_message(tmp_path: Path) -> None:
    path = write_dataflash(tmp_path / "a.BIN", flash_rows(), KINDS)
    path.write_bytes(path.read_bytes()[:-5])
    log = read_log(path)
    assert log.lost == ""
    assert "last message is truncated" in log.oddities[0]


def told(count: int = 50) -> list[tuple[int, int, object]]:
    """A rover that drives east at 1 m/s, heard by a station that sends it a mission."""
    m = dialect
    rows: list[tuple[int, int, object]] = [
        (BEGIN_NS, 1, m.MAVLink_heartbeat_message(10, 3, 1 | 128, 10, 4, 3)),
        (BEGIN_NS, 1, m.MAVLink_gps_global_origin_message(LAT, LON, 5000)),
        (BEGIN_NS, 255, m.MAVLink_mission_count_message(1, 1, 2)),
        (BEGIN_NS, 255, m.MAVLink_mission_item_int_message(1, 1, 0, 0, 16, 0, 1, 0, 0, 0, 0, LAT, LON, 5)),
        (
            BEGIN_NS,
            255,
            m.MAVLink_mission_item_int_message(1, 1, 1, 6, 16, 0, 1, 1, 0, 0, 0, LAT + 9, LON, 0),
        ),
    ]
    for k in range(count):
        ns = BEGIN_NS + k * 10**8
        rows.append((ns, 1, m.MAVLink_attitude_message(k * 100, 0, 0, math.pi / 2, 0, 0, 0)))
        rows.append((ns, 1, m.MAVLink_local_position_ned_message(k * 100, 0, 0.1 * k, 0, 0, 1, 0)))
    return rows


def test_a_telemetry_log_gives_local_metres_mode_and_mission(tmp_path: Path) -> None:
    log = read_log(write_telemetry_log(tmp_path / "a.tlog", told()))
    (track,) = log.poses
    assert np.allclose(track.xy, [(0.1 * k, 0.0) for k in range(50)], atol=1e-5)
    assert np.allclose(track.heading, 0.0, atol=1e-6)
    assert (track.robot, track.rule) == ("1", "ardupilot")
    assert [remark.text for remark in log.remarks if remark.kind == "mode"] == ["AUTO"]
    (upload,) = log.uploads
    assert [item.x for item in upload.items] == [LAT + 9]


@pytest.mark.parametrize("at", [0.2, 0.5, 0.9])
def test_noise_inside_a_telemetry_log_costs_no_more_than_what_it_hits(tmp_path: Path, at: float) -> None:
    path = write_telemetry_log(tmp_path / "a.tlog", told())
    data = bytearray(path.read_bytes())
    place = data.index(b"\xfd", int(len(data) * at)) + 12
    data[place : place + 3] = b"\xfd\xfe\xfd"
    path.write_bytes(bytes(data))
    log = read_log(path)
    assert len(log.poses[0].ns) >= 48
    assert log.lost or log.oddities


def test_a_log_of_neither_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.tlog"
    path.write_bytes(b"x" * 1000)
    with pytest.raises(InputError, match="no readable packet"):
        read_log(path)
    path = tmp_path / "a.ulg"
    path.write_bytes(b"ULog\x01\x12\x35" + b"\0" * 30)
    with pytest.raises(InputError, match=r"a\.ulg"):
        read_log(path)


LOCAL = (
    *("uint64_t timestamp", "double ref_lat", "double ref_lon", "float x", "float y", "float heading"),
    *("bool xy_valid", "bool xy_global"),
)


def test_a_ulog_gives_its_valid_positions_east_and_north_of_its_origin(tmp_path: Path) -> None:
    """PX4 counts x to the north, y to the east, and headings clockwise from north."""
    rows = [(k * 100_000, 47.0, 8.0, 2.0 + 0.1 * k, 1.0, math.pi / 2, k >= 10, True) for k in range(60)]
    states = [(0, 4), (3_000_000, 3)]
    tables = {
        "vehicle_local_position": (LOCAL, rows),
        "vehicle_status": (("uint64_t timestamp", "uint8_t nav_state"), states),
        "camera_capture": (("uint64_t timestamp", "uint32_t seq"), [(2_500_000, 1)]),
    }
    log = read_log(write_ulog(tmp_path / "a.ulg", tables))
    (track,) = log.poses
    assert np.allclose(track.xy, [(1.0, 2.0 + 0.1 * k) for k in range(10, 60)], atol=1e-5)
    assert np.allclose(track.heading, 0.0, atol=1e-6)
    assert (track.origin and (track.origin.lat, track.origin.lon)) == (47.0, 8.0)
    assert [(remark.kind, remark.ns) for remark in log.remarks if remark.kind != "text"] == [
        ("mode", 0), ("trigger", 2_500_000_000), ("mode", 3_000_000_000)
    ]  # fmt: skip
    assert track.oddities == ("10 of 60 poses are not finite; left out",)


def test_a_ulog_without_a_valid_position_says_so(tmp_path: Path) -> None:
    rows = [(k * 100_000, 47.0, 8.0, 0.0, 0.0, 0.0, False, False) for k in range(5)]
    log = read_log(write_ulog(tmp_path / "a.ulg", {"vehicle_local_position": (LOCAL, rows)}))
    assert log.poses == ()
    assert "none of its 5 positions is marked valid" in log.oddities[0]


def test_missions_that_were_sent_one_after_another_have_their_times(tmp_path: Path) -> None:
    m, rows = dialect, told()
    for number, second in enumerate((LAT + 9, LAT + 18, LAT + 18)):
        ns = BEGIN_NS + (10 + number) * 10**9
        items = (
            m.MAVLink_mission_item_int_message(1, 1, k, 6, 16, 0, 1, 1, 0, 0, 0, lat, LON, 0)
            for k, lat in enumerate((LAT, second))
        )
        rows += [(ns, 255, m.MAVLink_mission_count_message(1, 1, 2)), *((ns, 255, item) for item in items)]
    log = read_log(write_telemetry_log(tmp_path / "a.tlog", rows))
    assert [(upload.ns - BEGIN_NS, upload.items[0].x) for upload in log.uploads] == [
        (0, LAT + 9), (10**10, LAT + 9), (11 * 10**9, LAT + 18), (12 * 10**9, LAT + 18)
    ]  # fmt: skip


def filtered_origin(path: Path) -> tuple[float, float]:
    track = next(track for track in read_log(path).poses if track.source == "XKF1")
    assert track.origin is not None
    return track.origin.lat, track.origin.lon


def test_the_filters_origin_is_not_home(tmp_path: Path) -> None:
    """Home is logged after it, and lies where the vehicle was switched on."""
    home = ("ORGN", (0, 1, LAT + 819, LON + 10))
    first, *others = flash_rows()
    assert filtered_origin(write_dataflash(tmp_path / "a.BIN", [first, home, *others], KINDS)) == (47.0, 8.0)
    log = read_log(write_dataflash(tmp_path / "b.BIN", [home, *others], KINDS))
    assert min(log.poses, key=lambda track: track.rank).source == "POS", "metres from an unknown origin"


def test_an_origin_that_is_set_again_applies_from_then_on(tmp_path: Path) -> None:
    rows = flash_rows()
    moved = [("ORGN", (5_000_000, 0, LAT + 900, LON)), *rows[204:]]
    log = read_log(write_dataflash(tmp_path / "a.BIN", [*rows[:204], *moved], KINDS))
    track = next(track for track in log.poses if track.source == "XKF1")
    assert track.xy[49, 1] == pytest.approx(4.9, abs=1e-6)
    assert track.xy[50, 1] == pytest.approx(5.0 + 900 * 0.011131884502145034, abs=1e-6)


def test_items_that_older_autopilots_log_when_they_begin_them_are_no_upload(tmp_path: Path) -> None:
    """Before 4.6 the same CMD rows list a mission and report each item that is begun."""
    rows = flash_rows()
    listed = [
        ("CMD", (0, 3, number, command, 1.0, 0.0, 0.0, 0.0, LAT, LON, 0.0, 3))
        for number, command in ((0, 16), (1, 16), (2, 2000))
    ]
    begun = [("CMD", (us, 3, *row[1][2:])) for us, row in ((3_000_000, listed[1]), (4_000_000, listed[2]))]
    log = read_log(write_dataflash(tmp_path / "a.BIN", [*listed, *begun, *rows[3:]], KINDS))
    (upload,) = log.uploads
    assert upload.complete and [item.command for item in upload.items] == [16, 2000]
    assert [(remark.kind, remark.ns) for remark in log.remarks if remark.number is not None] == [
        ("command", 3 * 10**9), ("trigger", 4 * 10**9)
    ]  # fmt: skip
