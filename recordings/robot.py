"""The robot's shape, which its pose moves about, in 2D and 3D."""

from __future__ import annotations

import numpy as np
import rerun as rr

from mission.geometry import FloatArray
from recordings import entities, strokes
from recordings.canvas import Canvas, on_screen
from recordings.palette import Colour
from recordings.pens import ORDER


def draw_robot(canvas: Canvas, flat: str, solid: str, *, radius: float, colour: Colour) -> None:
    """The robot's shape in 2D and 3D; its pose is the transform of the entities `flat` and `solid`."""
    body, nose = strokes.circle(radius), np.array([[0.0, 0.0], [radius * 1.6, 0.0]])
    lines = rr.LineStrips2D([body, nose], colors=colour, radii=on_screen(1.5), draw_order=ORDER["robot"])
    canvas.show(entities.shape(flat), lines)
    rings = [strokes.level(body, z) for z in (0.02, 0.25, 0.5)]
    shape = rr.LineStrips3D([*rings, strokes.level(nose, 0.5)], colors=colour, radii=0.02)
    canvas.show(entities.shape(solid), shape)


def quaternions(heading: FloatArray) -> FloatArray:
    """Turns about z as quaternions (n, 4), x y z w."""
    half = np.asarray(heading) / 2
    return np.stack([np.zeros_like(half), np.zeros_like(half), np.sin(half), np.cos(half)], axis=-1)
