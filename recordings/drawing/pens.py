"""Pens: colour, width and drawing order of lines in 2D."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import rerun as rr

from stopgo.mission.geometry import FloatArray
from stopgo.recordings.drawing.canvas import Canvas, on_screen
from stopgo.recordings.drawing.palette import Colour

ORDER = {
    name: float(rank)
    for rank, name in enumerate(
        (
            *("room", "area", "floor", "solid", "line", "target", "seen", "ray", "route"),
            *("candidate", "stop", "arrival", "scan", "robot"),
        )
    )
}
"""Drawing order from low to high; Rerun's own defaults are 20 for lines and 30 for points."""

HAIR, THIN, THICK, BOLD = (on_screen(width) for width in (0.5, 0.8, 1.6, 2.5))


@dataclass(frozen=True)
class Pen:
    """Look of lines: `order` is a key of ORDER, `radius` as Rerun takes it."""

    colour: Colour
    order: str
    radius: float


def draw(
    canvas: Canvas,
    entity: str,
    strips: Iterable[FloatArray],
    pen: Pen,
    *,
    names: list[str] | None = None,
    step: int | None = None,
    planning_only: bool = False,
) -> None:
    """Draw line strips, if there are any; with `step`, from that planning step on.

    `names`, one per strip, are shown at the mouse pointer.
    """
    local = canvas.strips(strips)
    if len(local):
        named: dict[str, Any] = {"labels": names, "show_labels": False} if names else {}
        look: dict[str, Any] = {"colors": pen.colour, "radii": pen.radius, "draw_order": ORDER[pen.order]}
        shape = rr.LineStrips2D(local, **look, **named)
        if step is None:
            canvas.show(entity, shape)
        else:
            canvas.since(entity, shape, step=step, planning_only=planning_only)


def style(canvas: Canvas, entity: str, pen: Pen) -> None:
    """Set the static look of lines whose positions change."""
    fields = rr.LineStrips2D.from_fields(colors=pen.colour, radii=pen.radius, draw_order=ORDER[pen.order])
    canvas.show(entity, fields)
