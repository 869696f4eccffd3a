"""Time graph: straight pieces of paths with least times, of which every leg is made.

A robot stops at each bend, and turns there. Each piece counts from rest to rest, with a part of the turns at
both ends. A node has a direction. A piece that leaves it in this direction counts a quarter turn, one in the
opposite direction as much less than nothing. So two pieces that continue each other count none together, and
any two no more than the turn from one into the other. If the direction is between them, they count exactly
that turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from scipy.sparse import coo_array, csr_array

from stopgo.mission.document import RobotSpec
from stopgo.mission.document.straight_times import straight_times
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.geometry.shapes import SLACK
from stopgo.planner.routing.assemble import ROUNDING_M, ROUNDING_RAD
from stopgo.planner.routing.path_trees import path_trees
from stopgo.planner.routing.roadmap import graph_of, outward_corners

ROUNDS = 40
"""Rounds in which parts of turns are lowered where a piece took less than no time."""
LOWER = 0.8
"""Factor of a node's parts in each of them."""
ALIGNED_RAD = 2e-3
"""Largest angle between pieces, none of them tiny, that may be driven as one."""
TINY_M = 2e-3
NO_LENGTH_S = 1e-9
"""Seconds that stand for none, which the sparse solver would ignore."""
FARTHEST_S = 80.0
"""Seconds up to which ways between far nodes are found."""
BLOCK = 128
"""Nodes from which ways are found at a time."""
MOST_POINTS = 1500
"""Points up to which there is a straight line between any two."""
STRAIGHT = 0.05
"""Length of the sum of two unit vectors that are opposite."""


@dataclass(frozen=True, eq=False)
class TimeGraph:
    """Pieces of paths between nodes, with lower bounds on their times."""

    xy: FloatArray
    """Positions of the nodes (nodes, 2)."""
    edges: IntArray
    """(m, 2)."""
    seconds: FloatArray
    """Not negative (m,)."""
    angles: FloatArray
    """Heading in radians in which each piece leaves its ends; NaN for none (m, 2)."""
    half_turn_s: float

    @property
    def nodes(self) -> int:
        return len(self.xy)

    @cached_property
    def _arcs(self) -> tuple[csr_array, IntArray]:
        """The pieces in both directions, and the index of the piece of each entry."""
        ends = np.concatenate([self.edges, self.edges[:, ::-1]])
        count = len(self.edges)
        numbers = np.concatenate([np.arange(count), np.arange(count)]) + 1.0
        arcs = coo_array((numbers, tuple(ends.T)), shape=(self.nodes,) * 2).tocsr()
        return arcs, arcs.data.astype(np.int64) - 1

    def times(self, more: FloatArray, sets: Sequence[IntArray]) -> csr_array:
        """Seconds of pieces and half of `more` at both ends; and a node after the others for each set (n, n).

        From the node of a set the nodes of the set are reached in no time.
        """
        arcs, piece = self._arcs
        driven = self.seconds + more[self.edges].sum(axis=1) / 2
        sizes = np.array([len(nodes) for nodes in sets], dtype=np.int64)
        seconds = np.concatenate([driven[piece], np.zeros(sizes.sum())])
        ends = np.concatenate([arcs.indices, *sets]).astype(np.int32)
        first = np.concatenate([arcs.indptr, arcs.nnz + np.cumsum(sizes)]).astype(np.int32)
        return csr_array((np.maximum(seconds, NO_LENGTH_S), ends, first), shape=(len(first) - 1,) * 2)

    def directions_along(self, line: Sequence[int], points: int) -> FloatArray:
        """Heading in the middle of the ways to the nodes before and after the nearest of a line (points,).

        NaN where that node has only one neighbour, where both ways leave in opposite directions, and where
        two points are in the same place.
        """
        if not len(line) or not np.isfinite(self.xy).all():
            return np.full(points, np.nan)
        at = np.array(line, dtype=np.int64)
        point, nearest = shapely.STRtree(shapely.points(self.xy[at])).query_nearest(
            shapely.points(self.xy[:points])
        )
        own = np.full(points, len(at))
        np.minimum.at(own, point, nearest)
        away, ways = np.zeros((points, 2)), np.zeros(points, dtype=np.int64)
        times = self.times(np.zeros(self.nodes), [])
        for k in range(0, len(at), BLOCK):
            found = path_trees(times, at[k : k + BLOCK], limit=FARTHEST_S)[1]
            for there, before in enumerate(found, k):
                near = np.flatnonzero((np.abs(own - there) == 1) & (before[:points] >= 0))
                step = self.xy[before[near]] - self.xy[near]
                away[near] += step / np.maximum(np.hypot(*step.T), TINY_M)[:, None]
                ways[near] += 1
        _, place, times_there = np.unique(self.xy, axis=0, return_inverse=True, return_counts=True)
        alone = times_there[place[:points]] == 1
        turned = alone & (ways == 2) & (np.hypot(*away.T) > STRAIGHT)
        return np.where(turned, np.arctan2(away[:, 1], away[:, 0]), np.nan)

    def with_turns(self, direction: FloatArray) -> TimeGraph:
        """The graph with parts of the turns at nodes by their directions (nodes,), NaN for none."""
        away = np.abs(np.remainder(self.angles - direction[self.edges] + np.pi, 2 * np.pi) - np.pi)
        share = np.nan_to_num(self.half_turn_s / 2 * (1 - 2 * away / np.pi))
        scale = np.ones(self.nodes)
        for _ in range(ROUNDS):
            shares = share * scale[self.edges]
            seconds = self.seconds + shares.sum(axis=1)
            short = np.flatnonzero(seconds < 0)
            if not len(short):
                return replace(self, seconds=seconds)
            ends = self.edges[short, np.argmin(shares[short], axis=1)]
            scale[np.unique(ends)] *= LOWER
        return self


def time_graph(space: NavigableSpace, points: FloatArray, robot: RobotSpec) -> TimeGraph:
    """The graph of shortest paths between points (n, 2) of the drive area; its first nodes are the points."""
    xy, pieces = graph_of(space, points)
    low, high = pieces.min(axis=1), pieces.max(axis=1)
    key = np.unique(low[low < high] * len(xy) + high[low < high])
    edges = np.stack([key // len(xy), key % len(xy)], axis=1)
    step = xy[edges[:, 1]] - xy[edges[:, 0]]
    lengths, heading = np.hypot(*step.T), np.arctan2(step[:, 1], step[:, 0])
    angles = np.where(lengths[:, None] > 0, np.stack([heading, heading + np.pi], axis=1), np.nan)
    corners = outward_corners(space)
    last = len(points) + len(corners.xy)
    graph = TimeGraph(xy, edges, lengths, angles, math.pi / robot.turn_rate)
    joined = _may_be_joined(graph, len(points), key)
    least = np.maximum(lengths - ROUNDING_M, 0.0)
    driven = straight_times(least, speed=robot.speed, acceleration=robot.acceleration)
    rounding = 2 * ROUNDING_RAD / robot.turn_rate
    seconds = np.maximum(0.0, np.where(joined, least / robot.speed, driven) - rounding)
    direction = np.full(len(xy), np.nan)
    direction[len(points) : last] = between(corners.sides[:, 0], corners.sides[:, 1])
    return replace(graph, seconds=seconds).with_turns(direction)


def straight_graph(points: FloatArray, robot: RobotSpec) -> TimeGraph:
    """The graph of straight lines between points (n, 2): no path takes less, whichever graph it is of.

    Of very many points each is reached by way of one more node, in no time.
    """
    count = len(points)
    if count <= MOST_POINTS:
        edges = np.stack(np.triu_indices(count, 1), axis=1)
        metres = np.hypot(*(points[edges[:, 0]] - points[edges[:, 1]]).T)
    else:
        edges, metres = np.stack([np.arange(count), np.full(count, count)], axis=1), np.zeros(count)
    least = np.maximum(metres - 2 * ROUNDING_M, 0.0)  # once more for ends that a third-party path misses
    seconds = straight_times(least, speed=robot.speed, acceleration=robot.acceleration)
    nowhere = np.full((count + 1, 2), np.nan)
    return TimeGraph(nowhere, edges, seconds, np.full(edges.shape, np.nan), 0.0)


def between(a: FloatArray, b: FloatArray) -> FloatArray:
    """The heading in the middle between vectors (n, 2), the short way round; NaN if there is none (n,)."""
    one, other = (vectors / np.maximum(np.hypot(*vectors.T), 1e-12)[:, None] for vectors in (a, b))
    middle = one + other
    found: FloatArray = np.where(np.hypot(*middle.T) > SLACK, np.arctan2(middle[:, 1], middle[:, 0]), np.nan)
    return found


def _may_be_joined(metres: TimeGraph, points: int, key: IntArray) -> BoolArray:
    """True for pieces (m,) that may be driven as one with another, where no third piece is both in one.

    `metres` has lengths instead of times; `key` is that of each piece by its ends, ascending (m,).
    """
    found = np.zeros(len(key), dtype=bool)
    for a, b, ends in _straight_on(metres, points):
        missing = key[np.minimum(np.searchsorted(key, ends), len(key) - 1)] != ends
        found[a[missing]] = found[b[missing]] = True
    is_next = np.zeros(metres.nodes, dtype=bool)
    is_next[metres.edges[metres.seconds < TINY_M]] = True
    is_next[:points] = False
    return found | is_next[metres.edges].any(axis=1)


def _straight_on(metres: TimeGraph, points: int) -> Iterator[tuple[IntArray, IntArray, IntArray]]:
    """Pairs of pieces that continue each other at a node that is no point, and the key of both other ends."""
    edges, lengths = metres.edges, metres.seconds
    node, other = edges.T.ravel(), edges[:, ::-1].T.ravel()
    piece = np.tile(np.arange(len(edges)), 2)
    angle = np.remainder(metres.angles.T.ravel(), 2 * np.pi)
    at = np.flatnonzero((node >= points) & np.isfinite(angle))
    at = at[np.argsort(4 * np.pi * node[at] + angle[at], kind="stable")]
    place = 4 * np.pi * node[at] + angle[at]
    opposite = 4 * np.pi * node[at] + np.remainder(angle[at] + np.pi, 2 * np.pi)
    for round_ in (-2 * np.pi, 0.0, 2 * np.pi):
        first = np.searchsorted(place, opposite + round_ - ALIGNED_RAD)
        many = np.searchsorted(place, opposite + round_ + ALIGNED_RAD) - first
        a, b = np.repeat(at, many), at[ranges(first, many)]
        turn = np.abs(np.remainder(angle[a] - angle[b], 2 * np.pi) - np.pi)
        is_straight = turn * np.minimum(lengths[piece[a]], lengths[piece[b]]) <= 2 * SLACK
        is_straight &= node[a] == node[b]
        a, b = a[is_straight], b[is_straight]
        ends = np.minimum(other[a], other[b]) * metres.nodes + np.maximum(other[a], other[b])
        yield piece[a], piece[b], ends
