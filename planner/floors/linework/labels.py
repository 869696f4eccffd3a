"""Division of a space that contains several rooms' names, at the narrowest lines between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.rings import polygons_of

WIDEST = 4.0
"""No line longer than this, in metres, separates two rooms."""
_TURN = np.sin(np.radians(20))
_LEAST = 1.0
"""Least area in m² of a part."""
_MOST_CORNERS = 500
_DETAIL = 0.03
"""Corners of this size, in metres, are not corners of a room."""
_KERF = 0.01
_ENDS = 0.12
"""Cuts end this near to the outline that they part, in metres."""
_GRID = 1e-6
"""Cuts are made on a grid of this width in metres: on free coordinates, nearly equal edges have no result."""


def parted_by_labels(
    rooms: Sequence[shapely.Polygon], places: Sequence[FloatArray]
) -> tuple[list[shapely.Polygon], list[FloatArray]]:
    """Return the rooms, divided where a narrow line lies between two labels, and these lines (2, 2)."""
    labels = shapely.points(np.array(places).reshape(-1, 2))
    parted: list[shapely.Polygon] = []
    cuts: list[FloatArray] = []
    for room in rooms:
        parts = [room]
        if _labelled(room, labels) > 1:
            for cut in _narrow_places(room):
                parts, used = _cut(parts, cut, labels)
                if used:
                    cuts.append(cut)
                if all(_labelled(part, labels) <= 1 for part in parts):
                    break
        parted += parts
    return parted, cuts


def _labelled(part: shapely.Polygon, labels: Sequence[shapely.Point]) -> int:
    return int(np.count_nonzero(shapely.intersects(part, labels)))


def _cut(
    parts: Sequence[shapely.Polygon], cut: FloatArray, labels: Sequence[shapely.Point]
) -> tuple[list[shapely.Polygon], bool]:
    """The parts with one of them cut in two, if both halves have a label."""
    middle = shapely.Point(cut.mean(axis=0))
    for k, part in enumerate(parts):
        if not part.intersects(middle) or not _may_part(part, cut, labels):
            continue
        halves = _halves(part, cut)
        if len(halves) == 2 and all(_labelled(half, labels) for half in halves):
            return [*parts[:k], *halves, *parts[k + 1 :]], True
    return list(parts), False


def _may_part(part: shapely.Polygon, cut: FloatArray, labels: Sequence[shapely.Point]) -> bool:
    """False if a cut has no label on one of its sides: most cuts are known so without being made.

    A line from one ring of the outline to another parts nothing.
    """
    ends = shapely.points(cut)
    rings = (part.exterior, *part.interiors)
    own = next((ring for ring in rings if shapely.distance(ring, ends).max() <= _ENDS), None)
    if own is None:
        return False
    corners = shapely.get_coordinates(own)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    begin, end = sorted(shapely.line_locate_point(own, ends).tolist())
    between = corners[(along > begin) & (along < end)]
    ring = np.vstack([own.interpolate(begin).coords, between, own.interpolate(end).coords])
    if len(ring) < 3:
        return False
    held = np.asarray(labels)[shapely.intersects(part, labels)]
    within = np.count_nonzero(shapely.dwithin(shapely.Polygon(ring), held, _KERF))
    return bool(0 < within < len(held))


def _halves(part: shapely.Polygon, cut: FloatArray) -> list[shapely.Polygon]:
    """Parts on both sides of a cut; a cut may run along walls' faces, so it has a width."""
    direction = (cut[1] - cut[0]) / np.hypot(*(cut[1] - cut[0]))
    line = shapely.LineString([cut[0] - 3 * _DETAIL * direction, cut[1] + 3 * _DETAIL * direction])
    pieces = polygons_of(part.difference(line.buffer(_KERF / 2, cap_style="flat"), grid_size=_GRID))
    halves = [piece for piece in pieces if piece.area >= _LEAST]
    if len(halves) != 2:
        return halves
    within = part.intersection(halves[0].buffer(_KERF, join_style="mitre"), grid_size=_GRID)
    first = shapely.union_all(polygons_of(within))
    return [
        piece
        for half in (first, part.difference(first, grid_size=_GRID))
        for piece in polygons_of(half)
        if piece.area >= _LEAST
    ]


def _narrow_places(room: shapely.Polygon) -> Iterator[FloatArray]:
    """Lines (2, 2) across a space from its inner corners, the shortest first."""
    plain = room.buffer(-_DETAIL, join_style="mitre").buffer(_DETAIL, join_style="mitre").simplify(_DETAIL)
    rings = [ring for part in polygons_of(plain) for ring in (part.exterior, *part.interiors)]
    if not rings:
        return
    corners = np.concatenate([_inner_corners(shapely.get_coordinates(ring)[:-1]) for ring in rings])
    if not 0 < len(corners) <= _MOST_CORNERS:
        return
    edges = np.concatenate([_edges(shapely.get_coordinates(ring)) for ring in rings])
    feet = _feet(corners, edges)
    begin = np.repeat(corners, len(edges), axis=0)
    lines = np.stack([begin, feet.reshape(-1, 2)], axis=1)
    length = np.hypot(*(lines[:, 1] - lines[:, 0]).T)
    near = np.flatnonzero((length > 0.3) & (length <= WIDEST))
    inside = shapely.covers(room.buffer(2 * _DETAIL), shapely.linestrings(lines[near])) if len(near) else []
    near = near[inside]
    for k in near[np.lexsort((*lines[near].reshape(-1, 4).T, np.round(length[near], 4)))].tolist():
        yield lines[k]


def _inner_corners(ring: FloatArray) -> FloatArray:
    """Corners (n, 2) of a ring at which walls stick into the space, which lies to the ring's left."""
    turned = ring if shapely.LinearRing(ring).is_ccw else ring[::-1]
    before, after = turned - np.roll(turned, 1, axis=0), np.roll(turned, -1, axis=0) - turned
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    size = np.hypot(*before.T) * np.hypot(*after.T)
    return turned[np.abs(cross) > _TURN * size]


def _edges(ring: FloatArray) -> FloatArray:
    return np.stack([ring[:-1], ring[1:]], axis=1)


def _feet(points: FloatArray, edges: FloatArray) -> FloatArray:
    """For each point the nearest point (n, m, 2) of each edge."""
    direction = edges[:, 1] - edges[:, 0]
    size = np.maximum(np.einsum("ij,ij->i", direction, direction), 1e-12)
    t = np.einsum("nij,ij->ni", points[:, None, :] - edges[None, :, 0], direction) / size
    return np.asarray(edges[None, :, 0] + np.clip(t, 0.0, 1.0)[..., None] * direction[None])
