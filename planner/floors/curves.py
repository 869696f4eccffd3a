"""Conversion of one DXF entity to polylines, in its own block's coordinates and units.

Arcs are cut into chords no longer than `chord` and no farther than `sagitta` from the arc. A circle that
`outside` asks for is circumscribed, so that no clearance from it is overestimated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
from ezdxf import path
from ezdxf.entities import Arc, Circle, DXFEntity, Ellipse, Hatch, Line, LWPolyline, Polyline, Solid, Spline
from ezdxf.math import OCS, ConstructionEllipse, Vec3

from stopgo.mission.geometry import FloatArray

LARGEST = 1e11
"""No coordinate of a building is larger in any unit (1e8 m in mm); beyond it a number is damage."""
_MOST_CHORDS = 100_000


@dataclass(frozen=True)
class Fineness:
    """Resolution of chords along curves, in drawing units."""

    chord: float
    sagitta: float
    outside: bool = False
    """Full circles are circumscribed."""

    def chords(self, *, angle: float, radius: float) -> int:
        """Least number of chords of an arc (Eq. 1: angular step ≤ d_dis / radius)."""
        if not (math.isfinite(radius) and math.isfinite(angle)) or radius > LARGEST:
            raise ValueError(f"radius {radius:g} is no building's")
        by_chord = abs(angle) * radius / self.chord
        bent = max(-1.0, 1.0 - self.sagitta / radius) if radius > 0 else -1.0
        by_sagitta = abs(angle) / (2.0 * math.acos(bent))
        return _checked(math.ceil(max(by_chord, by_sagitta, 1.0) - 1e-9), radius)


def _checked(count: int, radius: float) -> int:
    if count > _MOST_CHORDS:
        raise ValueError(f"radius {radius:g} is no building's")
    return count


@dataclass(frozen=True, eq=False)
class Curve:
    """A polyline (n, 3); `closed` when its end joins its start."""

    points: FloatArray
    closed: bool = False
    curved: bool = False
    """Drawn as one arc, such as a door's swing."""


def curves_of(entity: DXFEntity, fineness: Fineness) -> list[Curve]:
    """Return the curves of an entity; none for an entity without a line or area.

    Raises
    ------
    TypeError, ValueError, ArithmeticError
        When the entity is of a kind without curves, or its numbers make none.
    """
    cut = CURVES.get(entity.dxftype(), _by_path)
    return [curve for curve in cut(entity, fineness) if len(curve.points)]


def _line(entity: Line, fineness: Fineness) -> Iterator[Curve]:
    yield Curve(_array([entity.dxf.start, entity.dxf.end]))


def _circle(entity: Circle, fineness: Fineness) -> Iterator[Curve]:
    points = _disc(entity.dxf.center, abs(float(entity.dxf.radius)), fineness)
    yield Curve(_in_world(entity.ocs(), points), closed=True)


def _disc(center: Vec3, radius: float, fineness: Fineness) -> FloatArray:
    if fineness.outside:
        count = circle_count(radius, chord=fineness.chord)
        reach, phase = radius / math.cos(math.pi / count), math.pi / count
    else:
        count = max(8, fineness.chords(angle=math.tau, radius=radius))
        reach, phase = radius, 0.0
    angles: FloatArray = phase + np.arange(count, dtype=np.float64) * (math.tau / count)
    return _around(center, reach, angles)


def circle_count(radius: float, *, chord: float) -> int:
    """Edges of the circumscribed polygon of a circle: Eq. 1, at least 8.

    The edges are tangents, a little longer than the arcs they stand for. Counted by their own length rather
    than the arc's, no edge is split into two units.
    """
    if not 0.0 < radius <= LARGEST:
        raise ValueError(f"radius {radius:g} is no building's")
    count = max(8, math.ceil(math.pi / math.atan(chord / (2.0 * radius)) - 1e-9))
    return _checked(count, radius)


def _around(center: Vec3, radius: float, angles: FloatArray) -> FloatArray:
    x = center.x + radius * np.cos(angles)
    y = center.y + radius * np.sin(angles)
    return np.column_stack((x, y, np.full(len(angles), center.z)))


def _arc(entity: Arc, fineness: Fineness) -> Iterator[Curve]:
    start = math.radians(entity.dxf.start_angle)
    sweep = (math.radians(entity.dxf.end_angle) - start) % math.tau or math.tau
    radius = abs(float(entity.dxf.radius))
    angles = start + np.linspace(0.0, sweep, fineness.chords(angle=sweep, radius=radius) + 1)
    yield Curve(_in_world(entity.ocs(), _around(entity.dxf.center, radius, angles)), curved=True)


def _ellipse(entity: Ellipse, fineness: Fineness) -> Iterator[Curve]:
    ellipse: ConstructionEllipse = entity.construction_tool()
    sweep = ellipse.param_span
    count = fineness.chords(angle=sweep, radius=ellipse.major_axis.magnitude)
    whole = sweep > math.tau - 1e-9
    params = ellipse.start_param + np.linspace(0.0, sweep, max(8, count) + 1)
    points = list(ellipse.vertices(params[:-1] if whole else params))
    yield Curve(_array(points), closed=whole, curved=not whole)


def _lwpolyline(entity: LWPolyline, fineness: Fineness) -> Iterator[Curve]:
    vertices = np.asarray(entity.lwpoints.values)  # with two widths before the bulge
    points = _bulged(vertices[:, :2], vertices[:, 4], closed=bool(entity.closed), fineness=fineness)
    level = np.full((len(points), 1), float(entity.dxf.elevation))
    yield Curve(_in_world(entity.ocs(), np.hstack((points, level))), closed=entity.closed)


def _polyline(entity: Polyline, fineness: Fineness) -> Iterator[Curve]:
    if entity.is_poly_face_mesh or entity.is_polygon_mesh:
        raise TypeError("a mesh has no outline")
    # Frame points of a smoothed polyline are not on the line that is drawn.
    vertices = [vertex for vertex in entity.vertices if not vertex.dxf.flags & 16]
    if not vertices:
        return
    points = _array([vertex.dxf.location for vertex in vertices])
    if entity.is_3d_polyline:
        yield Curve(points, closed=entity.is_closed)
        return
    bulges = np.array([float(vertex.dxf.bulge) for vertex in vertices])
    flat = _bulged(points[:, :2], bulges, closed=entity.is_closed, fineness=fineness)
    level = np.full((len(flat), 1), float(entity.dxf.elevation.z))
    yield Curve(_in_world(entity.ocs(), np.hstack((flat, level))), closed=entity.is_closed)


def _bulged(points: FloatArray, bulges: FloatArray, *, closed: bool, fineness: Fineness) -> FloatArray:
    """The points of a polyline with its bulges (tangent of a quarter of the arc's angle) cut into chords."""
    if not np.any(bulges):
        return points
    if closed and len(points) == 2 and abs(bulges[0]) == 1.0 == abs(bulges[1]) and bulges[0] == bulges[1]:
        center, radius = points.mean(axis=0), float(np.hypot(*(points[1] - points[0]))) / 2
        turned = 1 if bulges[0] > 0 else -1
        return _disc(Vec3(*center), radius, fineness)[::turned, :2]
    following = np.roll(points, -1, axis=0)
    count = len(points) if closed else len(points) - 1
    pieces = [_bulge(points[i], following[i], float(bulges[i]), fineness) for i in range(count)]
    return np.vstack(pieces if closed else [*pieces, points[-1:]])


def _bulge(start: FloatArray, end: FloatArray, bulge: float, fineness: Fineness) -> FloatArray:
    """Points of one segment, its start included, its end not."""
    half = (end - start) / 2.0
    length = float(np.hypot(*half))
    if abs(bulge) < 1e-9 or length == 0.0:
        return start[None, :]
    angle = 4.0 * math.atan(bulge)
    to_center = half[::-1] * (-1.0, 1.0) * ((1.0 - bulge * bulge) / (2.0 * bulge))
    center = start + half + to_center
    radius = length * (1.0 + bulge * bulge) / (2.0 * abs(bulge))
    count = fineness.chords(angle=angle, radius=radius)
    turns = np.arange(count) * (angle / count)
    arm = start - center
    x = center[0] + arm[0] * np.cos(turns) - arm[1] * np.sin(turns)
    y = center[1] + arm[0] * np.sin(turns) + arm[1] * np.cos(turns)
    return np.column_stack((x, y))


def _spline(entity: Spline, fineness: Fineness) -> Iterator[Curve]:
    _check(entity.control_points)
    _check(entity.fit_points)
    points = _flat(entity.construction_tool().flattening(fineness.sagitta, segments=8))
    yield Curve(_short_chords(points, fineness.chord), closed=bool(entity.closed), curved=True)


def _flat(points: Iterable[Vec3]) -> FloatArray:
    """The points of a curve as they are computed, until there are more than any building's curve has."""
    some = list(islice(points, _MOST_CHORDS + 1))
    if len(some) > _MOST_CHORDS:
        raise ValueError("the curve is longer than any building's")
    return _array(some)


def _short_chords(points: FloatArray, chord: float) -> FloatArray:
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    counts = np.maximum(1, np.ceil(steps / chord - 1e-9)).astype(int)
    if counts.sum() > _MOST_CHORDS:
        raise ValueError("the curve is longer than any building's")
    pieces = [
        points[i] + (points[i + 1] - points[i]) * (np.arange(count)[:, None] / count)
        for i, count in enumerate(counts)
    ]
    return np.vstack([*pieces, points[-1:]])


def _quadrilateral(entity: Solid, fineness: Fineness) -> Iterator[Curve]:
    yield Curve(_array(entity.wcs_vertices()), closed=True)


def _hatch(entity: Hatch, fineness: Fineness) -> Iterator[Curve]:
    for boundary in path.from_hatch(entity):
        _check(boundary.control_vertices())
        points = _flat(boundary.flattening(fineness.sagitta, segments=8))
        yield Curve(points, closed=True)


def _by_path(entity: DXFEntity, fineness: Fineness) -> Iterator[Curve]:
    outline = path.make_path(entity)
    _check(outline.control_vertices())
    for part in outline.sub_paths():
        points = _flat(part.flattening(fineness.sagitta, segments=8))
        yield Curve(_short_chords(points, fineness.chord), closed=part.is_closed)


CURVES: dict[str, Callable[[Any, Fineness], Iterator[Curve]]] = {
    "LINE": _line,
    "CIRCLE": _circle,
    "ARC": _arc,
    "ELLIPSE": _ellipse,
    "LWPOLYLINE": _lwpolyline,
    "POLYLINE": _polyline,
    "SPLINE": _spline,
    "SOLID": _quadrilateral,
    "TRACE": _quadrilateral,
    "3DFACE": _quadrilateral,
    "HATCH": _hatch,
    "MPOLYGON": _hatch,
}
"""The function that converts each kind of entity; any other kind uses ezdxf's own paths."""


def _check(points: Iterable[Vec3]) -> None:
    """Refuse coordinates that are not finite: flattening halves a curve until it is flat, without end."""
    array = _array(list(points))
    if not (np.isfinite(array).all() and (np.abs(array) <= LARGEST).all()):
        raise ValueError("a coordinate is not a number or beyond any building")


def _array(points: Iterable[Vec3]) -> FloatArray:
    return np.array([Vec3(point).xyz for point in points], dtype=np.float64).reshape(-1, 3)


def _in_world(ocs: OCS, points: FloatArray) -> FloatArray:
    """From the entity's own plane (extrusion −Z mirrors x) to its block's coordinates."""
    if not ocs.transform:
        return points
    return _array(list(ocs.points_to_wcs(Vec3(*point) for point in points)))
