"""Separation of the drawings in one model space: plans, elevations and sections side by side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from stopgo.mission.geometry import FloatArray, IntArray, polyline_length
from stopgo.planner.floors.lines_and_texts import Stroke
from stopgo.planner.floors.linework.patterns import door_arcs
from stopgo.planner.floors.linework.swings import swings_of

DrawingBox = tuple[float, float, float, float]
"""x0, y0, x1, y1 in metres."""

APART = 2.0
"""Drawings lie at least this far apart, in metres."""
_SMALLEST = 3.0
"""A drawing smaller than this, in metres, is not a storey."""
_MUCH = 5.0
"""A drawing with this many times as much wall as any other is the plan; the others are details."""
MOST_SAMPLES = 5_000_000
"""Points at which lines are sampled: one for each metre, unless they are longer than any building's."""
AT_ONCE = 200
"""Boxes of groups that are compared with all others at a time."""
_NOT_BUILT = ("ignore", "names", "other")


@dataclass(frozen=True)
class DrawingFound:
    """One drawing in a model space."""

    box: DrawingBox
    walls_m: float
    """Length of the lines on walls' layers."""
    swings: int
    """Door swings in it: only plans show them."""
    strokes: Mapping[str, int]
    """Strokes by role."""

    @property
    def description(self) -> str:
        """Its size and contents, in words."""
        x0, y0, x1, y1 = self.box
        doors = f", {self.swings} door swings" if self.swings else ", no door swing"
        return f"{x1 - x0:.1f} x {y1 - y0:.1f} m, {self.walls_m:.0f} m of wall lines{doors}"


def drawings_in(strokes: Sequence[Stroke]) -> list[DrawingFound]:
    """Return the drawings that contain walls, from left to right and bottom to top."""
    built = [item for item in strokes if item.role not in _NOT_BUILT]
    groups = _groups(built)
    found = [_drawing([built[k] for k in group]) for group in groups]
    storeys = [item for item in found if item.walls_m > 0 and max(_size(item.box)) >= _SMALLEST]
    return sorted(storeys, key=lambda item: tuple(np.round(item.box, 3)))


def chosen_of(drawings: Sequence[DrawingFound]) -> DrawingFound | None:
    """Return the drawing that is clearly the plan; None if the user has to choose."""
    if len(drawings) < 2:
        return drawings[0] if drawings else None
    swinging = [item for item in drawings if item.swings]
    if len(swinging) == 1:
        return swinging[0]
    by_walls = sorted(drawings, key=lambda item: -item.walls_m)
    if len(swinging) == 0 and len(by_walls) > 1 and by_walls[0].walls_m >= _MUCH * by_walls[1].walls_m:
        return by_walls[0]
    return None


def is_in(points: FloatArray, box: DrawingBox, *, margin: float = 0.0) -> bool:
    """True if the middle of the points lies in a box, or at most `margin` metres from it."""
    x, y = (points.min(axis=0) + points.max(axis=0)) / 2
    return bool(box[0] - margin <= x <= box[2] + margin and box[1] - margin <= y <= box[3] + margin)


def _size(box: DrawingBox) -> tuple[float, float]:
    return box[2] - box[0], box[3] - box[1]


def _drawing(strokes: Sequence[Stroke]) -> DrawingFound:
    points = np.concatenate([item.points for item in strokes])
    (x0, y0), (x1, y1) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    walls = [item for item in strokes if item.role == "walls"]
    doors = [item.points for item in strokes if item.role in ("doors", "openings", "walls")]
    return DrawingFound(
        (x0, y0, x1, y1),
        sum(polyline_length(item.points) for item in walls),
        door_arcs(strokes) or len(swings_of(doors)),
        dict(sorted(Counter(item.role for item in strokes).items())),
    )


def _groups(strokes: Sequence[Stroke]) -> list[list[int]]:
    """Indices of strokes that are connected over gaps below APART, or whose boxes overlap, by group."""
    if not strokes:
        return []
    cells, owner = _cells(strokes)
    around = shapely.box(*(cells - APART).T, *(cells + APART).T)
    pairs = shapely.STRtree(shapely.points(cells)).query(around)
    label = _connected(len(cells), pairs.T)
    label = _overlapping(label, cells)
    group = np.empty(len(strokes), dtype=np.int64)
    group[owner[:, 0]] = label[owner[:, 1]]
    _, order, begin = _sorted_out(group)
    return [some.tolist() for some in np.split(order, begin[1:])]


def _cells(strokes: Sequence[Stroke]) -> tuple[FloatArray, np.ndarray]:
    """Cells of 1 m that strokes pass through (n, 2), and pairs of a stroke and one cell of it."""
    lines = [item.points for item in strokes]
    sampled, number = _sampled(lines)
    ends = np.concatenate([line[-1:] for line in lines])
    cells, place = np.unique(np.floor(np.concatenate([sampled, ends])), axis=0, return_inverse=True)
    # A stroke is connected itself: its cells are linked by their distance alone, being 1 m apart at most.
    return cells, np.stack([np.append(number, np.arange(len(lines))), place.reshape(-1)], axis=1)


def _sampled(lines: Sequence[FloatArray]) -> tuple[FloatArray, IntArray]:
    """Points (n, 2) along polylines, at most 1 m apart and no more than a building has; and their lines."""
    begin = np.concatenate([line[:-1] for line in lines])
    steps = np.concatenate([np.diff(line, axis=0) for line in lines])
    number = np.repeat(np.arange(len(lines)), [len(line) - 1 for line in lines])
    counts = np.clip(np.ceil(np.hypot(*steps.T)), 1, 10_000).astype(np.int64)
    if (total := int(counts.sum())) > MOST_SAMPLES:
        counts = np.maximum(1, counts * MOST_SAMPLES // total)
    of = np.repeat(np.arange(len(counts)), counts)
    along = (np.arange(len(of)) - (np.cumsum(counts) - counts)[of]) / counts[of]
    return begin[of] + steps[of] * along[:, None], number[of]


def _connected(count: int, pairs: np.ndarray) -> np.ndarray:
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1])


def _overlapping(label: np.ndarray, cells: FloatArray) -> np.ndarray:
    """Labels in which groups whose boxes overlap are one."""
    while True:
        names, order, begin = _sorted_out(label)
        low, high = (extreme.reduceat(cells[order], begin) for extreme in (np.minimum, np.maximum))
        merged = _merged(shapely.box(*low.T, *high.T))
        if len(np.unique(merged)) == len(names):
            return label
        label = merged[np.searchsorted(names, label)]


def _merged(boxes: NDArray[np.object_]) -> np.ndarray:
    """A label for each box, the same for those that overlap; some boxes at a time, as pairs take memory."""
    tree, label = shapely.STRtree(boxes), np.arange(len(boxes))
    for begin in range(0, len(boxes), AT_ONCE):
        index, other = tree.query(boxes[begin : begin + AT_ONCE])
        pairs = np.stack([label[index + begin], label[other]], axis=1)
        label = _connected(len(boxes), pairs)[label]
    return label


def _sorted_out(label: np.ndarray) -> tuple[np.ndarray, IntArray, IntArray]:
    """The distinct labels, the indices in the order of their labels, and where each label begins in it."""
    order = np.argsort(label, kind="stable")
    names, begin = np.unique(label[order], return_index=True)
    return names, order, begin
