"""Bodies minus their openings, cut by a kernel that takes a tenth of the time and is not exact.

This kernel makes some bodies wrong, crashes on some open surfaces, and moves the faces that it cuts by up to
0.1 mm. So it cuts only closed bodies that the usual kernel makes alike, as it does their openings, and each
point of the result is put back on the faces of these.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import ifcopenshell
import numpy as np

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.ifc.kernel_shapes import CUTTER, Made, iterated, settings_of

MOVED = 3e-4
"""A cut point is at most this far from the planes of its faces, metres."""
LARGEST_MOVE = 1e-3
"""A point is moved by no more than this, metres."""
ROUNDING = 1e-9
"""Coordinates that differ by no more than this are one, metres."""
MOST_PAIRS = 2_000_000
"""Points times planes of a cut body that is not left to the usual kernel."""
MOVED_BOX = 1e-4
"""Boxes around one body, made by two kernels, differ by no more than this, metres …"""
MOVED_ON_AVERAGE = 1e-5
"""… and its surface, on average, by no more than this, metres …"""
OTHER_AREA = 1e-4
"""… and its area by no more than this fraction."""


def cut_bodies(model: ifcopenshell.file, entities: list[Any]) -> Iterator[Made]:
    """Bodies minus their openings of those entities that the cutter can be trusted with.

    None where IfcOpenShell was built without this kernel: versions before 0.9 were.
    """
    try:
        yield from _cut(model, entities)
    except RuntimeError:
        return


def _cut(model: ifcopenshell.file, entities: list[Any]) -> Iterator[Made]:
    found = {entity.id(): _openings(entity) for entity in entities}
    openings = {number: own for number, own in found.items() if own}
    exact = _made_alike(model, sorted({*openings, *(number for own in openings.values() for number in own)}))
    trusted = [model.by_id(number) for number, own in openings.items() if exact.keys() >= {number, *own}]
    for made in iterated(model, trusted, settings_of(), CUTTER):
        operands = [exact[number] for number in (made.number, *openings[made.number])]
        cut = _on_faces(made, operands)
        if cut is not None and _is_left_of(operands, cut):
            yield cut


def _openings(entity: Any) -> list[int]:
    """Numbers of the openings of an entity that have a shape."""
    found = (relation.RelatedOpeningElement for relation in getattr(entity, "HasOpenings", ()))
    return [opening.id() for opening in found if opening is not None and opening.Representation is not None]


def _made_alike(model: ifcopenshell.file, numbers: list[int]) -> dict[int, Made]:
    """Closed bodies, without openings, that the cutter makes as the usual kernel does."""
    whole = settings_of(with_openings=False)
    bodies = iterated(model, [model.by_id(number) for number in numbers], whole)
    exact = {made.number: made for made in bodies if _is_closed(made)}
    others = iterated(model, [model.by_id(number) for number in exact], whole, CUTTER)
    return {made.number: exact[made.number] for made in others if _are_alike(exact[made.number], made)}


def _is_closed(made: Made) -> bool:
    """True if each edge of a triangle is that of another one in the other direction."""
    _, number = np.unique(np.round(made.points, 5), axis=0, return_inverse=True)
    corners = number.ravel()[made.corners]
    corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
    there = (corners * len(made.points) + np.roll(corners, -1, axis=1)).ravel()
    back = (np.roll(corners, -1, axis=1) * len(made.points) + corners).ravel()
    return bool((np.sort(there) == np.sort(back)).all())


def _are_alike(first: Made, second: Made) -> bool:
    """True if two meshes have the same box, area and volume."""
    sizes = [_size(item, origin=first.points[0]) for item in (first, second)]
    (box, area, volume), (other_box, other_area, other_volume) = sizes
    return (
        bool((np.abs(box - other_box) <= MOVED_BOX).all())
        and abs(area - other_area) <= OTHER_AREA * area
        and abs(volume - other_volume) <= MOVED_ON_AVERAGE * area
    )


def _is_left_of(operands: list[Made], cut: Made) -> bool:
    """True if a mesh lies within a body, and lacks no more of it than the openings hold."""
    sizes = [_size(item, origin=operands[0].points[0]) for item in (*operands, cut)]
    (box, area, volume), *openings, (own_box, _, left) = sizes
    within = (own_box[0] >= box[0] - MOVED_BOX).all() and (own_box[1] <= box[1] + MOVED_BOX).all()
    least = volume - sum(item for _, _, item in openings)
    noise = MOVED_ON_AVERAGE * area
    return bool(within) and least - noise <= left <= volume + noise


def _size(made: Made, origin: FloatArray) -> tuple[FloatArray, float, float]:
    """Corners of the box (2, 3), area and volume of a mesh."""
    corners = made.points[made.corners] - origin
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    box = np.vstack([made.points.min(axis=0), made.points.max(axis=0)])
    return box, float(np.linalg.norm(across, axis=1).sum()) / 2, float((corners[:, 0] * across).sum()) / 6


def _on_faces(made: Made, operands: list[Made]) -> Made | None:
    """A cut body with each point on the planes of the operands' faces near it; None if too large."""
    origin = operands[0].points[0]
    normals, heights = _planes(operands, origin)
    points = made.points - origin
    if len(points) * len(normals) > MOST_PAIRS:
        return None
    gaps = points @ normals.T - heights
    patterns, pattern_of = np.unique(np.abs(gaps) <= MOVED, axis=0, return_inverse=True)
    back = np.linalg.pinv(normals * patterns[..., None], rcond=1e-3)
    moves = np.zeros_like(points)
    for number, towards in enumerate(back):
        own = pattern_of.ravel() == number
        moves[own] = -gaps[own] @ towards.T
    moves[np.linalg.norm(moves, axis=1) > LARGEST_MOVE] = 0
    given = np.vstack([item.points for item in operands])
    return replace(made, points=_as_given(made.points + moves, given), transparent=operands[0].transparent)


def _as_given(points: FloatArray, given: FloatArray) -> FloatArray:
    """Points with the coordinates of given ones, where rounding errors alone make them others."""
    columns = []
    for own, known in zip(points.T, map(np.unique, given.T), strict=True):
        nearest = known[np.searchsorted(known, own - ROUNDING).clip(max=len(known) - 1)]
        columns.append(np.where(np.abs(own - nearest) <= ROUNDING, nearest, own))
    return np.column_stack(columns)


def _planes(operands: list[Made], origin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (n, 3) of the planes of bodies' faces, and their heights (n,) along them; each once."""
    corners = np.vstack([item.points[item.corners] - origin for item in operands])
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(across, axis=1)
    kept = size > 1e-9
    normals = across[kept] / size[kept, None]
    heights = np.einsum("ij,ij->i", normals, corners[kept, 0])
    _, first = np.unique(np.round(np.column_stack([normals, heights]), 6), axis=0, return_index=True)
    return normals[first], heights[first]
