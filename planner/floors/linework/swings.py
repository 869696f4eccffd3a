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
_AJAR = np.radians(8)
"""Least swing angle of a door drawn ajar, where a leaf runs from the hinge to the arc's end."""
_FLAT = np.radians(0.3)
"""A polyline that turns less than this at a point is straight there."""
_FACET = np.radians(31)
"""A facet of a swing turns by no more than this."""
_SLACK = 0.12
"""A leaf begins and ends within this fraction of its width from the hinge and from the arc's end."""
_EXACT = 0.03
"""For a door that is drawn ajar the leaf begins at the hinge within this fraction of its width."""
_ONWARD = np.cos(np.radians(8))
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

    @property
    def is_ajar(self) -> bool:
        """True if the leaf is drawn nearly shut: the arc is too short to show a door by itself."""
        chord = float(np.hypot(*(self.ends[1] - self.ends[0])))
        return chord < 2 * self.radius * np.sin(_SWEEP[0] / 2)


def swings_of(
    lines: Iterable[FloatArray], *, width: tuple[float, float] = LEAF, drawn_leaf: bool = False
) -> list[Swing]:
    """Every swing among polylines (n, 2), in their order; an arc drawn twice is one swing.

    Parameters
    ----------
    width
        Least and greatest radius.
    drawn_leaf
        True if only swings count whose leaf is drawn.
    """
    found: dict[tuple[float, ...], Swing] = {}
    for _, swing in swings_with_lines(list(lines), width=width, drawn_leaf=drawn_leaf):
        ends = sorted(map(tuple, np.round(swing.ends, 2).tolist()))
        found.setdefault((*np.round(swing.hinge, 2).tolist(), *ends[0], *ends[1]), swing)
    return list(found.values())


def swings_with_lines(
    lines: Sequence[FloatArray], *, width: tuple[float, float] = LEAF, drawn_leaf: bool = False
) -> list[tuple[FloatArray, Swing]]:
    """Every swing with the polyline that it is part of.

    An arc that lines go on from at both ends, or that another one runs around, is a round wall or a rounded
    corner, unless a leaf is drawn from its centre to one of its ends.
    """
    found = [(line, swing) for line in lines for swing in _in_line(line, width=width)]
    if not found:
        return []
    round_ = _RoundLines(lines, [swing for _, swing in found])
    return [
        (line, swing)
        for line, swing in found
        if round_.has_leaf(swing)
        or not (swing.is_ajar or drawn_leaf or round_.goes_on(swing) or round_.is_double(swing))
    ]


class _RoundLines:
    """Asks what is drawn at the centre and the ends of arcs."""

    def __init__(self, lines: Sequence[FloatArray], swings: Sequence[Swing]) -> None:
        from scipy.spatial import cKDTree

        pieces = [np.stack([line[:-1], line[1:]], axis=1) for line in lines if len(line) > 1]
        segments = np.concatenate(pieces)
        self._ends = np.concatenate([segments, segments[:, ::-1]])
        """Every segment from each of its ends (n, 2, 2)."""
        self._tree = cKDTree(self._ends[:, 0])
        self._hinges = cKDTree(np.array([swing.hinge for swing in swings]))
        self._swings = swings

    def has_leaf(self, swing: Swing) -> bool:
        """True if a straight line runs from the hinge to one of the ends."""
        near = _SLACK * swing.radius
        at_hinge = _EXACT * swing.radius if swing.is_ajar else near
        from_hinge = self._ends[self._tree.query_ball_point(swing.hinge, at_hinge)]
        return any(bool((np.hypot(*(from_hinge[:, 1] - end).T) <= near).any()) for end in swing.ends)

    def goes_on(self, swing: Swing) -> bool:
        """True if at both ends a line leaves in the direction of the arc."""
        return all(self._leaves(swing, k) for k in (0, 1))

    def _leaves(self, swing: Swing, k: int) -> bool:
        end, other = swing.ends[k], swing.ends[1 - k]
        arm = (end - swing.hinge) / swing.radius
        tangent = np.array([-arm[1], arm[0]])
        tangent = -tangent if tangent @ (other - end) > 0 else tangent
        steps = self._ends[self._tree.query_ball_point(end, 0.02 * swing.radius)]
        away = steps[:, 1] - steps[:, 0]
        length = np.hypot(*away.T)
        on = (length >= 0.1 * swing.radius) & (away @ tangent >= _ONWARD * length)
        return bool(on.any())

    def is_double(self, swing: Swing) -> bool:
        """True if another arc of nearly the same radius has the same centre and directions."""
        close = self._hinges.query_ball_point(swing.hinge, 0.02 * swing.radius)
        return any(_runs_around(swing, self._swings[k]) for k in close)


def _runs_around(one: Swing, other: Swing) -> bool:
    if not 0.01 < abs(one.radius - other.radius) / one.radius < 0.6:
        return False
    arms = [(swing.ends - swing.hinge) / swing.radius for swing in (one, other)]
    return any(np.abs(arms[0] - turned).max() < 0.1 for turned in (arms[1], arms[1][::-1]))


def _in_line(line: FloatArray, *, width: tuple[float, float]) -> Iterator[Swing]:
    if len(line) < 4:
        return
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
    if not _AJAR <= sweep <= _SWEEP[1] or away > 0.02 * radius:
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
