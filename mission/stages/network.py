"""Network of a mission's scans: pairs that register with one another, and the components they connect."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace

from stopgo.mission.console.table import counted
from stopgo.mission.document import Mission, Overlap, Stop
from stopgo.mission.geometry import FloatArray
from stopgo.mission.stages.figures import percent

NOISE_M = 0.33e-3
"""Registration error of one metre of wall, metres (standard deviation, times the root of the metres)."""
ELLIPSE_POINTS = 49
"""Points of a drawn ellipse, the first again at the end."""
FLOOR_M = 0.4e-3
"""Registration error that no length of wall averages out: that of the thinned cloud, metres."""
SIMULATED_NOISE_MM = 2.0
"""Range noise with which NOISE_M and FLOOR_M were measured, mm rms."""
MOST_NOISE_MM = 15.0
"""Range noise of a plan, at most: with 20 mm no pair is within 1 cm."""
CONFIDENCE = 2.576
"""Standard deviations that a normal error exceeds, to either side, once in 100."""
CONTROL_FRAME = "control points"
"""Name of the frame of errors that control points hold, where a stop's name stands otherwise."""


def noise_factor(range_noise: Any) -> float:
    """Return by how much errors are larger with this range noise (mm) than with that of the simulations.

    Less noise counts as that, and so does what is no number: a mission's parameters are only recorded.
    """
    known = range_noise if isinstance(range_noise, int | float) and math.isfinite(range_noise) else 0.0
    return max(1.0, min(known, MOST_NOISE_MM) / SIMULATED_NOISE_MM)


def predicted_error_m(hold_m: float, noise: float) -> float:
    """Return the predicted standard deviation of a pair in its weakest direction, metres.

    `noise` is the `noise_factor` of the scanner.
    """
    return noise * math.sqrt(FLOOR_M**2 + NOISE_M**2 / max(hold_m, 1e-12))


@dataclass(frozen=True)
class Network:
    """Stops, and the pairs of them whose scans register with one another."""

    stops: tuple[str, ...]
    overlaps: tuple[Overlap, ...]
    noise: float = 1.0
    """The `noise_factor` of the scanner."""

    @cached_property
    def pieces(self) -> tuple[tuple[str, ...], ...]:
        """Connected components of the stops, the largest first; one if all are connected."""
        return _pieces(self.stops, self.overlaps)

    @cached_property
    def bridges(self) -> tuple[Overlap, ...]:
        """Pairs without which there would be more components."""
        near: dict[str, list[Overlap]] = {}
        for overlap in self.overlaps:
            for end in (overlap.a, overlap.b):
                near.setdefault(end, []).append(overlap)
        found = _bridges(self.stops, near)
        return tuple(overlap for overlap in self.overlaps if overlap in found)

    @cached_property
    def weakest(self) -> Overlap | None:
        """Weakest pair that stronger pairs cannot replace; None if no two scans register."""
        taken: list[Overlap] = []
        end_of = {stop: stop for stop in self.stops}
        for overlap in sorted(self.overlaps, key=lambda item: -item.hold_m):
            a, b = _root(end_of, overlap.a), _root(end_of, overlap.b)
            if a != b:
                end_of[a] = b
                taken.append(overlap)
        return taken[-1] if taken else None

    def renamed(self, names: Mapping[str, str]) -> Network:
        """Return the same network with other names for all stops."""
        pairs = (replace(item, a=names[item.a], b=names[item.b]) for item in self.overlaps)
        return Network(tuple(names[stop] for stop in self.stops), tuple(pairs), self.noise)

    def among(self, stops: Collection[str]) -> Network:
        """Return the network of these stops only."""
        return Network(
            tuple(stop for stop in self.stops if stop in stops),
            tuple(item for item in self.overlaps if item.a in stops and item.b in stops),
            self.noise,
        )

    def in_words(self, pair: Overlap) -> str:
        """Return one pair with its figures."""
        return (
            f"{pair.a}-{pair.b}: {pair.common_m:.1f} m visible from both, {percent(pair.share)} of a scan, "
            f"predicted error {self.error_in_words(pair)}"
        )

    def error_in_words(self, pair: Overlap) -> str:
        """Return the predicted error of a pair in its weakest direction."""
        return f"{1000 * predicted_error_m(pair.hold_m, self.noise):.1f} mm"


@dataclass(frozen=True)
class MagnifiedErrors:
    """Predicted error ellipses of a mission's scans, drawn so large that they can be seen."""

    factor: float
    """Times as large as they are."""
    outlines: dict[str, FloatArray]
    """Closed outline (n, 2) of each stop's ellipse, metres on the floor."""
    words: dict[str, str]
    """Each ellipse in words."""


def error_factor(mission: Mission, *, most_m: float) -> float | None:
    """Return by how much errors are magnified for half axes of at most `most_m`; None if there are none."""
    claimed = (stop.error for stop in mission.stops if not isinstance(stop.error, msgspec.UnsetType))
    largest = max((error.major_m for error in claimed), default=0.0)
    return _round_below(most_m / largest) if 0 < largest < math.inf else None


def magnified_errors(mission: Mission, *, most_m: float) -> MagnifiedErrors | None:
    """Return the standard error ellipses, with half axes of at most `most_m`; None if there are none."""
    factor = error_factor(mission, most_m=most_m)
    if factor is None:
        return None
    turn = np.linspace(0, 2 * np.pi, ELLIPSE_POINTS)
    circle = np.array([np.cos(turn), np.sin(turn)])
    outlines, words = {}, {}
    for stop in mission.stops:
        error = stop.error
        if isinstance(error, msgspec.UnsetType):
            continue
        x, y = factor * np.array([[error.major_m], [error.minor_m]]) * circle
        cos, sin = math.cos(error.direction), math.sin(error.direction)
        outlines[stop.id] = np.stack([stop.x + cos * x - sin * y, stop.y + sin * x + cos * y], axis=1)
        words[stop.id] = error_in_words(stop)
    return MagnifiedErrors(factor, outlines, words)


def frame_of(mission: Mission) -> str | None:
    """Return the stop that holds the frame of the predicted errors; None if no stop does."""
    exact = [stop.id for stop in mission.stops if stop.error and stop.error.major_m == 0]
    return exact[0] if len(exact) == 1 else None


def error_limits(mission: Mission) -> dict[str, float]:
    """Return the predicted position error of each stop's scan with a probability of 0.99, metres."""
    claimed = {stop.id: stop.error for stop in mission.stops if stop.error}
    return {stop: CONFIDENCE * error.major_m for stop, error in claimed.items()}


def error_in_words(stop: Stop) -> str:
    """Return the predicted error of a stop's scan; an empty string if it claims none."""
    error = stop.error
    if isinstance(error, msgspec.UnsetType):
        return ""
    if error.major_m == 0:
        return f"{stop.id}: the other scans' errors are in its frame"
    axes = f"{1000 * error.major_m:.1f} × {1000 * error.minor_m:.1f} mm"
    return f"{stop.id}: predicted error {axes} (standard deviations)"


def _round_below(value: float) -> float:
    """Return the greatest number 1, 2 or 5 times a power of ten that is at most this."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9))


def network_of(mission: Mission) -> Network | None:
    """Return the mission's network; None if it was planned without one."""
    if isinstance(mission.network, msgspec.UnsetType):
        return None
    noise = noise_factor(mission.origin.parameters.get("range_noise"))
    return Network(tuple(stop.id for stop in mission.stops), mission.network, noise)


def apart_in_words(mission: Mission, acquired: Collection[str]) -> str:
    """Return one line if the scans are in more components than planned; else an empty string."""
    planned = network_of(mission)
    if planned is None or not acquired:
        return ""
    remaining = planned.among(acquired)
    missing = [stop for stop in planned.stops if stop not in acquired]
    if len(remaining.pieces) <= max(1, len(planned.pieces)):
        return ""
    without = f" without {', '.join(missing)}" if missing else ""
    others = "; ".join(" ".join(piece) for piece in remaining.pieces[1:])
    return f"the scans are in {len(remaining.pieces)} components{without}; separate: {others}"


def network_table(network: Network | None) -> dict[str, Any]:
    """Return the network for JSON, under its key; empty if there is none."""
    if network is None:
        return {}
    table = {
        "pieces": network.pieces,
        "pairs": msgspec.to_builtins(network.overlaps),
        "weakest": None if network.weakest is None else msgspec.to_builtins(network.weakest),
        "bridges": [[item.a, item.b] for item in network.bridges],
    }
    return {"network": table}


def network_lines(network: Network | None) -> list[str]:
    """Return the lines for a terminal: components, the weakest pair, and bridges; none for a single scan."""
    if network is None or len(network.stops) < 2:
        return []
    number, pairs = len(network.pieces), len(network.overlaps)
    lines = [
        f"  network     {'connected' if number == 1 else f'{number} COMPONENTS'}: "
        f"{counted(pairs, 'pair')} of {len(network.stops)} scans register with one another"
    ]
    if network.weakest is not None:
        lines.append(f"    weakest   {network.in_words(network.weakest)}")
    if network.bridges:
        listed = ", ".join(f"{item.a}-{item.b}" for item in network.bridges[:MOST_LISTED])
        more = f" and {len(network.bridges) - MOST_LISTED} more" if len(network.bridges) > MOST_LISTED else ""
        lines.append(f"    bridges   {listed}{more}: without one of these the scans are not connected")
    return lines


MOST_LISTED = 12


def _root(end_of: dict[str, str], stop: str) -> str:
    while end_of[stop] != stop:
        stop = end_of[stop]
    return stop


def _pieces(stops: Iterable[str], overlaps: Iterable[Overlap]) -> tuple[tuple[str, ...], ...]:
    end_of = {stop: stop for stop in stops}
    for item in overlaps:
        end_of[_root(end_of, item.a)] = _root(end_of, item.b)
    by_end: dict[str, list[str]] = {}
    for stop in end_of:
        by_end.setdefault(_root(end_of, stop), []).append(stop)
    return tuple(tuple(piece) for piece in sorted(by_end.values(), key=lambda piece: -len(piece)))


def _bridges(stops: Iterable[str], near: dict[str, list[Overlap]]) -> set[Overlap]:
    """Find pairs that close no loop, by depth-first search (Tarjan, 1974)."""
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    found: set[Overlap] = set()
    for root in stops:
        if root in order:
            continue
        order[root] = low[root] = len(order)
        path: list[tuple[str, Overlap | None, Iterator[Overlap]]] = [(root, None, iter(near.get(root, [])))]
        while path:
            stop, came, rest = path[-1]
            item = next(rest, None)
            if item is None:
                path.pop()
                if path:
                    before = path[-1][0]
                    low[before] = min(low[before], low[stop])
                    if low[stop] > order[before] and came is not None:
                        found.add(came)
            elif item is not came:
                other = item.b if item.a == stop else item.a
                if other in order:
                    low[stop] = min(low[stop], order[other])
                else:
                    order[other] = low[other] = len(order)
                    path.append((other, item, iter(near.get(other, []))))
    return found
