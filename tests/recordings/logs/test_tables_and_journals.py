"""Trajectories as text, and stopgo's own journal."""

from __future__ import annotations

import math
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import msgspec
import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.run.events import Started
from stopgo.recordings.logs import read_log
from tests.bridge.world import corridor


def test_tum_is_read_by_its_quaternions_and_bad_lines_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.tum"
    half = math.sin(math.pi / 4)
    path.write_text(f"# t x y z\n1.5 1 2 0 0 0 0 1\nnonsense\n2.0 1 3 0 0 0 {half} {half}\n")
    log = read_log(path)
    (track,) = log.poses
    assert track.ns.tolist() == [1_500_000_000, 2_000_000_000]
    assert np.allclose(track.heading, [0.0, math.pi / 2])
    assert log.lost == "1 of 3 lines cannot be read"


@pytest.mark.parametrize(
    "head, row, xy, heading",
    [
        ("time,x,y,heading_deg", "1,2,3,90", (2, 3), math.pi / 2),
        ("timestamp_ns;X [m];Y [m];yaw", "1000000000;2;3;1.5", (2, 3), 1.5),
        ("t\tx\ty\tqx\tqy\tqz\tqw", "1\t2\t3\t0\t0\t0\t1", (2, 3), 0.0),
        ("time,lat,lon,bearing_deg", "1,47,8,0", (0, 0), math.pi / 2),
    ],
)
def test_a_table_is_read_by_its_header(
    tmp_path: Path, head: str, row: str, xy: tuple[float, float], heading: float
) -> None:
    path = tmp_path / "a.csv"
    name = "a.csv"
    path.write_text(f"{head}\n{row}\n")
    if "[m]" in head:
        path.write_text(f"{head.replace(' [m]', '_m')}\n{row}\n")
    (track,) = read_log(tmp_path / name).poses
    assert track.ns.tolist() == [10**9]
    assert np.allclose(track.xy, [xy])
    assert np.allclose(track.heading, [heading])


def test_robots_in_one_table_are_not_joined(tmp_path: Path) -> None:
    """Two robots that drove a half each at one time were read as one that drove both halves."""
    path = tmp_path / "a.csv"
    path.write_text(
        "time,Robot,x,y,yaw\n" + "".join(f"{t},r{n},{n},{t},0\n" for t in range(9) for n in (1, 2))
    )
    tracks = {track.robot: track for track in read_log(path).poses}
    assert {name: track.xy.tolist() for name, track in tracks.items()} == {
        f"r{n}": [[n, t] for t in range(9)] for n in (1, 2)
    }


def test_eurocs_eight_columns_are_not_tums(tmp_path: Path) -> None:
    """Nanoseconds, commas, and w first; both begin with a comment, or with none."""
    half = math.sin(math.pi / 4)
    rows = [f"{1_403_636_580_838_555_648 + k * 10**8},1,{k},0,{half},0,0,{half}" for k in range(3)]
    for head in ("#timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z\n", ""):
        path = tmp_path / "a.csv"
        path.write_text(head + "\n".join(rows))
        log = read_log(path)
        assert log.format == "EuRoC trajectory"
        assert np.allclose(log.poses[0].heading, math.pi / 2)
        assert np.allclose(log.poses[0].xy, [(1, 0), (1, 1), (1, 2)])
        assert log.seconds == pytest.approx(0.2, abs=1e-6)


def test_a_spreadsheets_decimal_commas_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time;x;y;heading_deg\n1,5;2,25;-3,5;90,0\n2,5;2,5;-3,5;90,0\n")
    (track,) = read_log(path).poses
    assert track.ns.tolist() == [1_500_000_000, 2_500_000_000]
    assert np.allclose(track.xy, [(2.25, -3.5), (2.5, -3.5)])


@pytest.mark.parametrize("cell", ["170000000000000", "1.7e300", "-1e30", "9" * 400])
@pytest.mark.parametrize("form", ["{} 1 2 0 0 0 0 1", "{},1,2,0"])
def test_a_stamp_with_digits_run_together_is_a_line_that_cannot_be_read(
    tmp_path: Path, cell: str, form: str
) -> None:
    path = tmp_path / "a.csv"
    rows = [form.format(stamp) for stamp in ("1.0", "2.0", cell, "3.0")]
    path.write_text("\n".join(rows if " " in form else ["time,x,y,heading", *rows]))
    log = read_log(path)
    assert log.lost == "1 of 4 lines cannot be read"
    assert log.seconds == 2.0


SQUARE = [
    *((0.5 * n, 0.0, 0.0) for n in range(9)),
    *((4.0, 0.5 * n, 90.0) for n in range(9)),
    *((4.0 - 0.5 * n, 4.0, 180.0) for n in range(9)),
    *((0.0, 4.0 - 0.5 * n, 270.0) for n in range(9)),
]
"""x, y and the heading in degrees."""


@pytest.mark.parametrize(
    ("column", "written", "name"),
    [
        ("yaw", lambda heading: heading, "yaw_deg"),
        ("heading", lambda heading: (heading + 180) % 360, "heading_deg"),
        ("heading", lambda heading: (90 - heading) % 360, "bearing_deg"),
        ("heading", lambda heading: math.radians(heading) + 4 * math.pi, ""),
        ("heading_rad", lambda heading: heading, ""),
    ],
)
def test_headings_in_degrees_are_not_taken_for_radians(
    tmp_path: Path, column: str, written: Callable[[float], float], name: str
) -> None:
    """Every stop of a scanner with a field of view was denied for its heading."""
    path = tmp_path / "a.csv"
    rows = [f"{n},{x},{y},{written(heading)}" for n, (x, y, heading) in enumerate(SQUARE)]
    path.write_text("\n".join([f"time,x,y,{column}", *rows]))
    if not name:
        assert len(read_log(path).poses[0].ns) == len(SQUARE)
        return
    with pytest.raises(InputError, match=f"the headings in {column} are degrees; name it {name}$"):
        read_log(path)


def test_a_time_in_milliseconds_since_1970_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time,x,y\n1700000000000,1,2\n1700000000100,1,2\n")
    with pytest.raises(InputError, match="time 1700000000100 is no second since 1970; name it time_ms"):
        read_log(path)


def test_a_pose_with_a_wrong_time_makes_no_gap(tmp_path: Path) -> None:
    """Its own line said that it is left out, two others that 54 years are missing."""
    path = tmp_path / "a.csv"
    rows = [f"{0 if n == 9 else 1_700_000_000 + n / 10},{n / 10},0" for n in range(40)]
    path.write_text("\n".join(["time,x,y", *rows]))
    assert read_log(path).poses[0].oddities == (
        "1 of 40 poses have a time far from that of their neighbours; left out",
    )


@pytest.mark.parametrize("content", ["a,b\n1,2\n", "time,x,y\n", "time,x,y\nu,v,w\n", "\n"])
def test_a_table_without_poses_is_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=r"a\.csv"):
        read_log(path)


def test_what_is_no_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text("hello")
    for path in (tmp_path / "a.xyz", tmp_path / "missing.bag", tmp_path):
        with pytest.raises(InputError, match=str(path)):
            read_log(path)


def test_a_journal_is_read_with_what_its_writer_had_not_put_away(tmp_path: Path) -> None:
    """Copied from a robot that was killed: the newest lines are in the file next to it."""
    from stopgo.bridge.robot.journal_file import open_journal
    from stopgo.mission.run.events import Arrived, Pose

    about = {"robot": "r1", "boot_id": "b", "run_id": "run", "mission_id": "m", "revision": 1, "number": 0}
    with open_journal(tmp_path / "state", "r1") as journal:
        journal.append(Started(**about, robot_ns=10**18, mission_time_s=0.0, commander="me"))
        pose = Pose(x=1.0, y=2.0, heading=0.5)
        journal.append(
            Arrived(**about, robot_ns=10**18 + 5, mission_time_s=5.0, stop="s1", pose=pose, deviation_m=0.01)
        )
        shutil.copytree(tmp_path / "state", tmp_path / "copy")
    before = {p.name: p.read_bytes() for p in (tmp_path / "copy").iterdir()}
    log = read_log(tmp_path / "copy")
    assert [type(event).__name__ for event in log.events] == ["Started", "Arrived"]
    assert log.poses[0].xy.tolist() == [[1.0, 2.0]]
    assert {p.name: p.read_bytes() for p in (tmp_path / "copy").iterdir()} == before


@pytest.mark.parametrize("pieces", [0, 3])
def test_a_journals_missions_are_read_whole_and_in_pieces(tmp_path: Path, pieces: int) -> None:
    """Journals of formats 1 and 2 hold each mission in one row, later ones in pieces of another table."""
    mission, begun = corridor(), {"robot": "r1", "boot_id": "b", "run_id": "run", "revision": 1, "number": 1}
    data = msgspec.json.encode(mission)
    started = Started(**begun, mission_id=mission.id, robot_ns=10**18, mission_time_s=0.0, commander="me")
    with closing(sqlite3.connect(tmp_path / "journal.sqlite")) as connection, connection:
        connection.execute("CREATE TABLE events (number INTEGER, body BLOB)")
        connection.execute("CREATE TABLE missions (revision INTEGER, document BLOB)")
        connection.execute("CREATE TABLE chunks (document INTEGER, number INTEGER, data BLOB)")
        connection.execute("INSERT INTO events VALUES (1, ?)", (msgspec.json.encode(started),))
        connection.execute("INSERT INTO missions VALUES (0, 0)")  # of this one only the name was kept
        connection.execute("INSERT INTO missions VALUES (1, ?)", (7 if pieces else data,))
        for number, body in enumerate((5, None, "{}", b"\xff", b'{"later": ' + b"[" * 20_000), start=2):
            connection.execute("INSERT INTO events VALUES (?, ?)", (number, body))
            connection.execute("INSERT INTO missions VALUES (2, ?)", (100 + number,))
            connection.execute("INSERT INTO chunks VALUES (?, 0, ?)", (100 + number, body))
        step = -(-len(data) // 3)
        for number in reversed(range(pieces)):
            piece = data[number * step : (number + 1) * step]
            connection.execute("INSERT INTO chunks VALUES (7, ?, ?)", (number, piece))
    log = read_log(tmp_path / "journal.sqlite")
    assert log.missions == (mission,)
    assert log.events == (started,), "what is neither an event nor a mission is passed over"
