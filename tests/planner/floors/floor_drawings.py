"""The smallest drawings that show a property of the floor reader, and what tests ask of a plan."""

from __future__ import annotations

from collections.abc import Callable

import ezdxf
from ezdxf.document import Drawing
from ezdxf.layouts import Modelspace

from stopgo.mission.floor import FloorPlan

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


def codes(plan: FloorPlan) -> list[str]:
    return [finding.code for finding in plan.findings]
