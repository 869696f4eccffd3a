"""A floor of two rooms with a door between them, as a DXF file: small, so that it is planned in a second."""

from __future__ import annotations

from pathlib import Path

from tests.planner.floors.floor_drawings import new_drawing, rectangle


def two_rooms(path: Path) -> Path:
    """Draw 8 m by 4 m, with a wall in the middle that has a door of 1 m, and write it."""
    drawing = new_drawing()
    model = drawing.modelspace()
    rectangle(model, "FLOOR", 0, 0, 8, 4)
    for name, x in (("left", 0.2), ("right", 4.1)):
        rectangle(model, "ROOMS", x, 0.2, x + 3.7, 3.8)
        model.add_text(name, dxfattribs={"layer": "ROOMS", "height": 0.2}).set_placement((x + 1, 1))
    walls = [(0, 0, 8, 0.2), (0, 3.8, 8, 4), (0, 0.2, 0.2, 3.8), (7.8, 0.2, 8, 3.8), (3.9, 0.2, 4.1, 1.5),
             (3.9, 2.5, 4.1, 3.8)]  # fmt: skip
    for x0, y0, x1, y1 in walls:
        rectangle(model, "WALLS", x0, y0, x1, y1)
    model.add_line((4.0, 1.5), (4.0, 2.5), dxfattribs={"layer": "DOORS"})
    drawing.saveas(path)
    return path
