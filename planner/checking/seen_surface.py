"""Route + solids of the floor -> area of the targets that the stops see, by height and kind of element."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stopgo.mission.document.limits import scanner_height
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.stages import KEPT, UNREACHABLE, Route
from stopgo.mission.stages.seen_area import SeenArea, SeenSurface
from stopgo.planner.overlap.boundary import ray_step
from stopgo.planner.visibility.exact_sight import exact
from stopgo.planner.visibility.headings import in_view
from stopgo.planner.visibility.solid_rays import MOST_PAIRS, solid_rays


def seen_surface(route: Route) -> SeenSurface | None:
    """Return the area of the targets that a route's stops see; None if the floor's solids are unknown.

    Rays also hit a unit that is seen too flat to count. Where those of several stops may miss it, it counts
    by the chance that those of one hit it.
    """
    space, solids = route.space, route.space.floor.solids
    rays = solid_rays(space)
    if rays is None or solids is None:
        return None
    targets, elements, cells = space.targets, space.floor.elements, rays.cells
    seen = np.zeros(cells.there.shape)
    promised = np.zeros(targets.total, dtype=bool)
    for stop, counted, units in _sights(route):
        promised[counted] = True
        for part in np.array_split(units, max(1, -(-units.size * cells.z.shape[1] // MOST_PAIRS))):
            hit = rays.reached(stop, part) * _between_rays(route, stop, part)[:, None]
            seen[part] += (1 - seen[part]) * hit
    kinds = np.array([item.kind for item in elements])[targets.element[targets.unit_segment]]
    area = targets.unit_length[:, None] * cells.tall * cells.upright[:, None]
    return SeenSurface(
        height_m=scanner_height(route.settings),
        kinds={
            str(kind): _area(kinds == kind, promised, area * cells.there, seen) for kind in np.unique(kinds)
        },
        hidden_m=route.visibility.hidden_m,
        source=solids.source,
    )


def _between_rays(route: Route, stop: FloatArray, units: IntArray) -> FloatArray:
    """Fraction of each unit that rays hit (units,): less than 1 where it is seen so flat that some miss."""
    targets = route.space.targets
    along = (targets.b - targets.a)[targets.unit_segment[units]]
    sight = targets.unit_xy[units] - stop
    away = np.hypot(*sight.T)
    across = np.abs(along[:, 0] * sight[:, 1] - along[:, 1] * sight[:, 0])
    cosine = across / np.maximum(away * np.hypot(*along.T), 1e-12)
    spacing = away * ray_step(route.settings)
    found: FloatArray = np.minimum(targets.unit_length[units] * cosine / np.maximum(spacing, 1e-12), 1.0)
    return found


def _area(of_kind: BoolArray, promised: BoolArray, area: FloatArray, seen: FloatArray) -> SeenArea:
    own = of_kind & promised
    return SeenArea(
        total_m2=float(area[own].sum()),
        seen_m2=float((area[own] * seen[own]).sum()),
        length_m2=float(area[of_kind].sum()),
    )


def _sights(route: Route) -> Iterator[tuple[FloatArray, IntArray, IntArray]]:
    """Position of each stop, the units that count as seen from it, and all in its line of sight."""
    visible, candidates = route.visibility, route.visibility.candidates
    fov = math.radians(route.settings.fov)
    rows = np.sort(route.selection.chosen)
    stops = candidates.kept[rows]
    reason = np.full(len(candidates.xy), UNREACHABLE)
    reason[stops] = KEPT
    in_sight = exact(replace(candidates, reason=frozen(reason, np.int64)))
    for k, (row, stop) in enumerate(zip(rows.tolist(), stops.tolist(), strict=True)):
        xy, units = candidates.xy[stop], in_sight.seen_by(k)
        if len(candidates.heading):
            offset = route.space.targets.unit_xy[units] - xy
            units = units[in_view(offset, float(candidates.heading[stop]), fov=fov)]
        yield xy, visible.seen_by(row), units
