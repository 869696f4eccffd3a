"""Route -> which of its stops register with one another; and where pieces lie apart, what would join them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely

from mission.document import Overlap, stop_names
from mission.floor import Finding
from mission.geometry import FloatArray, IntArray
from mission.network import Network
from mission.planning import OpeningState, Route
from mission.specs import rounded
from planner.kept import kept
from planner.overlap import overlaps_of, registers
from planner.shapes import local_origin


@kept
def registered_pairs(route: Route) -> tuple[Overlap, ...]:
    """Pairs of the route's stops that register with one another, in the order of driving."""
    candidates = route.selection.visibility.candidates
    overlaps, share = overlaps_of(candidates), candidates.space.settings.least_overlap
    rows = route.selection.chosen[route.order]
    names = stop_names(len(rows))
    found = []
    for k, row in enumerate(rows.tolist()):
        pairs = overlaps.of(row)
        at = {int(pairs.other[index]): int(index) for index in registers(pairs, share=share)}
        for later, other in enumerate(rows[k + 1 :].tolist(), start=k + 1):
            if other in at:
                figures = (float(values[at[other]]) for values in (pairs.common_m, pairs.share, pairs.hold_m))
                found.append(Overlap(names[k], names[later], *map(rounded, figures)))
    return tuple(found)


def scans_apart(route: Route) -> Iterator[Finding]:
    """For each piece of the network that lies apart: what would join it."""
    settings = route.selection.visibility.candidates.space.settings
    if settings.least_overlap == 0 or len(route.order) < 2:
        return
    names = stop_names(len(route.order))
    network = Network(tuple(names), registered_pairs(route))
    _, *others = network.pieces
    for piece in others:
        here = np.array([names.index(stop) for stop in piece])
        told = f"{_listed(piece)} {'does' if len(piece) == 1 else 'do'} not register with the other scans; "
        way_out, at = _way_out(route, here, np.setdiff1d(np.arange(len(names)), here), names)
        yield Finding("scans_apart", told + way_out, at=at)


MOST_TOLD = 6


def _listed(stops: tuple[str, ...]) -> str:
    rest = f" and {len(stops) - MOST_TOLD} more" if len(stops) > MOST_TOLD else ""
    return ", ".join(stops[:MOST_TOLD]) + rest


def _way_out(
    route: Route, here: IntArray, there: IntArray, names: list[str]
) -> tuple[str, tuple[float, float] | None]:
    """What would join two sets of stops, and where: spheres that two of them see, else an opening."""
    candidates = route.selection.visibility.candidates
    overlaps = overlaps_of(candidates)
    rows = route.selection.chosen[route.order]
    best = None
    for k in here.tolist():
        pairs = overlaps.of(int(rows[k]))
        for index, other in enumerate(pairs.other.tolist()):
            for j in there[rows[there] == other].tolist():
                worth = (float(pairs.hold_m[index]), float(pairs.common_m[index]))
                best = max(best, (worth, k, j)) if best else (worth, k, j)
    if best is not None:
        (hold, common), k, j = best
        x, y = overlaps.middle_of_common(int(rows[k]), int(rows[j])) + local_origin(candidates.space.floor)
        told = f"target spheres that {names[k]} and {names[j]} both see would join them, such as near "
        seen = f" (they see {common:.1f} m of boundary in common, which hold as {hold:.2f} m do)"
        return f"{told}({x:.1f}, {y:.1f}){seen}", (x, y)
    opening = _nearest_opening(candidates.space.openings, route.xy[here], route.xy[there])
    if opening is None:
        return (
            "no opening lies between them: set target spheres, or measure the stops with a total station",
            None,
        )
    x, y = opening.opening.line.mean(axis=0).tolist()
    name, kind = opening.opening.id, opening.opening.kind.removesuffix("s")
    why = (
        "a scan from it"
        if opening.passable
        else f"it would join them if it were not {opening.why}: a scan from it"
    )
    return f"{kind} {name} at ({x:.1f}, {y:.1f}) is nearest to both; {why} or spheres there", (x, y)


def _nearest_opening(
    openings: tuple[OpeningState, ...], here: FloatArray, there: FloatArray
) -> OpeningState | None:
    """The opening over which the way from some stop here to some stop there is shortest."""
    if not openings:
        return None
    lines = np.array([shapely.LineString(item.opening.line) for item in openings])
    away = [
        np.min([shapely.distance(lines, shapely.Point(xy)) for xy in several], axis=0)
        for several in (here, there)
    ]
    return openings[int(np.argmin(away[0] + away[1]))]
