"""Shapes of a layer: its strokes as closed shapes and open lines, each once, in a canonical order.

The order is that of the geometry, so that nothing later depends on the order in which a drawing was made.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from stopgo.mission.floor import Finding
from stopgo.mission.geometry import FloatArray, polyline_length, ring_area
from stopgo.planner.floors.lines_and_texts import Stroke
from stopgo.planner.floors.rings import (
    GAP,
    SNAP,
    Region,
    canonical_line,
    canonical_ring,
    closed_ring,
    distinct,
    joined,
    repaired,
    without_repeats,
)


@dataclass(frozen=True)
class Anomaly:
    """An anomaly of an object that has no id yet."""

    code: str
    text: str
    at: tuple[float, float] | None = None

    def about(self, element: str) -> Finding:
        """Return the finding about the element with this id."""
        return Finding(self.code, f"{element}: {self.text}", element=element, at=self.at)


@dataclass(frozen=True, eq=False)
class Closed:
    """A closed shape: the polygons of one drawn ring."""

    region: Region
    layer: str
    clockwise: bool = False
    """Direction of the drawn ring; a hole has the opposite direction to the shape around it."""
    global_id: str | None = None
    fill: bool = False
    """A hatch, which often fills an outline that is drawn as well."""
    anomalies: tuple[Anomaly, ...] = ()


@dataclass(frozen=True, eq=False)
class Open:
    """An open line (n, 2)."""

    points: FloatArray
    layer: str
    curved: bool = False
    global_id: str | None = None
    anomalies: tuple[Anomaly, ...] = ()


@dataclass(frozen=True, eq=False)
class Drawn:
    """All shapes drawn on one layer, each once."""

    closed: tuple[Closed, ...] = ()
    open: tuple[Open, ...] = ()
    dropped: tuple[Anomaly, ...] = ()
    """Lines without length."""


def drawn(strokes: Iterable[Stroke], *, gap: float = SNAP) -> Drawn:
    """Closed shapes and open lines; a stroke whose ends are within `gap` metres of each other is closed."""
    shapes = [_shape(stroke, gap=gap) for stroke in strokes]
    closed = sorted((shape for shape in shapes if isinstance(shape, Closed)), key=_closed_key)
    lines = sorted((shape for shape in shapes if isinstance(shape, Open)), key=_open_key)
    points = [line for line in lines if _is_point(line)]
    return Drawn(
        closed=_each_closed_once(_without_fills(closed)),
        open=_each_line_once([line for line in lines if not _is_point(line)]),
        dropped=tuple(
            Anomaly("no_length", "a line shorter than 1 mm is ignored", place(line.points)) for line in points
        ),
    )


def _is_point(line: Open) -> bool:
    return polyline_length(line.points) <= SNAP


def _shape(stroke: Stroke, *, gap: float) -> Closed | Open:
    points = without_repeats(stroke.points)
    anomalies = _repeats(stroke, points)
    ring = closed_ring(points, closed=stroke.closed, gap=gap)
    if ring is None:
        return Open(canonical_line(points), stroke.layer, stroke.curved, stroke.global_id, anomalies)
    polygons, changed = repaired(ring)
    if not polygons:
        flat = Anomaly("no_area", "is closed but encloses nothing; read as a line", place(ring))
        return Open(canonical_line(ring), stroke.layer, stroke.curved, stroke.global_id, (*anomalies, flat))
    if changed:
        anomalies = (*anomalies, _split(polygons, ring))
    if not stroke.closed:
        anomalies = (*anomalies, *_gap(points))
    region = polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons)
    return Closed(region, stroke.layer, ring_area(ring) < 0, stroke.global_id, stroke.fill, anomalies)


def _repeats(stroke: Stroke, points: FloatArray) -> tuple[Anomaly, ...]:
    """Report dropped points; one repeated closing point is normal and not reported."""
    dropped = len(stroke.points) - len(points)
    if not dropped or len(points) < 2:
        return ()
    return (Anomaly("repeated_points", f"{dropped} repeated points were dropped", place(points)),)


def _split(polygons: Sequence[shapely.Polygon], ring: FloatArray) -> Anomaly:
    area = sum(polygon.area for polygon in polygons)
    text = f"its ring crosses or touches itself; repaired to {len(polygons)} polygons of {area:.3g} m²"
    return Anomaly("repaired", text, place(ring))


def _gap(points: FloatArray) -> tuple[Anomaly, ...]:
    width = float(np.hypot(*(points[-1] - points[0])))
    if width <= SNAP:
        return ()
    return (Anomaly("gap_closed", f"a gap of {width * 100:.1f} cm in its ring was closed", place(points)),)


def place(points: FloatArray) -> tuple[float, float]:
    """Position of a finding: the lexicographically smallest point."""
    x, y = min(map(tuple, points.tolist()))
    return (x, y)


def _closed_key(shape: Closed) -> tuple:
    return (
        *region_key(shape.region),
        shape.global_id is None,
        shape.global_id or "",
        shape.clockwise,
        shape.layer,
    )


def region_key(region: Region) -> tuple:
    """Sort key of regions: by position and then by every coordinate; empty ones come last."""
    parts = [region] if isinstance(region, shapely.Polygon) else shapely.get_parts(region)
    drawn = [part for part in parts if isinstance(part, shapely.Polygon) and not part.is_empty]
    bounds = [np.inf] * 4 if region.is_empty else np.round(region.bounds, 6).tolist()
    return (*bounds, [canonical_ring(part.exterior).tolist() for part in drawn])


def _open_key(line: Open) -> tuple:
    return (line.points.tolist(), line.global_id is None, line.global_id or "", line.layer)


def _without_fills(shapes: Sequence[Closed]) -> list[Closed]:
    """Return the shapes without hatches that fill outlines drawn on the same layer."""
    if not any(shape.fill for shape in shapes):
        return list(shapes)
    drawn_area = shapely.union_all([shape.region for shape in shapes if not shape.fill])
    return [
        shape
        for shape in shapes
        if not shape.fill or shape.region.difference(drawn_area).area > shape.region.area / 100
    ]


def _each_closed_once(shapes: Sequence[Closed]) -> tuple[Closed, ...]:
    first = distinct([shape.region for shape in shapes])
    drawn = Counter(first)
    return tuple(
        replace(shape, anomalies=(*shape.anomalies, *_copies(drawn[index], shape.region.bounds[:2])))
        for index, shape in enumerate(shapes)
        if first[index] == index
    )


def _each_line_once(lines: Sequence[Open]) -> tuple[Open, ...]:
    copies: dict[tuple, list[Open]] = {}
    for line in lines:
        copies.setdefault(tuple(map(tuple, np.round(line.points, 6).tolist())), []).append(line)
    return tuple(
        replace(same[0], anomalies=(*same[0].anomalies, *_copies(len(same), same[0].points[0])))
        for same in copies.values()
    )


def _copies(count: int, at: Iterable[float]) -> tuple[Anomaly, ...]:
    if count == 1:
        return ()
    x, y = at
    return (Anomaly("duplicate", f"is drawn {count} times; read once", (float(x), float(y))),)


def hole_indices(
    shapes: Sequence[Closed], above: Sequence[int | None], is_hole: Callable[[Closed, Closed], bool]
) -> set[int]:
    """Indices of shapes that are holes of the shape around them; a shape in a hole is solid again."""
    holes: set[int] = set()
    for index in sorted(range(len(shapes)), key=lambda item: -shapes[item].region.area):
        parent = above[index]
        if parent is not None and parent not in holes and is_hole(shapes[index], shapes[parent]):
            holes.add(index)
    return holes


def faces_of(
    lines: Sequence[Open], *, merge: bool, gap: float
) -> tuple[list[Closed], list[Open], list[Anomaly]]:
    """Return areas enclosed by open lines together, lines that enclose nothing, and the gaps closed."""
    enclosed = joined([line.points for line in lines], merge=merge, gap=gap)
    faces = [Closed(face, lines[0].layer) for face in enclosed.faces]
    loose = [lines[index] for index in enclosed.loose]
    gaps = [
        Anomaly("gap_closed", f"a gap of {width * 100:.1f} cm between lines was closed", at)
        for width, at in enclosed.gaps
    ]
    return faces, loose, gaps


def outline_faces(lines: Sequence[Open], *, layer: str, merge: bool) -> tuple[list[Closed], list[Finding]]:
    """Faces on a layer where only areas count, with findings for closed gaps and for loose lines."""
    faces, loose, anomalies = faces_of(lines, merge=merge, gap=GAP)
    if loose:
        length = sum(polyline_length(line.points) for line in loose)
        text = f"{len(loose)} open lines ({length:.3g} m) enclose nothing and are ignored"
        anomalies = [*anomalies, Anomaly("open_outline", text, place(loose[0].points))]
    return faces, [item.about(layer) for item in anomalies]
