"""Point clouds of every format give the points that were written, between ankle and head height."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stopgo.command_line import main
from stopgo.mission.errors import InputError
from stopgo.mission.files.mission_json import write
from stopgo.recordings.clouds import CLOUD_READERS, clouds_in, levels
from tests.recordings.replay.driving import wandering

POINTS = np.array([(x, 2.0, z) for x in np.arange(0, 5, 0.05) for z in np.arange(0, 2.6, 0.1)])
"""A wall of 5 m, from the floor to the ceiling."""


def e57(path: Path, points: np.ndarray) -> None:
    import pye57

    with pye57.E57(str(path), mode="w") as file:
        shift = np.array([1.0, 1.0, 1.0])
        data = {f"cartesian{axis}": column for axis, column in zip("XYZ", (points - shift).T, strict=True)}
        file.write_scan_raw(data, translation=shift, rotation=np.array([1.0, 0.0, 0.0, 0.0]))


def las(path: Path, points: np.ndarray) -> None:
    import laspy

    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales = np.full(3, 1e-4)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.write(str(path))


def ply(path: Path, points: np.ndarray, form: str = "binary_little_endian") -> None:
    lines = ["ply", f"format {form} 1.0", f"element vertex {len(points)}", "property uchar red"]
    head = "\n".join([*lines, *(f"property double {axis}" for axis in "xyz"), "end_header\n"])
    if form == "ascii":
        body = "".join(f"7 {x} {y} {z}\n" for x, y, z in points).encode()
    else:
        order = "<" if "little" in form else ">"
        rows = np.zeros(len(points), [("red", "u1"), *((axis, f"{order}f8") for axis in "xyz")])
        for axis, column in zip("xyz", points.T, strict=True):
            rows[axis] = column
        body = rows.tobytes()
    path.write_bytes(head.encode() + body)


WRITERS = {".e57": e57, ".las": las, ".laz": las, ".ply": ply}


@pytest.mark.parametrize("suffix", CLOUD_READERS)
def test_every_format_gives_the_points_that_were_written(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"station{suffix}"
    WRITERS[suffix](path, POINTS)
    read = np.concatenate(list(CLOUD_READERS[suffix](path)))
    assert np.allclose(read, POINTS, atol=1e-4)
    flat = np.concatenate(list(levels((path,))))
    wanted = POINTS[(POINTS[:, 2] > 0.25) & (POINTS[:, 2] < 2.05), :2]
    assert np.allclose(np.unique(flat.round(3), axis=0), np.unique(wanted.round(3), axis=0))


@pytest.mark.parametrize("form", ["ascii", "binary_big_endian"])
def test_ply_is_read_in_every_form(tmp_path: Path, form: str) -> None:
    path = tmp_path / "station.ply"
    ply(path, POINTS, form)
    assert np.allclose(np.concatenate(list(CLOUD_READERS[".ply"](path))), POINTS)


@pytest.mark.parametrize("suffix", CLOUD_READERS)
@pytest.mark.parametrize("keep", [0.0, 0.01, 0.5])
def test_a_damaged_cloud_is_refused_by_name(tmp_path: Path, suffix: str, keep: float) -> None:
    path = tmp_path / f"station{suffix}"
    WRITERS[suffix](path, POINTS)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * keep)])
    with pytest.raises(InputError, match=str(path)):
        list(CLOUD_READERS[suffix](path))


def test_a_folder_without_clouds_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no cloud"):
        clouds_in(tmp_path)
    with pytest.raises(InputError, match="no such"):
        clouds_in(tmp_path / "none")


def test_clouds_without_a_floor_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(wandering(1), tmp_path / "mission.json")
    (tmp_path / "run.csv").write_text("time,x,y\n0,0,0\n")
    given = [str(tmp_path / "run.csv"), "--mission", str(tmp_path / "mission.json")]
    assert main(["replay", *given, "--clouds", str(tmp_path)]) == 2
    assert "--floor" in capsys.readouterr().err
