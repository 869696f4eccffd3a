"""Elements of a floor: filled shapes with their holes, and open lines, one element per drawn object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import shapely

from stopgo.mission.floor import Element, Finding, IgnoredLine, Room
from stopgo.mission.geometry import FloatArray, Polygon, frozen
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.planner.floors.drawn import Anomaly, Closed, Drawn, Open, faces_of, hole_indices, place
from stopgo.planner.floors.rings import SNAP, Region, canonical_region, parents, polygons_of, to_shapely

_NEAR = 1.0
"""An unknown shape farther than this from the floor, in metres, is not part of the plan."""
_OUTLINES = ("walls", "windows", "railings", "other")
"""Kinds that people also draw as a ring around something that is not solid."""
_STANDING = 0.35
"""Half of a width in metres that no wall has and a person or a robot fits in."""
_ROOM = 1.0
"""Least area in m² of a room that no solid fills."""


@dataclass(frozen=True, eq=False)
class _ElementPart:
    """An element before it has an id."""

    region: Region | None = None
    lines: tuple[FloatArray, ...] = ()
    global_id: str | None = None
    anomalies: tuple[Anomaly, ...] = ()

    @cached_property
    def solids(self) -> tuple[Polygon, ...]:
        return () if self.region is None else canonical_region(self.region)


@dataclass(frozen=True, eq=False)
class _Spaces:
    """The floor and its rooms, which no wall fills."""

    outline: Region
    rooms: tuple[Region, ...]

    def filled_by(self, region: Region) -> bool:
        """True if a shape would fill a whole room or more than half of the floor: then it is an outline."""
        area, half = region.area, self._area / 2
        if area > half and region.intersection(self.outline).area > half:
            return True
        return area * 1.05 >= _ROOM and any(
            _ROOM <= room.area <= area * 1.05 and region.intersection(room).area > 0.95 * room.area
            for room in (self.rooms[k] for k in self._tree.query(region, predicate="intersects"))
        )

    @cached_property
    def _area(self) -> float:
        return float(self.outline.area)

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self.rooms)


def elements_of(
    on: Mapping[str, Drawn], *, outline: Region, rooms: Sequence[Room]
) -> tuple[tuple[Element, ...], list[IgnoredLine], list[Finding]]:
    """Return elements kind by kind, in the order of their positions, and ignored outlines.

    Ids count within a kind.
    """
    spaces = _Spaces(outline, tuple(_region(room) for room in rooms))
    elements: list[Element] = []
    ignored: list[IgnoredLine] = []
    findings: list[Finding] = []
    for kind in KINDS:
        if kind in on:
            drawn = on[kind]
            anomalies: list[Finding] = []
            if kind == "other":
                drawn, left_out, anomalies = _on_the_floor(drawn, spaces)
                ignored += left_out
            made, more = _of_kind(kind, drawn, spaces)
            elements += made
            findings += [*anomalies, *more]
    return tuple(elements), ignored, findings


def _region(room: Room) -> Region:
    return shapely.union_all([to_shapely(part) for part in room.polygons])


def _of_kind(kind: str, drawn: Drawn, spaces: _Spaces) -> tuple[list[Element], list[Finding]]:
    closed, lines = _closed_and_lines(kind, drawn)
    findings: list[Finding] = []
    parts = [
        *_bodies(kind, closed, spaces),
        *(_ElementPart(None, (line.points,), line.global_id, line.anomalies) for line in lines),
    ]
    elements: list[Element] = []
    for number, part in enumerate(sorted(parts, key=_place_key), start=1):
        elements.append(_element(f"{kind}-{number:03d}", kind, part))
        findings += [anomaly.about(elements[-1].id) for anomaly in part.anomalies]
    return elements, findings


def _closed_and_lines(kind: str, drawn: Drawn) -> tuple[list[Closed], list[Open]]:
    """Columns drawn line by line are filled; rooms between walls drawn as lines are not."""
    if kind == "other":
        return list(drawn.closed), []
    if kind != "columns":
        return list(drawn.closed), list(drawn.open)
    faces, loose, _ = faces_of(drawn.open, merge=True, gap=SNAP)
    return [*drawn.closed, *faces], loose


def _on_the_floor(drawn: Drawn, spaces: _Spaces) -> tuple[Drawn, list[IgnoredLine], list[Finding]]:
    """Unknown shapes that may be on the floor; frames around it and objects outside it are left out.

    A frame's outline is drawn all the same, so it is handed on as a line that is ignored.
    """
    kept: list[Closed] = []
    frames: list[IgnoredLine] = []
    findings: list[Finding] = []
    for shape in drawn.closed:
        at = place(shapely.get_coordinates(shape.region))
        if shape.region.distance(spaces.outline) > _NEAR:
            findings.append(
                Finding("off_floor", f"layer {shape.layer}: a shape outside the floor is ignored", at=at)
            )
        elif shape.global_id is None and spaces.filled_by(shape.region):
            text = f"layer {shape.layer}: a ring around rooms ({shape.region.area:.3g} m²) is ignored"
            findings.append(Finding("outline_not_solid", text, at=at))
            rings = [ring for part in polygons_of(shape.region) for ring in (part.exterior, *part.interiors)]
            frames += [IgnoredLine(shape.layer, frozen(shapely.get_coordinates(ring))) for ring in rings]
        else:
            kept.append(shape)
    return replace(drawn, closed=tuple(kept)), frames, findings


def _bodies(kind: str, closed: Sequence[Closed], spaces: _Spaces) -> list[_ElementPart]:
    """Solids without their holes; a ring around rooms becomes a line, and each shape in it its own solid."""
    above = parents([shape.region for shape in closed])
    holes = hole_indices(closed, above, partial(_is_hole, kind))
    holes_of: dict[int | None, list[Closed]] = {}
    for item in sorted(holes):
        holes_of.setdefault(above[item], []).append(closed[item])
    parts: list[_ElementPart] = []
    for index in (item for item in range(len(closed)) if item not in holes):
        inner = holes_of.get(index, [])
        body = closed[index].region
        if inner:
            body = body.difference(shapely.union_all([hole.region for hole in inner]))
        drawn_by_hand = kind in _OUTLINES and closed[index].global_id is None
        if not polygons_of(body) or (drawn_by_hand and spaces.filled_by(body)):
            parts += [_body_or_outline(kind, shape, spaces) for shape in (closed[index], *inner)]
        else:
            anomalies = tuple(item for shape in (closed[index], *inner) for item in shape.anomalies)
            parts.append(_ElementPart(body, (), closed[index].global_id, anomalies))
    return parts


def _is_hole(kind: str, inner: Closed, outer: Closed) -> bool:
    """True if a ring in another is its hole: decided by GlobalId or hatch, else by direction and size.

    A tread drawn against its flight must not free the stairs; the two faces of a wall around a core are
    often drawn in one direction.
    """
    against = inner.clockwise != outer.clockwise
    if inner.global_id is not None and inner.global_id == outer.global_id:
        return True
    if inner.fill and outer.fill:
        return against
    roomy = not inner.region.buffer(-_STANDING).is_empty
    if kind == "walls":
        return against or roomy
    return kind != "stairs" and against and roomy


def _body_or_outline(kind: str, shape: Closed, spaces: _Spaces) -> _ElementPart:
    if not spaces.filled_by(shape.region):
        return _ElementPart(shape.region, (), shape.global_id, shape.anomalies)
    lines = tuple(
        frozen(np.vstack((ring, ring[:1])))
        for polygon in canonical_region(shape.region)
        for ring in polygon.rings
    )
    text = f"its ring around {shape.region.area:.3g} m² of floor is read as a line, not as solid {kind}"
    anomaly = Anomaly("outline_not_solid", text, place(lines[0]))
    return _ElementPart(None, lines, shape.global_id, (*shape.anomalies, anomaly))


def _place_key(part: _ElementPart) -> tuple:
    rings = [polygon.exterior.tolist() for polygon in part.solids]
    return (*rings, *(line.tolist() for line in part.lines)), part.global_id or ""


def _element(name: str, kind: str, part: _ElementPart) -> Element:
    means = KINDS[kind]
    return Element(
        name,
        kind,
        solids=part.solids,
        lines=part.lines,
        global_id=part.global_id,
        occludes=means.occludes,
        obstacle=means.obstacle,
        target=means.target,
    )
