"""Shape of the robot in 2D and 3D; the pose moves it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import rerun as rr

from stopgo.mission.geometry import FloatArray
from stopgo.recordings.drawing import entities, strokes
from stopgo.recordings.drawing.canvas import on_screen
from stopgo.recordings.drawing.palette import Colour
from stopgo.recordings.drawing.pens import ORDER

Draw = Callable[[str, Any], None]
"""Draws an archetype at an entity."""


def draw_robot(draw: Draw, flat: str, solid: str, *, radius: float, colour: Colour) -> None:
    """Draw the robot's shape in 2D and 3D; its pose is the transform of the entities `flat` and `solid`.

    Before the first pose, Rerun would show it at the origin: `draw` draws it at the time of that pose.
    """
    body, nose = strokes.circle(radius), np.array([[0.0, 0.0], [radius * 1.6, 0.0]])
    lines = rr.LineStrips2D([body, nose], colors=colour, radii=on_screen(1.5), draw_order=ORDER["robot"])
    draw(entities.shape(flat), lines)
    rings = [strokes.level(body, z) for z in (0.02, 0.25, 0.5)]
    shape = rr.LineStrips3D([*rings, strokes.level(nose, 0.5)], colors=colour, radii=0.02)
    draw(entities.shape(solid), shape)


def quaternions(heading: FloatArray) -> FloatArray:
    """Return rotations about z as quaternions (n, 4), x y z w."""
    half = np.asarray(heading) / 2
    return np.stack([np.zeros_like(half), np.zeros_like(half), np.sin(half), np.cos(half)], axis=-1)
