"""Small floors and files of batches for the tests."""

from __future__ import annotations

from pathlib import Path

import ezdxf


def hall(path: Path, *, width: float = 6.0, note: str = "") -> Path:
    """Draw one room of `width` x 4 m; `note` is a text that is no part of the floor."""
    drawing = ezdxf.new(units=6)
    space = drawing.modelspace()
    for layer, gap in (("FLOOR", 0.0), ("ROOMS", 0.0)):
        space.add_lwpolyline(_box(-gap, width, 4.0), close=True, dxfattribs={"layer": layer})
    for wall in (
        _box(0, width, 0.0, y=-0.2),
        _box(0, width, 4.2, y=4.0),
        _box(-0.2, 0.0, 4.0),
        _box(width, width + 0.2, 4.0),
    ):
        space.add_lwpolyline(wall, close=True, dxfattribs={"layer": "WALLS"})
    if note:
        drawing.header["$PROJECTNAME"] = note
    drawing.saveas(path)
    return path


def _box(x: float, to_x: float, to_y: float, *, y: float = 0.0) -> list[tuple[float, float]]:
    return [(x, y), (to_x, y), (to_x, to_y), (x, to_y)]


def batch_file(folder: Path, text: str) -> Path:
    """Write a batch's file."""
    path = folder / "plans.toml"
    path.write_text(text)
    return path
