"""Reader of trajectories in KITTI's format: a 3 x 4 matrix in each line, and a second file with the times.

KITTI's own poses are of a camera: x right, y down, z forward. Other programs write matrices with z up. The
rotations show which: a robot turns about its vertical axis.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import file_digest
from stopgo.mission.geometry import FloatArray
from stopgo.recordings.logs.field_log import LATEST_S, WALL_S, Channel, FieldLog, poses_of

COLUMNS = 12
LEAST_TURN = 0.05
"""Length of the axis of a turn, from which on it tells a direction."""
UPRIGHT = 2.0
"""Least ratio of the turns about the vertical axis and about the other one."""


def read_kitti(path: Path) -> FieldLog:
    """Read matrices and their times; other lines are left out and counted.

    Raises
    ------
    InputError
        When there are no times, or too few, or the matrices do not show which axis is vertical.
    """
    rows = [_numbers(line, COLUMNS) for line in _lines(path)]
    seconds_file = _times_file(path)
    seconds = [_numbers(line, 1) for line in _lines(seconds_file)]
    if len(seconds) < len(rows):
        raise InputError(
            f"{seconds_file}: {len(seconds)} times for the {len(rows)} poses of {path}; give one a line"
        )
    pairs = [
        (row, time[0])
        for row, time in zip(rows, seconds, strict=False)
        if row is not None and time is not None and abs(time[0]) < LATEST_S
    ]
    if not pairs:
        raise InputError(f"{path}: no pose has twelve numbers, and a time in {seconds_file.name}")
    matrices = np.array([row for row, _ in pairs]).reshape(-1, 3, 4)
    ns = np.rint(np.array([time for _, time in pairs]) * 1e9).astype(np.int64)
    xy, height, heading = _in_plane(path, matrices)
    track = poses_of("KITTI", "trajectory", ns, xy, heading, height=height)
    lost = len(rows) - len(pairs)
    return FieldLog(
        path=str(path), format="KITTI poses", digest=file_digest(path, seconds_file), messages=len(pairs),
        clock="wall" if float(ns.max()) / 1e9 > WALL_S else "since boot",
        begin_ns=int(ns.min()), end_ns=int(ns.max()),
        channels=(Channel("pose", "", len(pairs)),), poses=() if track is None else (track,),
        lost=f"{lost} of {len(rows)} lines cannot be read" if lost else "",
        oddities=_surplus(seconds_file, len(seconds) - len(rows)),
    )  # fmt: skip


def _surplus(path: Path, more: int) -> tuple[str, ...]:
    return (
        (f"{path.name} has {more} times more than there are poses; the poses may be cut off",) if more else ()
    )


def _lines(path: Path) -> list[str]:
    with path.open(encoding="utf-8", errors="replace") as file:
        return [line for line in (line.split("#")[0].strip() for line in file) if line]


def _numbers(line: str, count: int) -> tuple[float, ...] | None:
    words = line.split()
    try:
        return tuple(map(float, words)) if len(words) == count else None
    except ValueError:
        return None


def _times_file(path: Path) -> Path:
    """Return the file of times next to the poses: `times.txt`, or their name with `_times`."""
    known = (path.with_name(f"{path.stem}_times.txt"), path.with_name("times.txt"))
    found = next((file for file in known if file.is_file() and file != path), None)
    if found is None:
        raise InputError(
            f"{path}: KITTI poses have no times; put {known[1].name} or {known[0].name} next to it, "
            "with seconds in each line"
        )
    return found


def _in_plane(path: Path, matrices: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions (n, 2), heights (n,) and headings (n,)."""
    at, turn = matrices[:, :, 3], matrices[:, :, :3]
    sound = np.abs(np.linalg.det(np.nan_to_num(turn)) - 1) < LEAST_TURN
    if _is_of_camera(path, at[sound], turn[sound]):
        heading = np.arctan2(-turn[:, 0, 2], turn[:, 2, 2])
        xy, height = np.column_stack([at[:, 2], -at[:, 0]]), -at[:, 1]
    else:
        heading = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
        xy, height = at[:, :2], at[:, 2]
    return xy, height, np.where(sound, heading, np.nan)


def _is_of_camera(path: Path, at: FloatArray, turn: FloatArray) -> bool:
    """True if y is vertical, False if z is: by the axes of the turns, else by the least extent."""
    if len(turn):
        relative = turn @ turn[0].T
        axes = np.abs(relative - relative.transpose(0, 2, 1))
        about_y, about_z = float(axes[:, 0, 2].max()), float(axes[:, 0, 1].max())
        if max(about_y, about_z) > LEAST_TURN and not 1 / UPRIGHT < about_y / max(about_z, 1e-12) < UPRIGHT:
            return about_y > about_z
        y, z = (float(np.ptp(at[:, k])) for k in (1, 2))
        if max(y, z) > LEAST_TURN and not 1 / UPRIGHT < y / max(z, 1e-12) < UPRIGHT:
            return y < z
    raise InputError(f"{path}: its matrices do not show which axis is vertical; give the trajectory as TUM")
