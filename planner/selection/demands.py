"""Coverage demands: required fractions of the whole, of every room and of every kind of element."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.stages import Visibility, weights_of


@dataclass(frozen=True, eq=False)
class Demands:
    """Required fractions of what is visible; demand 0 is of the whole."""

    weight: IntArray
    """Weight of each unit (units,); 0 where no candidate sees it."""
    member: IntArray
    """(memberships, units): demands that each unit belongs to, -1 for none."""
    fraction: FloatArray
    """Required fraction of each demand (demands,)."""

    def needed(self, visible: IntArray) -> IntArray:
        """Least weights that meet the required fractions of these weights (demands,)."""
        return needed_of(visible, self.fraction)


def demands_of(visibility: Visibility) -> Demands:
    """The required fractions of the settings.

    The paper requires a fraction of all units together and nothing else. By length, every room and
    every kind has its own required fraction.
    """
    space = visibility.space
    settings, targets = space.settings, visibility.targets
    weight = np.where(visibility.visible, weights_of(targets, settings), 0)
    whole = np.zeros(targets.total, dtype=np.int64)
    room_fraction, kind_fraction = settings.least_of_room, settings.least_of_kind
    if room_fraction is None or kind_fraction is None:
        return Demands(frozen(weight, np.int64), whole[None, :], frozen([settings.coverage]))
    kinds = sorted({item.kind for item in space.floor.elements})
    kind_of = np.array([kinds.index(item.kind) for item in space.floor.elements], dtype=np.int64)
    rooms = len(space.rooms)
    kind = 1 + rooms + kind_of[targets.element[targets.unit_segment]]
    room = np.where(space.unit_room >= 0, 1 + space.unit_room, -1)
    fraction = [settings.coverage, *[room_fraction] * rooms, *[kind_fraction] * len(kinds)]
    return Demands(frozen(weight, np.int64), np.stack([whole, room, kind]), frozen(fraction))


def needed_of(visible: IntArray, fraction: FloatArray | float) -> IntArray:
    """Least whole numbers that are at least the fraction `fraction` of these."""
    return np.ceil(np.asarray(fraction) * visible - 1e-9 * np.maximum(1, visible)).astype(np.int64)
