"""Mission + navigable space -> network pairs that do not register, by a recount line by line.

Every line of sight to the boundary is tested against every wall, as in `stopgo.planner.checking.claims`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import msgspec
import numpy as np
from msgspec.structs import replace
from scipy.sparse.csgraph import connected_components

from stopgo.mission.document import Mission, Stop
from stopgo.mission.document.problems import Problem
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace
from stopgo.mission.stages.network import CONFIDENCE, frame_of, network_of, noise_factor
from stopgo.planner.candidates.added_scans import with_scans
from stopgo.planner.checking.claims import candidates_by_heading
from stopgo.planner.geometry.shapes import GRID, local_origin, to_grid
from stopgo.planner.overlap import LEAST_COMMON_M, least_hold_m, links_of
from stopgo.planner.overlap.boundary import Boundary, boundary_of, shown_by
from stopgo.planner.overlap.control import seen_control
from stopgo.planner.overlap.network_error import (
    error_ellipses,
    information_of,
    network_errors,
    scan_covariances,
    worst_errors,
)
from stopgo.planner.overlap.pairs import Overlaps
from stopgo.planner.routing.planned_mission import is_of_plan
from stopgo.planner.visibility.exact_sight import sides_of_doors
from stopgo.planner.visibility.sight.sightlines import LineByLine, Midpoints

ROUNDED = 1e-5
"""Tolerance of a pair's figures, which are sums of rounded lengths."""
ERROR_SLACK, ERROR_SLACK_M = 0.01, 1e-5
"""Tolerance of a predicted error: a fraction of it, and metres, to which missions round it."""
REQUIRED = "the plan's parameters require scans that register with one another"


def network_overclaims(mission: Mission, space: NavigableSpace) -> Iterator[Problem]:
    """Every pair that registers less well than claimed or required, and pairs that are missing."""
    required = space.settings.registers
    known, scans = _with_known_pairs(mission), _Scans(mission, space)
    yield from _understated_errors(known, scans)
    if isinstance(mission.network, msgspec.UnsetType):
        if required and len(mission.stops) > 1:
            yield Problem("$.network", f"is missing, but {REQUIRED}")
        return
    yield from _weak_pairs(mission, scans)
    if required and mission.share is msgspec.UNSET and is_of_plan(mission, space):
        yield from _separate_scans(known, space)
        yield from _inaccurate_scans(known, scans)


def _with_known_pairs(mission: Mission) -> Mission:
    """Return the mission without pairs of stops that it does not have: these are problems of the document."""
    if isinstance(mission.network, msgspec.UnsetType):
        return mission
    stops = {stop.id for stop in mission.stops}
    return replace(mission, network=tuple(pair for pair in mission.network if {pair.a, pair.b} <= stops))


@dataclass(frozen=True, eq=False)
class _Scans:
    """The stops of a mission on its floor."""

    mission: Mission
    space: NavigableSpace

    @cached_property
    def overlaps(self) -> Overlaps:
        """Overlap of each two stops, counted line by line; rows in the order of the stops."""
        boundary, origin = boundary_of(self.space), local_origin(self.space.floor)
        stops = self.mission.stops
        xy = np.array([(stop.x, stop.y) for stop in stops]).reshape(-1, 2) - origin
        heading = np.array([stop.heading for stop in stops])
        visible = _BoundaryVisibility(boundary, self.space)
        pieces = (visible.seen_by(stop) for stop in stops)
        return Overlaps(shown_by(boundary, xy, pieces, heading, self.space.settings))


def _weak_pairs(mission: Mission, scans: _Scans) -> Iterator[Problem]:
    """Every pair with a weaker registration than claimed or required."""
    if not mission.network:
        return
    overlaps, settings = scans.overlaps, scans.space.settings
    row = {stop.id: k for k, stop in enumerate(mission.stops)}
    least = {
        "common_m": LEAST_COMMON_M,
        "hold_m": least_hold_m(settings),
        "share": settings.least_overlap,
    }
    for index, pair in enumerate(mission.network):
        if not {pair.a, pair.b} <= row.keys():
            continue
        pairs = overlaps.of(row[pair.a])
        at = np.flatnonzero(pairs.other == row[pair.b])
        for key, needed in least.items():
            counted = float(getattr(pairs, key)[at[0]]) if len(at) else 0.0
            path, claimed = f"$.network[{index}].{key}", getattr(pair, key)
            counted_text = f"{pair.a} and {pair.b} have {counted:g}, counted line by line"
            if counted < claimed - ROUNDED:
                yield Problem(path, f"is {claimed:g}, but {counted_text}")
            elif counted < needed - ROUNDED:
                yield Problem(path, f"is {claimed:g}: {counted_text}; a pair that registers has {needed:g}")


def _inaccurate_scans(mission: Mission, scans: _Scans) -> Iterator[Problem]:
    """The scan with the greatest predicted error, if this exceeds the accuracy required."""
    asked, network = scans.space.settings.accuracy, network_of(mission)
    if asked is None or network is None or not network.overlaps:
        return
    errors = worst_errors(_covariances(mission, scans, ()))
    found = CONFIDENCE * 1000 * np.where(np.isfinite(errors), errors, 0.0)
    worst = int(np.argmax(found))
    if found[worst] > asked * (1 + ROUNDED):
        text = f"is {asked:g} mm, but the predicted error of {network.stops[worst]} is {found[worst]:.1f} mm"
        yield Problem("$.origin.parameters.accuracy", f"{text}, counted line by line")


def _understated_errors(mission: Mission, scans: _Scans) -> Iterator[Problem]:
    """Every scan with a greater predicted error than claimed, in the frame of the scan without error."""
    claimed = {k: stop.error for k, stop in enumerate(mission.stops) if stop.error is not msgspec.UNSET}
    if not claimed:
        return
    frame = frame_of(mission)
    anchors = [k for k, stop in enumerate(mission.stops) if stop.id == frame]
    counted = error_ellipses(_covariances(mission, scans, anchors))
    for k, error in claimed.items():
        for axis, key in enumerate(("major_m", "minor_m")):
            claim, found = getattr(error, key), counted[k, axis]
            path = f"$.stops[{k}].error.{key}"
            if not np.isfinite(found):
                yield Problem(path, f"is {claim:g}, but no pair of the network holds {mission.stops[k].id}")
            elif found > claim * (1 + ERROR_SLACK) + ERROR_SLACK_M:
                yield Problem(path, f"is {claim:g}, but the network gives {found:.5f}, counted line by line")


def _covariances(mission: Mission, scans: _Scans, anchors: Sequence[int]) -> FloatArray:
    """Covariance of each scan's position by the mission's pairs (n, 2, 2).

    It is in the frame of the anchors; without any in that of the control points, or of a scan in the middle.
    """
    network, overlaps, space = network_of(mission), scans.overlaps, scans.space
    row = {stop.id: k for k, stop in enumerate(mission.stops)}
    pairs = [(row[pair.a], row[pair.b]) for pair in (network.overlaps if network else ())]
    xy = np.array([(stop.x, stop.y) for stop in mission.stops]) - local_origin(space.floor)
    moments = {pair: overlaps.normal_matrix(*pair) for pair in pairs}
    ends = [pair for pair in pairs if np.linalg.matrix_rank(moments[pair]) == 3]
    noise = noise_factor(space.settings.range_noise)
    information = [information_of(moments[a, b], xy[b], noise) for a, b in ends]
    if anchors:
        return scan_covariances(xy, ends, information, anchors)
    return network_errors(xy, ends, information, seen_control(space, xy))[0]


def _separate_scans(mission: Mission, space: NavigableSpace) -> Iterator[Problem]:
    """Components of the network that candidates could connect, as every plan does."""
    network = network_of(mission)
    if network is None or len(network.pieces) < 2:
        return
    poses = np.array([(stop.x, stop.y, stop.heading) for stop in mission.stops])
    doorway = np.array([stop.doorway for stop in mission.stops])
    found = with_scans(candidates_by_heading(mission, space), poses, doorway)
    _, region = connected_components(links_of(found), directed=False)
    first = len(region) - len(mission.stops)
    at = {stop.id: first + k for k, stop in enumerate(mission.stops)}
    owner: dict[int, int] = {}
    for number, piece in enumerate(network.pieces):
        for reached in {int(region[at[stop]]) for stop in piece}:
            if owner.setdefault(reached, number) != number:
                yield Problem("$.network", f"leaves {' '.join(piece)} apart, but {REQUIRED}")
                return


class _BoundaryVisibility:
    """A boundary, prepared for computing line by line the pieces that stops see."""

    def __init__(self, boundary: Boundary, space: NavigableSpace) -> None:
        a, b = to_grid(boundary.a), to_grid(boundary.b)
        midpoints = Midpoints.of(a, b, boundary.pieces, np.ones(len(a), dtype=bool))
        reach = round(space.settings.farthest_overlap / GRID)
        self._space, self._lines = space, LineByLine(midpoints, np.stack([a, b], axis=1), reach=reach)

    def seen_by(self, stop: Stop) -> IntArray:
        """Pieces that a stop sees in all directions; from both sides of a closed door if it is in one."""
        space, xy = self._space, np.array([stop.x, stop.y])
        closed_door = stop.doorway and space.settings.doors == "closed" and bool(space.openings)
        eyes = sides_of_doors(space, xy[None])[0] if closed_door else xy[None]
        views = [self._lines.seen_from(to_grid(eye - local_origin(space.floor))) for eye in eyes]
        return np.unique(np.concatenate(views))
