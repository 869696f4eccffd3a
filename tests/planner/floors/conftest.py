"""Draws the smallest DXF that shows a property, and reads it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import ezdxf
import pytest
from ezdxf.document import Drawing
from ezdxf.layouts import Modelspace

from mission.floor import FloorPlan
from planner.floors import read_floor

Draw = Callable[[Modelspace], object]
Read = Callable[..., FloorPlan]


def rectangle(
    model: Modelspace, layer: str, x0: float, y0: float, x1: float, y1: float, *, clockwise: bool = False
) -> object:
    """A closed polyline on `layer`."""
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    corners = corners[::-1] if clockwise else corners
    return model.add_lwpolyline(corners, close=True, dxfattribs={"layer": layer})


def new_drawing(units: int = 6, *, version: str = "R2010") -> Drawing:
    drawing = ezdxf.new(version, units=units)
    drawing.header["$INSUNITS"] = units
    drawing.appids.add("IFC")
    return drawing


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
        return read_floor(path, d_dis=d_dis)

    return read_drawn


def codes(plan: FloorPlan) -> list[str]:
    return [finding.code for finding in plan.findings]
