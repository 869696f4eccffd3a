"""Route -> pairs of its stops that register; and a remedy where the network is not connected."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from msgspec import UNSET, UnsetType
from shapely.geometry.base import BaseGeometry

from stopgo.mission.document import Overlap, PositionError, stop_names
from stopgo.mission.document.specs import rounded
from stopgo.mission.floor import Finding
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace, OpeningState, Route
from stopgo.mission.stages.figures import ACCURACY_NOT_MET, percent
from stopgo.mission.stages.network import (
    CONFIDENCE,
    CONTROL_FRAME,
    Network,
    noise_factor,
    predicted_error_m,
)
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.geometry.shapes import local_origin, to_shape
from stopgo.planner.overlap import LEAST_COMMON_M, Overlaps, least_hold_m, registers
from stopgo.planner.overlap.boundary import shown
from stopgo.planner.overlap.control import seen_control
from stopgo.planner.overlap.network_error import error_ellipses, information_of, network_errors


@instance_cached
def registered_pairs(route: Route) -> tuple[Overlap, ...]:
    """Pairs of the route's stops that register with one another, in the order of driving."""
    overlaps, settings = _overlaps_of_stops(route), _settings(route)
    names = stop_names(overlaps.rows)
    found = []
    for pairs in overlaps.later():
        for at in registers(pairs, settings):
            figures = (float(values[at]) for values in (pairs.common_m, pairs.share, pairs.hold_m))
            found.append(Overlap(names[pairs.row[at]], names[pairs.other[at]], *map(rounded, figures)))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class PredictedErrors:
    """Standard error ellipses of a network's scans, and their frame."""

    ellipses: FloatArray
    """Of each stop's scan in the order of driving (n, 3): half axes in metres, and radians from +x."""
    frame: str
    """The stop that holds the frame, or CONTROL_FRAME."""

    @property
    def m(self) -> FloatArray:
        """Standard deviation of each scan in its worst direction, metres (n,)."""
        return self.ellipses[:, 0]


@instance_cached
def predicted_errors(route: Route) -> PredictedErrors:
    """Predict the error of every stop's scan; a scan that nothing holds has the error infinity."""
    overlaps, stops = _overlaps_of_stops(route), _names(route)
    number = {stop: k for k, stop in enumerate(stops)}
    ends = [(number[pair.a], number[pair.b]) for pair in registered_pairs(route)]
    xy = route.xy - local_origin(route.space.floor)
    noise = noise_factor(_settings(route).range_noise)
    matrices = overlaps.normal_matrices(ends)
    information = [
        information_of(matrix, xy[b], noise) for matrix, (_, b) in zip(matrices, ends, strict=True)
    ]
    covariances, frame = network_errors(xy, ends, information, seen_control(route.space, xy))
    ellipses = error_ellipses(covariances)
    return PredictedErrors(ellipses, CONTROL_FRAME if frame is None else stops[frame])


def error_of_stop(route: Route, k: int) -> PositionError | UnsetType:
    """The predicted error of the k-th stop's scan in driving order; none if no pair or point holds it."""
    major, minor, direction = predicted_errors(route).ellipses[k].tolist()
    if not math.isfinite(major) or len(route.order) < 2:
        return UNSET
    round_ = major - minor < ROUND_M
    return PositionError(
        major_m=round(major, ERROR_DIGITS),
        minor_m=round(minor, ERROR_DIGITS),
        direction=0.0 if round_ else round(direction, DIRECTION_DIGITS) % round(math.pi, DIRECTION_DIGITS),
    )


def inaccurate(route: Route) -> Iterator[Finding]:
    """Remedy if a scan's predicted error exceeds the accuracy required."""
    asked = _settings(route).accuracy
    if asked is None or not _settings(route).registers:
        return
    predicted = predicted_errors(route)
    errors = CONFIDENCE * 1000 * predicted.m
    beyond = np.flatnonzero(np.isfinite(errors) & (errors > asked))
    if len(beyond):
        worst = int(beyond[np.argmax(errors[beyond])])
        called, frame = _called(route), predicted.frame
        within = frame if frame == CONTROL_FRAME else called[_names(route).index(frame)]
        x, y = route.xy[worst].tolist()
        yield Finding(
            ACCURACY_NOT_MET,
            f"the predicted error of {called[worst]} is {errors[worst]:.1f} mm (99 %) in the frame of "
            f"{within}, with {asked:g} mm required, and no other stop lowers it; measure a target "
            f"that it sees as a control point, near ({x:.1f}, {y:.1f}), and give it as --control",
            at=(x, y),
        )


def unseen_control(route: Route) -> Iterator[Finding]:
    """Control points that no stop sees: the network is not in their frame."""
    origin = local_origin(route.space.floor)
    reach = _settings(route).farthest_overlap
    seen = {tuple(point.tolist()) for _, point in seen_control(route.space, route.xy - origin)}
    for x, y in _settings(route).control:
        if tuple((np.array([x, y]) - origin).tolist()) not in seen:
            yield Finding(
                UNSEEN_CONTROL,
                f"the control point ({x:g}, {y:g}) is seen by no stop within {reach:g} m "
                "and not used; give metres of the drawing, for a target on a wall a point just before it",
                at=(x, y),
            )


def _names(route: Route) -> tuple[str, ...]:
    return tuple(stop_names(len(route.order)))


def _called(route: Route) -> list[str]:
    """Name of each stop in findings: its place if several missions, each with its own s01, have the stops."""
    if _settings(route).divided:
        return [f"the stop at ({x:.1f}, {y:.1f})" for x, y in route.xy]
    return list(_names(route))


@instance_cached
def _overlaps_of_stops(route: Route) -> Overlaps:
    """The boundary that stops see in common; row k is the k-th stop in driving order."""
    selection = route.selection
    return Overlaps(shown(selection.candidates, selection.chosen[route.order]))


def _settings(route: Route) -> Settings:
    return route.settings


ERROR_DIGITS, DIRECTION_DIGITS = 5, 2
"""Decimals of an error ellipse in a mission: metres, and radians."""
ROUND_M = 5e-5
"""Difference of the half axes below which an ellipse is a circle without direction."""
UNSEEN_CONTROL = "control_unseen"
"""Code of findings about control points that no stop sees."""
SCANS_APART = ("scans_apart", "scans_not_joined")
"""Codes of findings about scans that are not connected: with a required overlap, and without."""


def scans_apart(route: Route) -> Iterator[Finding]:
    """Remedy for each separate component of the network; where scans need not register, their number."""
    settings, count = _settings(route), len(route.order)
    names = stop_names(count)
    _, *others = Network(tuple(names), registered_pairs(route)).pieces or ((),)
    if not settings.registers:
        if others:
            how = "without --no-register" if settings.register is False else "with --register"
            yield Finding(
                "scans_not_joined",
                f"the scans fall into {len(others) + 1} components that no common surfaces connect; set up "
                f"target spheres, or plan {how}",
            )
        return
    called = _called(route)
    for piece in others:
        here = np.array([names.index(stop) for stop in piece])
        stops = _listed([called[k] for k in here])
        verb = "does" if len(piece) == 1 else "do"
        remedy, at = _remedy(route, here, np.setdiff1d(np.arange(count), here), called)
        yield Finding("scans_apart", f"{stops} {verb} not register with the other scans; {remedy}", at=at)


MOST_LISTED = 6
"""Stops named in a finding; of more only the number."""


def _listed(stops: list[str]) -> str:
    rest = f" and {len(stops) - MOST_LISTED} more" if len(stops) > MOST_LISTED else ""
    return ", ".join(stops[:MOST_LISTED]) + rest


def _remedy(
    route: Route, here: IntArray, there: IntArray, names: list[str]
) -> tuple[str, tuple[float, float] | None]:
    """A remedy that connects two sets of stops, and its position: target spheres, else an opening."""
    space = route.space
    overlaps = _overlaps_of_stops(route)
    best = max(_common_between(overlaps, here, there), default=None)
    if best is not None:
        _, _, k, j = best
        x, y = (overlaps.middle_of_common(k, j) + local_origin(space.floor)).tolist()
        spheres = f"a target sphere or board that {names[k]} and {names[j]} both see would join them, such as"
        return f"{spheres} near ({x:.1f}, {y:.1f}): {_reason(route, k, j)}", (x, y)
    if (between := _midway(route, here, there)) is not None:
        k, j, (x, y) = between
        near = float(np.hypot(*(route.xy[k] - route.xy[j]))) <= 2 * _settings(route).farthest_overlap
        target = "a target sphere or board" if near else "a stop, with a target sphere or board on each side,"
        means = f"{target} between {names[k]} and {names[j]} would join them, such as"
        return f"{means} at ({x:.1f}, {y:.1f}): they see no boundary in common", (x, y)
    opening = _nearest_opening(space.openings, route.xy[here], route.xy[there])
    if opening is None:
        return (
            "no opening lies between them: set target spheres, or measure the stops with a total station",
            None,
        )
    x, y = opening.opening.line.mean(axis=0).tolist()
    name, kind = opening.opening.id, opening.opening.kind.removesuffix("s")
    advice = (
        "a scan from it"
        if opening.passable
        else f"it would join them if it were not {opening.why}: a scan from it"
    )
    return f"{kind} {name} at ({x:.1f}, {y:.1f}) is nearest to both; {advice} or spheres there", (x, y)


def _common_between(
    overlaps: Overlaps, here: IntArray, there: IntArray
) -> Iterator[tuple[float, float, int, int]]:
    """Strength, metres in common and stops of all pairs of two sets that see some of the same boundary."""
    for pairs in overlaps.of_each(here):
        at = np.flatnonzero(np.isin(pairs.other, there))
        columns = (pairs.hold_m, pairs.common_m, pairs.row, pairs.other)
        yield from zip(*(values[at].tolist() for values in columns), strict=True)


def _midway(route: Route, here: IntArray, there: IntArray) -> tuple[int, int, tuple[float, float]] | None:
    """The nearest stops of two sets in sight of one another, and the position midway; None if none are."""
    origin, solids = local_origin(route.space.floor), _opaque(route.space)
    away = np.hypot(*(route.xy[here][:, None] - route.xy[there][None]).transpose(2, 0, 1))
    for flat in np.argsort(away, axis=None, kind="stable").tolist():
        i, j = divmod(flat, len(there))
        ends = route.xy[[here[i], there[j]]]
        if not solids.intersects(shapely.LineString(ends - origin)):
            x, y = ends.mean(axis=0).tolist()
            return int(here[i]), int(there[j]), (x, y)
    return None


@instance_cached
def _opaque(space: NavigableSpace) -> BaseGeometry:
    """The solids that stop the laser, prepared for many lines of sight."""
    solids = to_shape(space.occluders, local_origin(space.floor))
    shapely.prepare(solids)
    return solids


FREE_M = 0.5
"""Predicted error from which on a pair is free, metres."""


def _reason(route: Route, k: int, j: int) -> str:
    """The reason why two stops that see common boundary do not register."""
    overlaps, settings = _overlaps_of_stops(route), _settings(route)
    pairs = overlaps.of(k)
    at = np.flatnonzero(pairs.other == j)
    common, share, hold = (float(values[at][0]) for values in (pairs.common_m, pairs.share, pairs.hold_m))
    if common < LEAST_COMMON_M:
        return f"they see only {common:.1f} m of boundary in common"
    if hold >= least_hold_m(settings):
        asked = settings.least_overlap
        return f"they see {percent(share)} of a scan in common, of {percent(asked)} required"
    error = predicted_error_m(hold, noise_factor(settings.range_noise))
    x, y, turn = overlaps.weakest_move(k, j)
    direction = math.degrees(math.atan2(y, x)) % 180
    how = "in heading" if abs(turn) > math.hypot(x, y) else f"along {direction:.0f}° from +x"
    if error > FREE_M:
        return f"no surface that both see holds them {how}"
    return f"their predicted error {how} is {1000 * error:.0f} mm (standard deviation)"


def _nearest_opening(
    openings: tuple[OpeningState, ...], here: FloatArray, there: FloatArray
) -> OpeningState | None:
    """The opening with the shortest straight detour from a stop here to a stop there."""
    if not openings:
        return None
    lines = np.array([shapely.LineString(item.opening.line) for item in openings])
    away = [
        np.min([shapely.distance(lines, shapely.Point(xy)) for xy in several], axis=0)
        for several in (here, there)
    ]
    return openings[int(np.argmin(away[0] + away[1]))]
