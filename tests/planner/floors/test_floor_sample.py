"""The sample office is drawn by its script, byte by byte, and is the floor it is said to be."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import shapely

import stopgo.recordings.samples
from stopgo.mission.floor import FloorPlan
from stopgo.planner.floors import read_floor
from tests.planner.floors.draw_office import draw

OFFICE = Path(stopgo.recordings.samples.__file__).with_name("office.dxf")


@pytest.fixture(scope="module")
def office() -> FloorPlan:
    return read_floor(OFFICE)


def test_the_script_draws_the_file() -> None:
    assert draw() == OFFICE.read_bytes()


@pytest.mark.parametrize("seed", ["0", "1", "2"])
def test_every_run_draws_the_same_bytes(tmp_path: Path, seed: str) -> None:
    path = tmp_path / "office.dxf"
    command = [sys.executable, "-m", "tests.planner.floors.draw_office", str(path)]
    root = Path(__file__).parents[3]
    subprocess.run(command, check=True, cwd=root, env={"PYTHONHASHSEED": seed, "PATH": ""})
    assert path.read_bytes() == OFFICE.read_bytes()


def test_the_office_is_what_the_demonstration_needs(office: FloorPlan) -> None:
    kinds = [element.kind for element in office.elements]
    assert office.findings == ()
    assert office.area == pytest.approx(26 * 13 - 2.28 * 1.9 - 1.0 * 3.0)
    assert len(office.rooms) == 10
    assert all(room.name and room.global_id for room in office.rooms)
    assert {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)} == {
        "walls": 41,
        "columns": 4,
        "beams": 4,
        "stairs": 11,
        "windows": 15,
        "railings": 1,
    }


def test_doors_of_the_office_end_on_walls_and_leave_their_widths(office: FloorPlan) -> None:
    walls = shapely.union_all(
        [
            shapely.Polygon(solid.exterior)
            for item in office.elements
            if item.kind == "walls"
            for solid in item.solids
        ]
    )
    widths = []
    for opening in office.openings:
        line = shapely.LineString(opening.line)
        widths.append(round(line.length, 3))
        assert walls.intersection(line).length == pytest.approx(0, abs=1e-9), opening.id
        assert all(walls.distance(shapely.Point(end)) < 0.13 for end in opening.line), opening.id
    assert sorted(widths) == [0.8, 0.9, 0.9, 0.9, 0.9, 0.9, 0.9, 1.0, 1.0, 1.1, 1.68]
