"""Pieces of a selection that do not hang together -> what every selection that does must have."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.selection.cover import Cover


def pieces_of(links: csr_array, rows: IntArray) -> list[IntArray]:
    """The rows, parted where no link joins them; the largest piece first, then by the lowest row."""
    rows = np.unique(rows).astype(np.int64)
    if not len(rows):
        return []
    count, label = connected_components(links[rows][:, rows], directed=False)
    found = [rows[label == k] for k in range(count)]
    return sorted(found, key=lambda piece: (-len(piece), int(piece[0])))


def grounds_of(cover: Cover, pieces: list[IntArray]) -> list[IntArray]:
    """Of pieces of all that is offered, as many as meet every demand: the smallest that can go, go first."""
    kept = list(pieces)
    for piece in reversed(pieces):
        rest = [other for other in kept if other is not piece]
        if rest and meets(cover, np.concatenate(rest)):
            kept = rest
    return kept


@dataclass(frozen=True, eq=False)
class NodeSeparator:
    """Rows of a ground that part it in two: a way from one side to the other leads over them."""

    between: IntArray
    here: IntArray
    beyond: IntArray
    elsewhere: IntArray
    """All rows of other grounds."""

    def enough(self, cover: Cover) -> tuple[bool, bool]:
        """Whether each side by itself, with all other grounds, meets every demand."""
        here, beyond = (np.concatenate([side, self.elsewhere]) for side in (self.here, self.beyond))
        return meets(cover, here), meets(cover, beyond)


def separators(cover: Cover, links: csr_array, grounds: list[IntArray], rows: IntArray) -> Iterator[IntArray]:
    """Sets of rows (n,), each of which every selection that hangs together on each ground has a row of.

    What parts a piece of a ground from other pieces of it is such a set where neither side, with all other
    grounds, meets every demand by itself.
    """
    for parting, _, _ in _partings(links, grounds, rows):
        if not any(parting.enough(cover)):
            yield parting.between


@dataclass(eq=False)
class Conditions:
    """Rows of a linear programme that only hold where some row is chosen: `matrix` x >= `least`."""

    columns: int

    def __post_init__(self) -> None:
        self._known: dict[tuple[bytes, tuple[int, ...]], None] = {}

    def take(self, found: Iterable[tuple[IntArray, tuple[int, ...]]]) -> bool:
        """Add conditions: of a set of rows one is chosen if all of some others are; whether any is new."""
        before = len(self._known)
        self._known |= {(between.tobytes(), ends): None for between, ends in found}
        return len(self._known) > before

    @property
    def matrix(self) -> csr_array:
        entries = np.zeros((len(self._known), self.columns))
        for k, (between, ends) in enumerate(self._known):
            entries[k, np.frombuffer(between, np.int64)] = 1.0
            entries[k, list(ends)] = -1.0
        return csr_array(entries)

    @property
    def least(self) -> FloatArray:
        return np.array([1.0 - len(ends) for _, ends in self._known])


def conditions_between(
    cover: Cover, links: csr_array, grounds: list[IntArray], rows: IntArray
) -> Iterator[tuple[IntArray, tuple[int, ...]]]:
    """Where one side would do by itself: whoever chooses a row of the other side must come across.

    A set of rows of which one is chosen if all the rows named with it are.
    """
    for parting, piece, others in _partings(links, grounds, rows):
        here, beyond = parting.enough(cover)
        far = int(np.intersect1d(parting.beyond, others)[0])
        ends = ((int(piece[0]),) if beyond else ()) + ((far,) if here else ())
        yield parting.between, ends


def _partings(
    links: csr_array, grounds: list[IntArray], rows: IntArray
) -> Iterator[tuple[NodeSeparator, IntArray, IntArray]]:
    """What parts each piece of a ground from regions that hold others: with the piece, and those others."""
    for k, ground in enumerate(grounds):
        elsewhere = np.concatenate([np.empty(0, np.int64), *grounds[:k], *grounds[k + 1 :]])
        inner = pieces_of(links, np.intersect1d(rows, ground))
        for piece in inner if len(inner) > 1 else []:
            others = np.setdiff1d(np.concatenate(inner), piece)
            for region in pieces_of(links, np.setdiff1d(ground, neighbours(links, piece))):
                if np.intersect1d(region, others).size:
                    between = neighbours(links, region)
                    here = np.setdiff1d(ground, np.union1d(region, between))
                    yield NodeSeparator(between, here, region, elsewhere), piece, others


def neighbours(links: csr_array, rows: IntArray) -> IntArray:
    """Rows beside these that a link joins to one of them."""
    return np.setdiff1d(links[rows].indices, rows).astype(np.int64)


def meets(cover: Cover, rows: IntArray) -> bool:
    """Whether these rows see all that is asked for."""
    return not cover.missing(cover.covered_by(rows)).any()
