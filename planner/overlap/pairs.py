"""Shown boundary -> registration strength of two scans, by the boundary that both see.

A wall seen by both constrains the pair across the wall and not along it. Point-to-line registration of the
common boundary has the normal matrix N = ∫ j jᵀ ds with j = (nx, ny, (p × n) / LEVER_M), p from the stop
and n the face's normal (Censi, "An accurate closed-form estimate of ICP's covariance", ICRA 2007). Its least
eigenvalue is the registration strength `hold_m`: the metres of wall that face the weakest of all small moves
in x, y and heading. `share` is the overlap ratio. Both names are those of mission.json. The error in the
weakest direction is NOISE_M / √hold_m, by independent errors along the walls, and at least FLOOR_M.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.overlap.boundary import EDGE_M, WIDER_M, Boundary, ShownBoundary
from stopgo.planner.overlap.pair_kernel import sum_up

LEVER_M = 0.01 / math.radians(0.1)
"""A rotation counts as its displacement at this distance: 0.1° as much as 1 cm, the tolerance of each."""
ENTRIES = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
"""Entries of a normal matrix, in the order of their sums; the others are equal to these."""
BLOCK = 64
"""Rows whose pairs are computed at a time."""
DIGITS = 6
"""Decimals of a pair's figures, so that both stops of a pair have equal figures."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Rows with other rows that see some of the same boundary."""

    row: IntArray
    """Ascending (n,)."""
    other: IntArray
    """Ascending for each row (n,)."""
    common_m: FloatArray
    """Metres of boundary that both see (n,)."""
    share: FloatArray
    """Overlap ratio: common boundary over the boundary of the row that sees less (n,)."""
    hold_m: FloatArray
    """Registration strength: metres of wall that face the pair's weakest move (n,)."""


class Overlaps:
    """The boundary that candidates see in common, computed row by row on demand."""

    def __init__(self, seen: ShownBoundary) -> None:
        self._seen = seen
        self._by_row: dict[int, Pairs] = {}
        self._tables: tuple[NDArray[Any], ...] = ()
        self._row = np.repeat(np.arange(len(seen.xy)), np.diff(seen.pointer))
        self._order = np.lexsort((seen.begin, self._row, seen.surface))
        self._place = seen.surface[self._order] * self.rows + self._row[self._order]
        """Ascending: surfaces, and on each the rows that see some of it."""

    @property
    def rows(self) -> int:
        return len(self._seen.xy)

    @property
    def shown_m(self) -> FloatArray:
        """Metres of boundary that each row sees (rows,)."""
        return self._seen.metres

    def of(self, row: int) -> Pairs:
        """A row with every other row; cached."""
        if row not in self._by_row:
            self._by_row[row] = self._pairs(np.array([row]), np.array([0]))
        return self._by_row[row]

    def of_each(self, rows: IntArray) -> Iterator[Pairs]:
        """Each of the rows (n,) with every other row, in blocks; not cached."""
        for begin in range(0, len(rows), BLOCK):
            some = rows[begin : begin + BLOCK]
            yield self._pairs(some, np.zeros(len(some), dtype=np.int64))

    def later(self, some: range | None = None, *, least_m: float = 0.0) -> Iterator[Pairs]:
        """Some or all rows with every later row that has at least so much boundary in common, in blocks.

        They are not cached, since a large floor would take gigabytes.
        """
        some = range(self.rows) if some is None else some
        for begin in some[::BLOCK]:
            rows = np.arange(begin, min(begin + BLOCK, some.stop))
            yield self._pairs(rows, rows + 1, least_m=least_m)

    def firm(
        self, kernel: Callable[..., int], least_m: float, hold_m: float, some: range | None = None
    ) -> Iterator[tuple[IntArray, IntArray, FloatArray]]:
        """Pairs with so much boundary in common and more strength: rows, later rows, and metres in common.

        They are those of some of the rows, or of all.
        """
        rows = self.rows
        scratch = np.zeros(rows), np.zeros(6 * rows), np.zeros(rows, np.int64)
        data = (*(self._tables or self._for_kernel()), *scratch)
        some = range(rows) if some is None else some
        for low in some[::BLOCK]:
            high = min(low + BLOCK, some.stop)
            size = (high - low) * (rows - low)
            row, other, common = np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size)
            many = kernel(low, high, WIDER_M, least_m, hold_m, LEVER_M, *data, row, other, common)
            yield row[:many].copy(), other[:many].copy(), common[:many].copy()

    def with_tables(self) -> Overlaps:
        """Itself, with the tables that `firm` needs: processes that are forked then share them."""
        self._tables = self._for_kernel()
        return self

    def _for_kernel(self) -> tuple[NDArray[Any], ...]:
        """The stretches by surfaces, and the sums of normal matrices before their ends."""
        seen = self._seen
        first = np.searchsorted(seen.surface[self._order], np.arange(len(seen.boundary.first) + 1))
        row_on, begin, end = self._row[self._order], seen.begin[self._order], seen.end[self._order]
        sums = _sums_before(seen.boundary, first, begin, end)
        place = np.empty_like(self._order)
        place[self._order] = np.arange(len(place))
        shown = (seen.pointer, place, seen.surface, first, row_on, begin, end)
        return (*shown, seen.boundary.around, *sums, np.ascontiguousarray(seen.xy).ravel())

    def middle_of_common(self, row: int, other: int) -> FloatArray:
        """The middle of the longest stretch of boundary that two rows see, local metres (2,)."""
        seen = self._seen
        _, there, begin, end = self._common(np.array([row]), np.array([0]))
        own = np.flatnonzero(self._row[there] == other)
        longest = own[int(np.argmax((end - begin)[own]))]
        boundary, surface = seen.boundary, seen.surface[there[longest]]
        metres = (begin[longest] + end[longest]) / 2
        metres -= boundary.around[surface] * (metres >= boundary.around[surface])
        own_faces = np.flatnonzero(boundary.surface == surface)
        face = own_faces[np.searchsorted(boundary.along[own_faces], metres, side="right") - 1]
        a, b = boundary.a[face], boundary.b[face]
        middle: FloatArray = a + (b - a) / np.hypot(*(b - a)) * (metres - boundary.along[face])
        return middle

    def normal_matrix(self, row: int, other: int) -> FloatArray:
        """N of a pair about the local origin (3, 3), without the lever."""
        found: FloatArray = self.normal_matrices([(row, other)])[0]
        return found

    def normal_matrices(self, pairs: Sequence[tuple[int, int]]) -> FloatArray:
        """N of different pairs of rows about the local origin (n, 3, 3), without the lever."""
        key = np.array([row * self.rows + other for row, other in pairs], dtype=np.int64)
        order, rows = np.argsort(key), np.unique(key // max(1, self.rows))
        mine, there, begin, end = self._common(rows, np.zeros(len(rows), np.int64))
        of = self._row[mine] * self.rows + self._row[there]
        place = np.searchsorted(key, of, sorter=order)
        asked = np.flatnonzero(np.isin(of, key))
        there, index = there[asked], order[place[asked]]
        begin, end = begin[asked] + EDGE_M, end[asked] - EDGE_M
        return self._moments(self._seen.surface[there], begin, end, index, len(key))

    def weakest_move(self, row: int, other: int) -> FloatArray:
        """Small move (x, y, rotation times LEVER_M) of a row that a pair resists least, unit length (3,)."""
        shift = _about(self._seen.xy[[row]])[0]
        _, axes = np.linalg.eigh(shift @ self.normal_matrix(row, other) @ shift.T)
        move: FloatArray = axes[:, 0]
        return move

    def _common(self, rows: IntArray, first: IntArray) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """Stretches that rows (n,) and others both see: stretches of both (m,) (m,), begin, end.

        The others of each row are those from `first` on (n,).
        """
        seen = self._seen
        many = seen.pointer[rows + 1] - seen.pointer[rows]
        own = ranges(seen.pointer[rows], many)
        begin = np.searchsorted(self._place, seen.surface[own] * self.rows + np.repeat(first, many))
        counts = np.searchsorted(self._place, (seen.surface[own] + 1) * self.rows) - begin
        there, mine = self._order[ranges(begin, counts)], np.repeat(own, counts)
        mine, there, ahead = _with_laps(seen, mine, there)
        low = np.maximum(seen.begin[mine], seen.begin[there] + ahead)
        high = np.minimum(seen.end[mine], seen.end[there] + ahead)
        both = (high - low > WIDER_M) & (self._row[there] != self._row[mine])
        return mine[both], there[both], low[both], high[both]

    def _pairs(self, rows: IntArray, first: IntArray, *, least_m: float = 0.0) -> Pairs:
        seen = self._seen
        mine, there, begin, end = self._common(rows, first)
        both, index = np.unique(self._row[mine] * self.rows + self._row[there], return_inverse=True)
        common = np.bincount(index, end - begin, len(both))
        enough = np.round(common, DIGITS) >= least_m
        kept, common = enough[index], common[enough]
        there, begin, end, index = there[kept], begin[kept], end[kept], (np.cumsum(enough) - 1)[index[kept]]
        row, other = np.divmod(both[enough], max(1, self.rows))
        moments = self._moments(seen.surface[there], begin + EDGE_M, end - EDGE_M, index, len(common))
        least = np.minimum(self.shown_m[row], self.shown_m[other])
        hold = np.minimum(_least_hold(moments, seen.xy[row]), _least_hold(moments, seen.xy[other]))
        share = common / np.maximum(least, 1e-12)
        return Pairs(row, other, *(np.round(figure, DIGITS) for figure in (common, share, hold)))

    def _moments(
        self, surface: IntArray, begin: FloatArray, end: FloatArray, index: IntArray, many: int
    ) -> FloatArray:
        """N about the local origin (many, 3, 3), the sum over each pair's stretches, without the lever."""
        entries = moments_of(self._seen.boundary, surface, begin, end)
        found = np.zeros((many, 3, 3))
        for (i, j), entry in zip(ENTRIES, entries, strict=True):
            found[:, i, j] = found[:, j, i] = np.bincount(index, entry, many)
        return found


def _sums_before(
    boundary: Boundary, first: IntArray, begin: FloatArray, end: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Normal matrices before both ends of stretches by surfaces, and of closed surfaces, for the kernel."""
    normal, arm = boundary.normals
    faces, along = np.append(boundary.first, len(arm)), np.ascontiguousarray(boundary.along)
    before, sums, around = (np.zeros(6 * size) for size in (len(arm), 2 * len(begin), len(boundary.first)))
    shape = (faces, boundary.around, along, *normal.T.copy(), arm)
    kernel: Callable[..., None] = compiled(sum_up, large=False) or sum_up
    kernel(EDGE_M, first, begin, end, *shape, before, sums, around)
    return sums, around


def _with_laps(seen: ShownBoundary, mine: IntArray, there: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Pairs of stretches of one surface, and by how far the other's are to be moved ahead.

    On a closed surface a stretch has the same place one way around before and after.
    """
    around = seen.boundary.around[seen.surface[mine]]
    closed = np.flatnonzero(around)
    ahead = np.concatenate([np.zeros(len(mine)), around[closed], -around[closed]])
    return np.append(mine, np.tile(mine[closed], 2)), np.append(there, np.tile(there[closed], 2)), ahead


def moments_of(boundary: Boundary, surface: IntArray, begin: FloatArray, end: FloatArray) -> FloatArray:
    """The ENTRIES of N of stretches of surfaces (6, n), about the local origin and without the lever."""
    around = boundary.around[surface]
    beyond = np.flatnonzero((around > 0) & (end > around))  # what lies beyond a closed surface's start
    of = np.append(np.arange(len(surface)), beyond)
    low = np.append(begin, np.maximum(begin - around, 0.0)[beyond])
    high = np.append(np.where(around > 0, np.minimum(end, around), end), (end - around)[beyond])
    part, face, low, high = _on_faces(boundary, surface[of], low, high)
    entries = _face_moments(boundary, face, low, high)
    found: FloatArray = np.stack(
        [np.bincount(of[part], entry, len(surface)).astype(float) for entry in entries]
    )
    return found


def _on_faces(
    boundary: Boundary, surface: IntArray, begin: FloatArray, end: FloatArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Number of the stretch (n,), face, begin and end of what lies on each face, from the face's start."""
    counts = np.diff(np.append(boundary.first, len(boundary.a)))[surface]
    face = ranges(boundary.first[surface], counts)
    of = np.repeat(np.arange(len(surface)), counts)
    low, high = begin[of] - boundary.along[face], end[of] - boundary.along[face]
    inner = np.diff(of) == 0  # a surface ends where its stretches say
    low[1:][inner] = np.maximum(low[1:][inner], 0.0)
    high[:-1][inner] = np.minimum(high[:-1][inner], boundary.length[face[:-1][inner]])
    some = np.flatnonzero(high > low)
    return of[some], face[some], low[some], high[some]


def _face_moments(boundary: Boundary, face: IntArray, begin: FloatArray, end: FloatArray) -> list[FloatArray]:
    """The ENTRIES of stretches of faces, each (n,)."""
    normals, arms = boundary.normals
    normal, arm = normals[face], arms[face]
    s1, s2, s3 = ((end**k - begin**k) / k for k in (1, 2, 3))
    turn = arm * s1 + s2
    return [
        normal[:, 0] ** 2 * s1,
        normal[:, 0] * normal[:, 1] * s1,
        normal[:, 1] ** 2 * s1,
        normal[:, 0] * turn,
        normal[:, 1] * turn,
        arm * arm * s1 + 2 * arm * s2 + s3,
    ]


def _least_hold(moments: FloatArray, at: FloatArray) -> FloatArray:
    """Least eigenvalue of each normal matrix about its own point (n, 2), rotations scaled by LEVER_M."""
    shift = _about(at)
    about = shift @ moments @ shift.transpose(0, 2, 1)
    return np.maximum(np.linalg.eigvalsh(about)[:, 0], 0.0) if len(at) else np.empty(0)


def _about(at: FloatArray) -> FloatArray:
    """Matrices (n, 3, 3) that turn a normal matrix about the origin into one about each point (n, 2)."""
    shift = np.repeat(np.eye(3)[None], len(at), axis=0)
    shift[:, 2, 0], shift[:, 2, 1] = at[:, 1], -at[:, 0]  # (p - at) × n = p × n - at × n
    shift[:, 2] /= LEVER_M
    return shift
