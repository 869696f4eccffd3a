"""Every picture of a floor takes an element's colours from the one row of its kind."""

from __future__ import annotations

import io
from dataclasses import replace
from itertools import combinations

import ezdxf
import pytest

from stopgo.mission.files.floor_drawing import building
from stopgo.mission.files.floor_svg import floor_svg
from stopgo.mission.files.layered_dxf import layered_dxf
from stopgo.mission.files.sheet import SheetContents, fit
from stopgo.mission.floor.polylines import lines_of
from stopgo.mission.settings.element_kinds import KINDS, Kind
from stopgo.recordings.drawing import palette
from stopgo.recordings.drawing.blueprint import BACKGROUND
from stopgo.recordings.drawing.strokes import name_point
from stopgo.recordings.page.floor_picture import plan_picture
from stopgo.recordings.page.subject import ReportSubject
from tests.mission.worlds import room_mission, room_route
from tests.recordings.colours import EYES, contrast, distance

WHITE = (255, 255, 255, 255)


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_all_writers_draw_a_kind_in_its_colour(kind: Kind) -> None:
    space = room_route().selection.visibility.candidates.space
    elements = tuple(replace(item, kind=kind.name) for item in space.floor.elements)
    floor = replace(space.floor, elements=elements)
    plan = "".join(building(replace(space, floor=floor), fit(SheetContents((0, 0, 8, 4), 8.0, 20, 20, 0))))
    page = plan_picture(ReportSubject((room_mission(),), floor=lines_of(floor, name_point)), None)
    for picture in (plan, floor_svg([floor]).decode(), page):
        assert f'stroke="{kind.colour}"' in picture
        assert f'fill="{kind.fill}"' in picture
    drawing = ezdxf.read(io.StringIO(layered_dxf(floor).decode()))
    assert drawing.layers.get(kind.name.upper()).rgb == kind.rgb
    assert palette.KIND_COLOURS[kind.name] == (*kind.rgb, 255)


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_a_kind_is_readable_on_paper_and_on_the_screen(kind: Kind) -> None:
    assert contrast((*kind.rgb, 255), WHITE) >= 3.0
    assert contrast((*kind.rgb, 255), BACKGROUND) >= 3.0


@pytest.mark.parametrize("eye", EYES)
def test_walls_columns_and_windows_differ_for_every_eye(eye: str) -> None:
    colours = [palette.KIND_COLOURS[name] for name in ("walls", "columns", "windows")]
    assert min(distance(a, b, eye) for a, b in combinations(colours, 2)) >= 15.0
