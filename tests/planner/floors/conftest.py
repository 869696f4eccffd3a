"""Draws the smallest DXF that shows a property, and reads it."""

from __future__ import annotations

from pathlib import Path

import pytest
from floor_drawings import Draw, Read, new_drawing, rectangle

from stopgo.mission.floor import FloorPlan
from stopgo.planner.floors import FloorOptions, read_floor


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Reads what `draw` puts into the model space of a new drawing, besides a floor of 10 by 8 m."""

    def read_drawn(
        draw: Draw, *, units: int = 6, size: float = 1.0, floor: bool = True, d_dis: float = 0.05, **more: str
    ) -> FloorPlan:
        drawing = new_drawing(units, **more)
        if floor:
            rectangle(drawing.modelspace(), "FLOOR", 0, 0, 10 * size, 8 * size)
        draw(drawing.modelspace())
        path = tmp_path / "floor.dxf"
        drawing.saveas(path)
        return read_floor(path, FloorOptions(d_dis=d_dis))

    return read_drawn
