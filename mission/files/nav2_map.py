"""A floor as a map of Nav2 (map.yaml with a picture), and as a mask of where the robot must not be.

Map: free floor is white, elements are black, everything else is unknown. Mask, for Nav2's keep-out filter:
whatever is no free floor is black. Elements are drawn at least one pixel wide, so that none is lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import FloatArray, Polygon

if TYPE_CHECKING:
    from PIL.Image import Image

FREE, UNKNOWN, OCCUPIED = 254, 205, 0
"""Grey values as map savers write them."""
RESOLUTION_M = 0.05
MARGIN_M = 0.5
MOST_PIXELS = 100_000_000


@dataclass(frozen=True)
class MapFiles:
    """The two pictures (PGM) of a floor, and where their lower left corner lies."""

    map: bytes
    mask: bytes
    origin: tuple[float, float]
    resolution: float

    def yaml(self, image: str) -> bytes:
        """Return the description of a picture; `image` is its file's name."""
        x, y = self.origin
        lines = (
            f'image: "{image}"', "mode: trinary", f"resolution: {self.resolution:g}",
            f"origin: [{x:.6f}, {y:.6f}, 0.0]", "negate: 0", "occupied_thresh: 0.65", "free_thresh: 0.196",
        )  # fmt: skip
        return ("\n".join(lines) + "\n").encode()


def nav2_map(floor: FloorPlan, resolution: float = RESOLUTION_M) -> MapFiles:
    """Draw a floor.

    Raises
    ------
    InputError
        If the pictures would be too large.
    """
    corners = np.vstack([part.exterior for part in floor.outline])
    low, high = corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M
    low = np.floor(low / resolution) * resolution
    columns, rows = (int(count) for count in np.ceil((high - low) / resolution))
    if columns * rows > MOST_PIXELS:
        raise InputError(
            f"{floor.name}: {columns} x {rows} pixels of {resolution:g} m are too many; the floor has"
            " elements far apart"
        )
    drawing = _Drawing((columns, rows), low, resolution)
    return MapFiles(
        map=drawing.pgm(floor, outside=UNKNOWN), mask=drawing.pgm(floor, outside=OCCUPIED),
        origin=(float(low[0]), float(low[1])), resolution=resolution,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Drawing:
    """The pixels of a picture: its first row is at the top."""

    size: tuple[int, int]
    low: FloatArray
    resolution: float

    def pgm(self, floor: FloorPlan, *, outside: int) -> bytes:
        from PIL import Image, ImageDraw

        picture = Image.new("L", self.size, outside)
        pen = ImageDraw.Draw(picture)
        for part in floor.outline:
            self._fill(pen, picture, part, FREE, outside)
        for element in floor.elements:
            if element.obstacle or element.occludes:
                for solid in element.solids:
                    self._fill(pen, picture, solid, OCCUPIED, None)
                for line in element.lines:
                    pen.line(self._pixels(line), fill=OCCUPIED)
        columns, rows = self.size
        return f"P5\n{columns} {rows}\n255\n".encode() + picture.tobytes()

    def _fill(self, pen: Any, picture: Image, shape: Polygon, grey: int, hole_grey: int | None) -> None:
        """Fill a shape; its holes get `hole_grey`, or keep what they were if that is `None`."""
        from PIL import Image, ImageDraw

        if hole_grey is None and shape.holes:
            mask = Image.new("L", self.size, 0)
            cut = ImageDraw.Draw(mask)
            cut.polygon(self._pixels(shape.exterior), fill=255, outline=255)
            for hole in shape.holes:
                cut.polygon(self._pixels(hole), fill=0, outline=255)
            picture.paste(grey, mask=mask)
            return
        pen.polygon(self._pixels(shape.exterior), fill=grey, outline=grey)
        for hole in shape.holes:
            pen.polygon(self._pixels(hole), fill=hole_grey, outline=hole_grey)

    def _pixels(self, points: FloatArray) -> list[tuple[int, int]]:
        """Return columns and rows of the pixels in which points lie."""
        at = np.floor((points - self.low) / self.resolution).astype(int)
        return [(int(column), int(self.size[1] - 1 - row)) for column, row in at]
