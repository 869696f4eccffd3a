"""Proposed scan positions, before the check of their reachability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from shapely.geometry.base import BaseGeometry

from stopgo.mission.document.specs import DECIMALS
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import KEPT


@dataclass(frozen=True, eq=False)
class Proposals:
    """Positions (n, 2) in the drawing's metres, each with its room, reason and kind."""

    xy: FloatArray
    """Rounded as in a mission, so that a decision on a position is true of the stop there."""
    room: IntArray
    reason: IntArray
    doorway: BoolArray
    must: BoolArray
    """True for positions where a stop is required."""

    @classmethod
    def of(
        cls,
        xy: Sequence[FloatArray] | FloatArray,
        room: Sequence[int] | IntArray,
        reason: Sequence[int] | IntArray | None = None,
        *,
        doorway: bool = False,
        must: bool = False,
    ) -> Proposals:
        """Proposals of one kind; without reasons all are kept."""
        rooms = np.asarray(room, dtype=np.int64)
        n = len(rooms)
        return cls(
            xy=np.round(np.asarray(xy, dtype=np.float64).reshape(-1, 2), DECIMALS),
            room=rooms,
            reason=np.full(n, KEPT) if reason is None else np.asarray(reason, dtype=np.int64),
            doorway=np.full(n, doorway),
            must=np.full(n, must),
        )


def joined(proposals: Sequence[Proposals]) -> Proposals:
    """All proposals in one, in their order."""
    return Proposals(
        xy=np.concatenate([item.xy for item in proposals]),
        room=np.concatenate([item.room for item in proposals]),
        reason=np.concatenate([item.reason for item in proposals]),
        doorway=np.concatenate([item.doorway for item in proposals]),
        must=np.concatenate([item.must for item in proposals]),
    )


def in_order(proposals: Proposals, rooms: Sequence[BaseGeometry]) -> Proposals:
    """The proposals from left to right, so that ties are broken alike however the rooms are ordered."""
    x, y = proposals.xy.T
    middles = np.round([[room.centroid.x, room.centroid.y] for room in rooms], 6)
    rank = np.argsort(np.lexsort(middles.T[::-1]), kind="stable")
    order = np.lexsort((rank[proposals.room], proposals.doorway, y, x))
    return Proposals(**{name: values[order] for name, values in vars(proposals).items()})
