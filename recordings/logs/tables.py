"""Reader of trajectories as text: TUM (`t x y z qx qy qz qw`), KITTI, and tables with , ; or tabs."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import file_digest, separator_of
from stopgo.recordings.logs.field_log import (
    LATEST_S,
    WALL_S,
    Channel,
    FieldLog,
    Poses,
    Reading,
    apart,
    fixes_of,
    poses_of,
)
from stopgo.recordings.logs.kitti import COLUMNS as KITTI_COLUMNS
from stopgo.recordings.logs.kitti import read_kitti
from stopgo.recordings.logs.ros_poses import headings_of

Numbers = tuple[float, ...]
TableRow = tuple[int, Numbers]
"""Time in ns; x, y, heading in radians and height (NaN without one)."""
TUM_COLUMNS = 8


def read_table(path: Path, reading: Reading) -> FieldLog:
    """Read a trajectory in TUM's or KITTI's format, or a table with a header.

    Raises
    ------
    InputError
        When it is none of them, or no line of it can be read.
    """
    columns = _first_numbers(path)
    if columns == KITTI_COLUMNS:
        return read_kitti(path)
    return read_tum(path, reading) if columns == TUM_COLUMNS else read_csv(path, reading)


def read_tum(path: Path, reading: Reading) -> FieldLog:
    """Read a trajectory in TUM's format, or EuRoC's eight columns; other lines are left out and counted.

    EuRoC's have nanoseconds, and the quaternion's w first.

    Raises
    ------
    InputError
        When no line has this format.
    """
    rows: list[Numbers] = []
    lost = 0
    euroc = _looks_like_euroc(path)
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            words = line.split("#")[0].replace(",", " ").split()
            row = _numbers(words) if len(words) == TUM_COLUMNS else None
            if row is not None and euroc:
                row = (row[0] / 1e9, *row[1:4], *row[5:], row[4])
            row = row if row is not None and abs(row[0]) < LATEST_S else None
            lost += bool(words) and row is None
            rows += [] if row is None else [row]
    if not rows:
        raise InputError(f"{path}: no line is `t x y z qx qy qz qw`; give a trajectory in TUM's format")
    table = np.array(rows)
    ns = np.rint(table[:, 0] * 1e9).astype(np.int64)
    name = "EuRoC" if euroc else "TUM"
    track = poses_of(name, "trajectory", ns, table[:, 1:3], headings_of(table[:, 4:]), height=table[:, 3])
    return _log(path, f"{name} trajectory", [] if track is None else [track], len(rows), lost, ns)


def _looks_like_euroc(path: Path) -> bool:
    """True if the first row has commas, and a whole number of nanoseconds since 1970."""
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in _first_lines(file):
            stamp, comma, _ = line.split("#")[0].partition(",")
            if stamp.strip():
                return bool(comma) and stamp.strip().isdigit() and int(stamp) > LATEST_S
    return False


def _numbers(words: list[str]) -> Numbers | None:
    try:
        return tuple(map(float, words))
    except ValueError:
        return None


def read_csv(path: Path, reading: Reading) -> FieldLog:
    """Read a table whose header names a time and x, y or latitude, longitude.

    Raises
    ------
    InputError
        When the header lacks one of them, or no row can be read.
    """
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        begin = file.readline()
        separator = separator_of(begin)
        columns = _Columns(
            [name.strip() for name in next(csv.reader(io.StringIO(begin), delimiter=separator))], path
        )
        robots: dict[str, list[TableRow]] = {}
        lost = 0
        for cells in csv.reader(file, delimiter=separator):
            row = columns.row([cell.replace(",", ".") for cell in cells] if separator == ";" else cells)
            lost += bool(cells) and row is None
            if row is not None:
                robots.setdefault(columns.robot_of(cells), []).append(row)
    if not robots:
        raise InputError(
            f"{path}: {columns.problem or 'no row has numbers for ' + ', '.join(columns.needed)}"
        )
    for own in robots.values():
        columns.check_headings([values for _, values in own])
    tracks = [track for robot, own in robots.items() if (track := columns.track(own, robot)) is not None]
    ns = np.array([row[0] for own in robots.values() for row in own], np.int64)
    return _log(path, "CSV trajectory", tracks, len(ns), lost, ns)


TIMES: dict[str, float] = {
    "t": 1e9, "time": 1e9, "timestamp": 1e9, "stamp": 1e9, "seconds": 1e9, "sec": 1e9, "time_s": 1e9,
    "t_s": 1e9, "timestamp_s": 1e9, "time_ms": 1e6, "timestamp_ms": 1e6, "time_us": 1e3, "timestamp_us": 1e3,
    "time_ns": 1.0, "timestamp_ns": 1.0, "ns": 1.0, "robot_ns": 1.0,
}  # fmt: skip
"""Column names of a time, and nanoseconds per unit."""
PLACES = (
    ("x", "y"),
    ("x_m", "y_m"),
    ("px", "py"),
    ("pos_x", "pos_y"),
    ("lat", "lon"),
    ("latitude", "longitude"),
)
ROBOTS = ("robot", "robot_name", "robot_id", "vehicle", "vehicle_id", "agent")
"""Column names of the robot, where a table has the poses of several."""
HEIGHTS = ("z", "z_m", "pz", "pos_z")
RADIANS_OR_DEGREES = ("heading", "yaw", "theta")
"""Column names of a heading without a unit: radians, unless the path says otherwise."""
MOST_BEYOND_TURN = 0.05
"""Share of rows whose heading may be beyond a turn, as an invalid one is."""
PIECE_M = 0.2
"""Length of the path that gives a direction."""
LEAST_AGREEMENT, LEAST_BETTER = 0.9, 0.1
"""Agreement of headings with the path, 1 for a constant difference; and how much more than as radians."""
TURNS: dict[str, Callable[[float], float]] = {
    **dict.fromkeys((*RADIANS_OR_DEGREES, "heading_rad", "yaw_rad", "theta_rad"), float),
    **dict.fromkeys(("heading_deg", "yaw_deg", "theta_deg"), lambda degrees: float(np.radians(degrees))),
    **dict.fromkeys(
        ("bearing_deg", "bearing", "course_deg"), lambda degrees: float(np.radians(90 - degrees))
    ),
}
QUATERNIONS = (("qx", "qy", "qz", "qw"), ("q_x", "q_y", "q_z", "q_w"))


class _Columns:
    """Columns of a table, identified by the header's names."""

    def __init__(self, names: list[str], path: Path) -> None:
        at = {re.sub(r"[\s\[\]()]+", "_", name.lower()).strip("_"): k for k, name in enumerate(names)}
        self.time = next((name for name in TIMES if name in at), "")
        self.position: tuple[str, ...] = next((pair for pair in PLACES if set(pair) <= at.keys()), ())
        self.height = next((name for name in HEIGHTS if name in at), "")
        self.robot = next((name for name in ROBOTS if name in at), "")
        self.turn = next((name for name in TURNS if name in at), "")
        self.quaternion: tuple[str, ...] = next(
            (names for names in QUATERNIONS if set(names) <= at.keys()), ()
        )
        self.at, self.path = at, path
        self.problem = ""
        """Reason why a row was left out, where its numbers tell more than that."""
        if not self.time or not self.position:
            known = ", ".join(names)[:80]
            raise InputError(
                f"{path}: its header ({known}) has no time with x and y or lat and lon; "
                "name the columns as in: time,x,y,heading_deg"
            )

    @property
    def needed(self) -> tuple[str, ...]:
        return (self.time, *self.position)

    def row(self, cells: list[str]) -> TableRow | None:
        """Return the values of a row; None if one of them cannot be read."""
        try:
            ns = self._ns(cells[self.at[self.time]])
            if abs(ns) > LATEST_S * 1e9:
                cell = cells[self.at[self.time]].strip()
                self.problem = (
                    f"{self.time} {cell} is no second since 1970; name it time_ms, time_us or time_ns"
                )
                return None
            x, y = (float(cells[self.at[name]]) for name in self.position)
            height = float(cells[self.at[self.height]]) if self.height else math.nan
            return ns, (x, y, self._heading(cells), height)
        except (ValueError, IndexError, OverflowError):
            return None

    def check_headings(self, rows: list[Numbers]) -> None:
        """Refuse headings without a unit that are degrees by the direction of the path.

        Raises
        ------
        InputError
            Naming the column, and what to call it.
        """
        if self.turn not in RADIANS_OR_DEGREES or self.position[0].startswith("lat"):
            return
        table = np.array(rows)
        if np.mean(np.abs(table[:, 2]) > math.tau) > MOST_BEYOND_TURN:
            name = _name_by_path(table[:, :2], table[:, 2], self.turn)
            if name:
                raise InputError(f"{self.path}: the headings in {self.turn} are degrees; name it {name}")

    def robot_of(self, cells: list[str]) -> str:
        """Return the name of the robot in a row; empty without one."""
        at = self.at.get(self.robot, len(cells))
        return cells[at].strip() if at < len(cells) else ""

    def _ns(self, cell: str) -> int:
        if re.match(r"\d{4}-\d\d-\d\d[T ]", cell):
            when = datetime.fromisoformat(cell)
            return round((when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp() * 1e6) * 1000
        unit = TIMES[self.time]
        return int(cell) * int(unit) if cell.strip().isdigit() else round(float(cell) * unit)

    def _heading(self, cells: list[str]) -> float:
        if self.turn:
            return TURNS[self.turn](float(cells[self.at[self.turn]]))
        if self.quaternion:
            numbers = np.array([[float(cells[self.at[name]]) for name in self.quaternion]])
            return float(headings_of(numbers)[0])
        return float("nan")

    def track(self, rows: list[TableRow], robot: str) -> Poses | None:
        """Return the poses of one robot in the order of time; None if none is valid."""
        ns, table = [row[0] for row in rows], np.array([row[1] for row in rows])
        if self.position[0].startswith("lat"):
            return fixes_of("CSV", "wgs84", ns, table[:, :2], 90.0 - np.degrees(table[:, 2]), robot=robot)
        height = table[:, 3] if self.height else None
        return poses_of("CSV", "table", ns, table[:, :2], table[:, 2], height=height, robot=robot)


def _name_by_path(xy: np.ndarray, heading: np.ndarray, column: str) -> str:
    """Return the name for a column of degrees if they follow the path (n, 2), and radians do not."""
    at = apart(xy, PIECE_M)
    pieces = np.diff(xy[at], axis=0)
    course, turned = np.arctan2(pieces[:, 1], pieces[:, 0]), np.radians(heading[at[1:]])

    def agreement(angles: np.ndarray) -> float:
        return float(np.abs(np.exp(1j * (angles - course)).mean())) if len(angles) else 0.0

    found = {f"{column}_deg": agreement(turned), "bearing_deg": agreement(-turned)}
    best = max(found, key=lambda name: found[name])
    as_radians = agreement(heading[at[1:]])
    return best if found[best] > max(LEAST_AGREEMENT, as_radians + LEAST_BETTER) else ""


def _log(path: Path, form: str, tracks: list[Poses], rows: int, lost: int, ns: np.ndarray) -> FieldLog:
    ns = np.concatenate([track.ns for track in tracks]) if tracks else ns
    last = float(ns.max()) / 1e9
    return FieldLog(
        path=str(path),
        format=form,
        digest=file_digest(path),
        messages=rows,
        clock="wall" if last > WALL_S else "since boot",
        begin_ns=int(ns.min()),
        end_ns=int(ns.max()),
        channels=(Channel("pose", "", rows),),
        poses=tuple(tracks),
        lost=f"{lost} of {rows + lost} lines cannot be read" if lost else "",
    )


def _first_numbers(path: Path) -> int:
    """Return how many numbers the first line has that is not a comment; 0 if it has other words."""
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in _first_lines(file):
            words = line.split("#")[0].replace(",", " ").split()
            if words:
                return len(words) if _numbers(words) is not None else 0
    return 0


def _first_lines(file: io.TextIOBase) -> Iterator[str]:
    for _ in range(100):
        line = file.readline(4096)
        if not line:
            return
        yield line
