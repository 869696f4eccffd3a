"""Door swings: arcs of about a quarter turn with the radius of a leaf, drawn with any entity."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import FloatArray

LEAF = (0.5, 1.6)
"""Width of a door's leaf in metres."""
_SWEEP = (np.radians(28), np.radians(135))
"""Swing angle of a drawn leaf: usually a quarter turn, less in narrow rooms, sometimes a little more."""
_FLAT = np.radians(0.3)
"""A polyline that turns less than this at a point is straight there."""
_FACET = np.radians(31)
"""A facet of a swing turns by no more than this."""
_EVEN = 0.06
"""Facets of one arc differ in length and turn by no more than this share."""


@dataclass(frozen=True, eq=False)
class Swing:
    """An arc that the edge of a door's leaf goes along, in metres."""

    hinge: FloatArray
    """The arc's centre (2,)."""
    ends: FloatArray
    """Its two ends (2, 2): at one the leaf is shut, at the other open."""

    @property
    def radius(self) -> float:
        """The leaf's width."""
        return float(np.hypot(*(self.ends[0] - self.hinge)))


def swings_of(lines: Iterable[FloatArray]) -> list[Swing]:
    """Every swing among polylines (n, 2), in their order; an arc drawn twice is one swing."""
    found: dict[tuple[float, ...], Swing] = {}
    for line in lines:
        for swing in _in_line(line):
            ends = sorted(map(tuple, np.round(swing.ends, 2).tolist()))
            found.setdefault((*np.round(swing.hinge, 2).tolist(), *ends[0], *ends[1]), swing)
    return list(found.values())


def radii_in(lines: Iterable[FloatArray]) -> list[float]:
    """Return the radii of all quarter arcs in any unit, which show the length of the unit."""
    return [swing.radius for line in lines for swing in _in_line(line, width=(0.0, np.inf))]


def _in_line(line: FloatArray, *, width: tuple[float, float] = LEAF) -> Iterator[Swing]:
    steps = np.diff(line, axis=0)
    lengths = np.hypot(*steps.T)
    steps, lengths = steps[lengths > 0], lengths[lengths > 0]
    if len(steps) < 3:
        return
    points = np.vstack((line[:1], line[:1] + np.cumsum(steps, axis=0)))
    for first, last in _even_runs(_turns(steps), lengths):
        swing = _fitted(points[first : last + 1])
        if swing is not None and width[0] <= swing.radius <= width[1]:
            yield swing


def _turns(steps: FloatArray) -> FloatArray:
    """Angles by which a polyline turns from each step to the next."""
    a, b = steps[:-1], steps[1:]
    return np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.einsum("ij,ij->i", a, b))


def _even_runs(turns: FloatArray, lengths: FloatArray) -> Iterator[tuple[int, int]]:
    """First and last points of the runs that turn evenly: one arc each."""
    first = 0
    for k in range(len(turns) + 1):
        if k < len(turns) and _goes_on(turns, lengths, first, k):
            continue
        if k - first >= 2:
            yield first, k + 1
        first = k


def _goes_on(turns: FloatArray, lengths: FloatArray, first: int, k: int) -> bool:
    turn = turns[k]
    if not _FLAT < abs(turn) <= _FACET or abs(lengths[k + 1] - lengths[k]) > _EVEN * lengths[k]:
        return False
    return k == first or abs(turn - turns[k - 1]) <= _EVEN * abs(turn) + np.radians(0.2)


def _fitted(arc: FloatArray) -> Swing | None:
    """The circle through an arc's ends and middle, if the arc is about a quarter of it."""
    a, b, c = arc[0], arc[len(arc) // 2], arc[-1]
    u, v = b - a, c - a
    cross = 2.0 * (u[0] * v[1] - u[1] * v[0])
    if abs(cross) < 1e-12:
        return None
    uu, vv = np.dot(u, u), np.dot(v, v)
    hinge = a + np.array([v[1] * uu - u[1] * vv, u[0] * vv - v[0] * uu]) / cross
    radius = float(np.hypot(*(a - hinge)))
    sweep = float(np.hypot(*np.diff(arc, axis=0).T).sum()) / radius
    away = np.abs(np.hypot(*(arc - hinge).T) - radius).max()
    if not _SWEEP[0] <= sweep <= _SWEEP[1] or away > 0.02 * radius:
        return None
    return Swing(hinge, np.array([a, c]))


@dataclass(frozen=True, eq=False)
class Leaf:
    """A swing with the end at which it is shut, and how sure that is."""

    hinge: FloatArray
    shut: FloatArray
    """Where the leaf's edge is when the door is shut (2,)."""
    open: FloatArray


def paired(leaves: Sequence[Leaf], *, within: float = 0.2) -> list[tuple[Leaf, ...]]:
    """Single leaves, and two leaves of one door where their shut edges meet."""
    left = list(range(len(leaves)))
    found: list[tuple[Leaf, ...]] = []
    while left:
        first = left.pop(0)
        mate = next((k for k in left if _meet(leaves[first], leaves[k], within)), None)
        if mate is None:
            found.append((leaves[first],))
        else:
            left.remove(mate)
            found.append((leaves[first], leaves[mate]))
    return found


def _meet(one: Leaf, other: Leaf, within: float) -> bool:
    """True if two leaves meet edge to edge on one line."""
    if np.hypot(*(one.shut - other.shut)) > within:
        return False
    a, b = one.shut - one.hinge, other.shut - other.hinge
    return float(np.dot(a, b)) < -0.9 * float(np.hypot(*a) * np.hypot(*b))
