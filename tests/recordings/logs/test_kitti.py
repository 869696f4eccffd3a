"""KITTI's poses: matrices of a camera, or with z up, and their times in a file of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.recordings.logs import read_log

COUNT = 50
HEADING = np.linspace(0.0, 1.5, COUNT)
XY = np.column_stack([np.linspace(0, 5, COUNT), np.linspace(0, 3, COUNT) ** 2 / 3])
HEIGHT = np.full(COUNT, 0.25)
CAMERA = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Axes of the camera in the robot's: x right, y down, z forward."""


def matrices(axes: np.ndarray, *, turns: bool = True) -> np.ndarray:
    heading = HEADING if turns else np.zeros(COUNT)
    cos, sin, zero, one = np.cos(heading), np.sin(heading), np.zeros(COUNT), np.ones(COUNT)
    turn = np.array([[cos, -sin, zero], [sin, cos, zero], [zero, zero, one]]).transpose(2, 0, 1)
    at = np.column_stack([XY, HEIGHT])
    return np.concatenate([axes @ turn @ axes.T, (at @ axes.T)[:, :, None]], axis=2)


def written(folder: Path, rows: np.ndarray, times: str | None = "times.txt", count: int = COUNT) -> Path:
    path = folder / "00.txt"
    path.write_text("\n".join(" ".join(f"{value:.9e}" for value in row.ravel()) for row in rows) + "\n")
    if times is not None:
        (folder / times).write_text("\n".join(f"{0.1 * k:.6e}" for k in range(count)) + "\n")
    return path


@pytest.mark.parametrize("axes", [CAMERA, np.eye(3)])
@pytest.mark.parametrize("times", ["times.txt", "00_times.txt"])
def test_matrices_of_a_camera_and_with_z_up_are_the_same_drive(
    tmp_path: Path, axes: np.ndarray, times: str
) -> None:
    log = read_log(written(tmp_path, matrices(axes), times))
    (track,) = log.poses
    assert (log.format, log.lost, log.oddities) == ("KITTI poses", "", ())
    assert np.allclose(track.xy, XY, atol=1e-6)
    assert np.allclose(track.heading, HEADING, atol=1e-6)
    assert track.height is not None and np.allclose(track.height, 0.25)
    assert track.ns[:3].tolist() == [0, 10**8, 2 * 10**8]


@pytest.mark.parametrize("axes", [CAMERA, np.eye(3)])
def test_without_a_turn_the_flat_side_shows_the_axis(tmp_path: Path, axes: np.ndarray) -> None:
    (track,) = read_log(written(tmp_path, matrices(axes, turns=False))).poses
    assert np.allclose(track.xy, XY, atol=1e-6)


def test_matrices_that_do_not_show_the_axis_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, np.repeat(np.eye(3, 4)[None], COUNT, 0))
    with pytest.raises(InputError, match="which axis is vertical"):
        read_log(path)


def test_poses_without_times_are_refused_with_the_file_that_is_missing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"times\.txt"):
        read_log(written(tmp_path, matrices(CAMERA), None))


def test_too_few_times_are_refused_and_more_are_reported(tmp_path: Path) -> None:
    path = written(tmp_path, matrices(CAMERA), count=COUNT - 1)
    with pytest.raises(InputError, match="49 times for the 50 poses"):
        read_log(path)
    log = read_log(written(tmp_path, matrices(CAMERA), count=COUNT + 7))
    assert "7 times more" in " ".join(log.oddities)


def test_a_broken_line_keeps_the_others_at_their_times(tmp_path: Path) -> None:
    path = written(tmp_path, matrices(CAMERA))
    lines = path.read_text().splitlines()
    lines[3], lines[4] = "1 2 nonsense", " ".join(["nan"] * 12)
    path.write_text("\n".join(lines))
    log = read_log(path)
    assert log.poses[0].ns[:4].tolist() == [0, 10**8, 2 * 10**8, 5 * 10**8]
    assert log.lost == "1 of 50 lines cannot be read"
