"""A drawing's floor with heights as given: which elements the laser and the robot meet, and its solids."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from stopgo.mission.document.limits import SCANNER_HEIGHT_M
from stopgo.mission.floor import Element, Finding, FloorPlan
from stopgo.mission.floor.model_solids import ModelSolids
from stopgo.mission.geometry import FloatArray, Polygon, frozen
from stopgo.mission.settings.given_heights import CEILING, DOORS, PASSAGES, TOPS, GivenHeights
from stopgo.planner.floors.reader import FloorOptions

ASSUMED_CEILING = 2.7
"""Height of the ceiling in metres where none is given."""
GLASS, FENCE = "windows", "railings"
SOURCE = "the heights given"


def with_heights(floor: FloorPlan, options: FloorOptions) -> FloorPlan:
    """Return the floor with the given heights; itself if none is given."""
    if not options.heights:
        return floor
    given = dict(options.heights)
    highest = max(high for _, high in given.values())
    ceiling = given.get(CEILING, (max(ASSUMED_CEILING, highest),))[0]
    elements = tuple(_raised(item, given, options) for item in floor.elements)
    raised = replace(floor, elements=elements, ceiling_m=ceiling)
    triangles = np.array(list(_triangles(raised, given, ceiling))).reshape(-1, 3, 3)
    return replace(
        raised,
        solids=ModelSolids(frozen(triangles), ceiling, SOURCE),
        findings=(*floor.findings, *_findings(raised, given, ceiling)),
    )


def _raised(item: Element, given: GivenHeights, options: FloorOptions) -> Element:
    """The element with its heights: it occludes if the scanner's height is among them."""
    if item.kind not in given:
        return item
    low, high = given[item.kind]
    scan = options.scan_height or SCANNER_HEIGHT_M
    see_through = item.kind in (GLASS, FENCE)
    return replace(
        item,
        heights=(low, high),
        occludes=low <= scan < high and not see_through,
        obstacle=low < (options.robot_height or scan),
    )


def _findings(floor: FloorPlan, given: GivenHeights, ceiling: float) -> Iterator[Finding]:
    told = ", ".join(
        f"{kind} {low:g} m" if kind in TOPS else f"{kind} {low:g} to {high:g} m"
        for kind, (low, high) in given.items()
    )
    assumed = "" if CEILING in given else f"; the ceiling is assumed at {ceiling:g} m"
    yield Finding("heights_given", f"heights above the floor as given: {told}{assumed}")
    there = {item.kind for item in floor.elements} | {f"{item.kind}s" for item in floor.openings} | {CEILING}
    for kind in sorted(set(given) - there):
        yield Finding("no_such_kind", f"heights of {kind} are given, and the floor has none")


def _triangles(floor: FloorPlan, given: GivenHeights, ceiling: float) -> Iterator[FloatArray]:
    """Triangles (3, 3) of all that stops the laser."""
    for item in floor.elements:
        for low, high in _spans(item, ceiling):
            for solid in item.solids:
                yield from _prism(solid, low, min(high, ceiling))
            for line in item.lines:
                for a, b in pairwise(line):
                    yield from _upright(a, b, low, min(high, ceiling))
    for opening in floor.openings:
        lintel = given.get({"door": DOORS, "passage": PASSAGES}.get(opening.kind, ""))
        if lintel is not None:
            yield from _upright(opening.line[0], opening.line[-1], lintel[0], ceiling)


def _spans(item: Element, ceiling: float) -> list[tuple[float, float]]:
    """Heights at which an element is opaque: next to glass, the parts below and above it."""
    if item.heights is None:
        return [(0.0, ceiling)] if item.occludes else []
    low, high = item.heights
    if item.kind == GLASS:
        return [span for span in ((0.0, low), (high, ceiling)) if span[0] < span[1]]
    return [] if item.kind == FENCE else [(low, high)]


def _prism(solid: Polygon, low: float, high: float) -> Iterator[FloatArray]:
    for ring in solid.rings:
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            yield from _upright(a, b, low, high)
    shape = shapely.make_valid(shapely.Polygon(solid.exterior, solid.holes))
    for part in shapely.get_parts(shape):
        if part.geom_type == "Polygon":
            for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(part)):
                xy = shapely.get_coordinates(triangle)[:3]
                yield np.column_stack([xy, np.full(3, low)])
                yield np.column_stack([xy, np.full(3, high)])


def _upright(a: FloatArray, b: FloatArray, low: float, high: float) -> Iterator[FloatArray]:
    """The two triangles of an upright rectangle over a line."""
    if low < high and not np.array_equal(a, b):
        corners = np.array([(*a, low), (*b, low), (*b, high), (*a, high)])
        yield corners[[0, 1, 2]]
        yield corners[[0, 2, 3]]
