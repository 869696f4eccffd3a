"""Clips of a large shape to many small boxes, each cut from a clip that another box has already paid for."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import FloatArray
from stopgo.planner.geometry.shapes import polygon_parts

FEW = 300
"""Vertices of a clip that is not halved further."""
HALF = 0.6
"""Length of each half; above 0.5 the halves overlap, so that most boxes lie within one of them."""


class NestedClips:
    """A polygonal shape and its clips to halves, quarters and so on, each made when a box first needs it."""

    def __init__(self, shape: BaseGeometry, box: FloatArray | None = None) -> None:
        self._shape = shape
        self._box = np.array(shape.bounds if box is None else box)
        self._halves: dict[int, NestedClips] = {}

    def within(self, box: FloatArray) -> BaseGeometry:
        """The polygons of the shape in a box (low x, low y, high x, high y)."""
        clips = self
        while (smaller := clips._half_around(box)) is not None:
            clips = smaller
        return _clip(clips._shape, box)

    def _half_around(self, box: FloatArray) -> NestedClips | None:
        """The half that contains a box; None if neither does, or if the shape is small already."""
        if shapely.get_num_coordinates(self._shape) <= FEW:
            return None
        along = int(np.argmax(self._box[2:] - self._box[:2]))
        length = HALF * (self._box[2 + along] - self._box[along])
        for side in (0, 1):
            half = self._box.copy()
            half[along + 2 * (1 - side)] = self._box[along + 2 * side] + (1 - 2 * side) * length
            if np.all(half[:2] <= box[:2]) and np.all(half[2:] >= box[2:]):
                if side not in self._halves:
                    self._halves[side] = NestedClips(_clip(self._shape, half), half)
                return self._halves[side]
        return None


def _clip(shape: BaseGeometry, box: FloatArray) -> BaseGeometry:
    return shapely.MultiPolygon(polygon_parts(shapely.intersection(shape, shapely.box(*box))))
