"""What a selection must see: a share of the whole, and of every room and every kind of element."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.stages import Visibility, weights_of


@dataclass(frozen=True, eq=False)
class Demands:
    """Shares of what is visible; demand 0 is of the whole."""

    weight: IntArray
    """What each unit counts (units,); 0 where no candidate sees it."""
    member: IntArray
    """(memberships, units): demands that each unit belongs to, -1 for none."""
    share: FloatArray
    """Least share of each demand (demands,)."""

    def needed(self, visible: IntArray) -> IntArray:
        """Least weights that are the shares of these weights (demands,)."""
        return needed_of(visible, self.share)


def demands_of(visibility: Visibility) -> Demands:
    """The shares asked for in the settings.

    The paper asks for a share of all units together and for nothing else; by length, every room and
    every kind has a least share of its own.
    """
    space = visibility.candidates.space
    settings, targets = space.settings, visibility.targets
    weight = np.where(visibility.visible, weights_of(targets, settings), 0)
    whole = np.zeros(targets.total, dtype=np.int64)
    room_share, kind_share = settings.least_of_room, settings.least_of_kind
    if room_share is None or kind_share is None:
        return Demands(frozen(weight, np.int64), whole[None, :], frozen([settings.coverage]))
    kinds = sorted({item.kind for item in space.floor.elements})
    kind_of = np.array([kinds.index(item.kind) for item in space.floor.elements], dtype=np.int64)
    rooms = len(space.rooms)
    kind = 1 + rooms + kind_of[targets.element[targets.unit_segment]]
    room = np.where(space.unit_room >= 0, 1 + space.unit_room, -1)
    share = [settings.coverage, *[room_share] * rooms, *[kind_share] * len(kinds)]
    return Demands(frozen(weight, np.int64), np.stack([whole, room, kind]), frozen(share))


def needed_of(visible: IntArray, share: FloatArray | float) -> IntArray:
    """Least whole numbers that are at least `share` of these."""
    return np.ceil(np.asarray(share) * visible - 1e-9 * np.maximum(1, visible)).astype(np.int64)
