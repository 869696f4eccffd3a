"""Shown boundary -> how firmly two scans can be laid on one another: what both see, and what it holds.

A wall seen by both holds the pair across the wall and not along it. Boundary seen by both, laid on itself
point to line, has the normal matrix N = ∫ j jᵀ ds with j = (nx, ny, (p × n) / LEVER_M), p from the stop and n
the face's normal (Censi, "An accurate closed-form estimate of ICP's covariance", ICRA 2007). Its least
eigenvalue, in metres, is how much wall faces the weakest of all small moves in x, y and heading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.overlap.boundary import Shown
from stopgo.planner.visibility.unit_ranges import ranges

LEVER_M = 0.01 / math.radians(0.1)
"""A turn counts as the way it makes at this distance: 0.1° as much as 1 cm, what is allowed of each."""
LEAST_STRETCH_M = 0.35
"""Narrower stretches seen by both do not count, such as the jambs of a door: where points are thinned to one
per 7.5 cm they have no direction of their own, and a long wall beside them outweighs them."""
DIGITS = 6
"""Figures of a pair are whole micrometres and millionths, so that both ends of a pair have the same."""


EPSILON_M = 1e-9


@dataclass(frozen=True, eq=False)
class Pairs:
    """One row with every other that sees some of the same boundary."""

    other: IntArray
    """Rows, ascending (n,)."""
    common_m: FloatArray
    """Metres of boundary that both see (n,)."""
    share: FloatArray
    """Of what the one of the two sees that sees less (n,)."""
    hold_m: FloatArray
    """Metres of wall that face the pair's weakest move (n,)."""


class Overlaps:
    """What candidates see in common, worked out row by row as it is asked for."""

    def __init__(self, seen: Shown) -> None:
        self._seen = seen
        self._by_row: dict[int, Pairs] = {}
        self._row = np.repeat(np.arange(len(seen.xy)), np.diff(seen.pointer))
        self._order = np.lexsort((seen.begin, self._row, seen.face))
        self._place = seen.face[self._order] * self.rows + self._row[self._order]
        """Ascending: faces, and on each the rows that see some of it."""

    @property
    def rows(self) -> int:
        return len(self._seen.xy)

    @cached_property
    def shown_m(self) -> FloatArray:
        """Metres of boundary that each row sees (rows,)."""
        length = self._seen.end - self._seen.begin
        return np.asarray(np.bincount(self._row, length, self.rows), np.float64)

    def of(self, row: int) -> Pairs:
        """A row with every other; kept."""
        if row not in self._by_row:
            self._by_row[row] = self._pairs(row, first=0)
        return self._by_row[row]

    def after(self, row: int) -> Pairs:
        """A row with every later one; not kept, since all of a large floor's would take gigabytes."""
        return self._pairs(row, first=row + 1)

    def middle_of_common(self, row: int, other: int) -> FloatArray:
        """The middle of the longest stretch of boundary that two rows see, local metres (2,)."""
        seen = self._seen
        there, begin, end = self._common(row)
        own = np.flatnonzero(self._row[there] == other)
        longest = own[int(np.argmax((end - begin)[own]))]
        face = seen.face[there[longest]]
        a, b = seen.boundary.a[face], seen.boundary.b[face]
        middle: FloatArray = a + (b - a) / np.hypot(*(b - a)) * (begin[longest] + end[longest]) / 2
        return middle

    def _common(self, row: int, *, first: int = 0) -> tuple[IntArray, FloatArray, FloatArray]:
        """What a row and others (from `first` on) both see: the others' stretches, from where to where."""
        seen = self._seen
        own = np.arange(seen.pointer[row], seen.pointer[row + 1])
        begin = np.searchsorted(self._place, seen.face[own] * self.rows + first)
        counts = np.searchsorted(self._place, (seen.face[own] + 1) * self.rows) - begin
        there, mine = self._order[ranges(begin, counts)], np.repeat(own, counts)
        low = np.maximum(seen.begin[mine], seen.begin[there])
        high = np.minimum(seen.end[mine], seen.end[there])
        both = (high - low > LEAST_STRETCH_M - EPSILON_M) & (self._row[there] != row)
        return there[both], low[both], high[both]

    def _pairs(self, row: int, *, first: int) -> Pairs:
        seen = self._seen
        there, begin, end = self._common(row, first=first)
        other, index = np.unique(self._row[there], return_inverse=True)
        moments = self._moments(seen.face[there], begin, end, index, len(other))
        common = np.bincount(index, end - begin, len(other))
        least = np.minimum(self.shown_m[row], self.shown_m[other])
        here = np.repeat(seen.xy[row][None], len(other), axis=0)
        hold = np.minimum(_least_hold(moments, here), _least_hold(moments, seen.xy[other]))
        share = common / np.maximum(least, 1e-12)
        return Pairs(other, *(np.round(figure, DIGITS) for figure in (common, share, hold)))

    def _moments(
        self, face: IntArray, begin: FloatArray, end: FloatArray, index: IntArray, many: int
    ) -> FloatArray:
        """N about the local origin (many, 3, 3), the sum over each pair's stretches, without the lever."""
        a, b = self._seen.boundary.a[face], self._seen.boundary.b[face]
        along = (b - a) / np.hypot(*(b - a).T)[:, None]
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
        arm = a[:, 0] * normal[:, 1] - a[:, 1] * normal[:, 0]  # (a + s along) × normal = arm + s
        s1, s2, s3 = ((end**k - begin**k) / k for k in (1, 2, 3))
        turn = (arm * s1 + s2, arm * arm * s1 + 2 * arm * s2 + s3)
        entries = {
            (0, 0): normal[:, 0] ** 2 * s1,
            (0, 1): normal[:, 0] * normal[:, 1] * s1,
            (1, 1): normal[:, 1] ** 2 * s1,
            (0, 2): normal[:, 0] * turn[0],
            (1, 2): normal[:, 1] * turn[0],
            (2, 2): turn[1],
        }
        found = np.zeros((many, 3, 3))
        for (i, j), entry in entries.items():
            found[:, i, j] = found[:, j, i] = np.bincount(index, entry, many)
        return found


def _least_hold(moments: FloatArray, at: FloatArray) -> FloatArray:
    """Least eigenvalue of each normal matrix about its own point (n, 2), turns counted by LEVER_M."""
    shift = np.repeat(np.eye(3)[None], len(at), axis=0)
    shift[:, 2, 0], shift[:, 2, 1] = at[:, 1], -at[:, 0]  # (p - at) × n = p × n - at × n
    shift[:, 2] /= LEVER_M
    about = shift @ moments @ shift.transpose(0, 2, 1)
    return np.maximum(np.linalg.eigvalsh(about)[:, 0], 0.0) if len(at) else np.empty(0)
