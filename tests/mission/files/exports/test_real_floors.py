"""Every format of missions planned on floors that nobody on this project drew."""

from __future__ import annotations

import hashlib
import math
from functools import cache
from pathlib import Path

import ezdxf
import pytest
import shapely

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.files.coverage_json import coverage_json
from stopgo.mission.files.exports import FORMATS, exported
from stopgo.mission.files.exports.format import FloorDrawing, Supplements
from stopgo.mission.files.exports.stops_dxf import LAYERS
from stopgo.mission.files.exports.stretches import read_stretches
from stopgo.mission.files.imports import READERS
from stopgo.mission.files.imports.assembling import mission_of
from stopgo.mission.files.imports.track import ImportOptions
from stopgo.mission.settings import Settings
from stopgo.planner import plan
from stopgo.planner.floors import read_floor
from stopgo.planner.floors.drawing import open_drawing
from stopgo.planner.floors.dxf import metres_in
from tests.faults.sizes import FULL, some
from tests.mission.files.exports.test_dxf import opened, stops_in, unchanged
from tests.mission.files.exports.worlds import laboratory

LAYERED = Path(__file__).parents[5] / "shared" / "data" / "layered"
LARGE = ("workshop-2018-11-08", "workshop-2019-10-29", "house", "barcelona-plan", "barcelona-wrong-units")
"""They take longest; the tests of the readers read one of each building, and another of Barcelona is here."""
WILD = [path for path in sorted((LAYERED.parent / "dxf").glob("*.dxf")) if FULL or path.stem not in LARGE]
FLOORS = ("duplex-l1", "fzk-haus-eg", *(["office-l1"] if FULL else []))

BY_TURNS = [(floor, name) for k, name in enumerate(FORMATS) for floor in FLOORS[:: (-1) ** k]]
"""Each format on each floor; of every two, the one floor and then the other comes first."""

pytestmark = pytest.mark.skipif(not LAYERED.is_dir(), reason=f"the real inputs are not in {LAYERED}")


@cache
def planned(name: str) -> tuple[Mission, bytes]:
    """The mission of a floor and its coverage.json, planned once, in the quickest way."""
    floor = read_floor(LAYERED / f"{name}.dxf")
    settings = Settings(origin=(47.3769, 8.5417, 408.0, 30.0), selector="greedy", d_dis=0.2)
    made = plan(floor, settings)
    return made.mission, coverage_json(made.route, made.mission)


@cache
def metres(source: Path) -> float:
    """Of one unit of a drawing; most formats ask no more of it."""
    drawing, _ = open_drawing(source.read_bytes(), source=source)
    return metres_in(drawing, source=source)


def supplements(name: str, folder: Path) -> Supplements:
    mission, coverage = planned(name)
    (folder / "coverage.json").write_bytes(coverage)
    data, source = (LAYERED / f"{name}.dxf").read_bytes(), LAYERED / f"{name}.dxf"
    assert hashlib.sha256(data).hexdigest() == mission.origin.floor_digest
    under = FloorDrawing(lambda: open_drawing(data, source=source)[0], metres(source))
    return Supplements(floor=under, coverage=read_stretches(folder / "coverage.json", mission))


@pytest.mark.parametrize(("floor", "name"), some(BY_TURNS, every=2))
def test_a_real_mission_reads_back(floor: str, name: str, tmp_path: Path) -> None:
    mission, _ = planned(floor)
    assert exported(mission, name, supplements(floor, tmp_path))


@pytest.mark.parametrize("floor", FLOORS)
def test_layers_over_a_real_drawing_change_nothing_in_it(floor: str, tmp_path: Path) -> None:
    mission, _ = planned(floor)
    drawing = opened(exported(mission, "dxf", supplements(floor, tmp_path)))
    auditor = drawing.audit()
    assert not auditor.errors
    assert not auditor.fixes
    assert len(stops_in(drawing)) == len(mission.stops)
    unchanged(ezdxf.readfile(LAYERED / f"{floor}.dxf"), drawing)


@pytest.mark.parametrize("path", some(WILD[1:] + WILD[:1], every=2), ids=lambda path: path.stem)
def test_a_drawing_from_the_wild_keeps_its_entities_or_is_one_line(path: Path) -> None:
    data = path.read_bytes()
    under = FloorDrawing(lambda: open_drawing(data, source=path)[0], 1.0)
    try:
        made = opened(exported(laboratory(), "dxf", Supplements(floor=under)))
    except InputError as error:
        assert "leave --floor out" in str(error)
        assert "\n" not in str(error)
        return
    drawn = [entity.dxftype() for entity in under.open().modelspace()]
    kept = [entity.dxftype() for entity in made.modelspace() if entity.dxf.layer not in LAYERS]
    assert kept == drawn
    assert len(stops_in(made)) == 3


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("name", READERS)
def test_a_real_mission_comes_back(floor: str, name: str) -> None:
    mission, _ = planned(floor)
    given = ImportOptions(mission.georeference, "ardupilot")
    track = READERS[name](exported(mission, name, Supplements()), "file", given)
    settings = Settings(start=(mission.start.x, mission.start.y, 0.0))
    back = mission_of(track, settings, name=floor, file="file", digest="0" * 64)
    for one, other in zip(back.stops, mission.stops, strict=True):
        assert one.id == other.id
        assert math.dist((one.x, one.y), (other.x, other.y)) <= 0.008
        lines = [shapely.LineString([*stop.approach, stop.approach[-1]]) for stop in (one, other)]
        assert shapely.hausdorff_distance(*lines) <= (1e-6 if name == "csv" else 0.03)
