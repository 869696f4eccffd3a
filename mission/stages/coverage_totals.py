"""Weights and groups of all target units: coverage of the whole, of rooms and of kinds, from seen units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.stages import NavigableSpace, Visibility, weights_of
from stopgo.mission.stages.figures import CoverageByGroup, GroupCoverage, worst_first

OUTSIDE = "in no room"
"""Name of the units that face no room."""


@dataclass(frozen=True)
class Group:
    """Units with a common required coverage."""

    name: str
    required: float | None = None
    """Least fraction of all visible; None if nothing is required."""
    why: str = ""
    """Reason why the robot does not reach it."""


@dataclass(frozen=True)
class Seen:
    """An element with targets."""

    id: str
    kind: str


@dataclass(frozen=True, eq=False)
class CoverageTotals:
    """The units of a plan, n of them, in the order of its targets."""

    rule: Literal["length", "paper"]
    """`length`: fractions of metres. `paper`: fractions of units."""
    weight: IntArray
    """Weight of each unit (n,), micrometres or 1."""
    visible: BoolArray
    """True for units that any candidate sees (n,)."""
    room: IntArray
    """Index into `rooms` (n,); -1 where it faces none."""
    element: IntArray
    """Index into `elements` (n,)."""
    rooms: tuple[Group, ...]
    elements: tuple[Seen, ...]
    required: float | None
    """Least fraction of the whole; None if nothing is required."""
    kind_required: float | None
    """Least fraction of each kind."""
    asked: IntArray = field(default_factory=lambda: frozen([1], np.int64))
    """Number of stops that must see each unit until it counts (n,), or every unit (1,)."""

    @property
    def without_requirements(self) -> CoverageTotals:
        """The same, with nothing required: for a mission that covers a floor together with others."""
        rooms = tuple(replace(room, required=None) for room in self.rooms)
        return replace(self, required=None, kind_required=None, rooms=rooms)

    def of_part(self, units: BoolArray) -> CoverageTotals:
        """Return the same requirements for a part of the units (n,)."""
        return replace(self, visible=frozen(self.visible & units, np.bool_))

    def enough(self, views: IntArray) -> BoolArray:
        """Return True for units that count as seen, for these numbers of views (n,)."""
        return frozen(views >= self.asked, np.bool_)

    def brings(self, views: IntArray, more: IntArray) -> float:
        """Return the gain of more views (n,) after others (n,), as a fraction of all visible."""
        visible = self.amount(self.visible)
        gained = self.enough(views + more) & ~self.enough(views) & self.visible
        return self.amount(gained) / visible if visible else 0.0

    def coverage(self, seen: BoolArray) -> CoverageByGroup:
        """Return the coverage of a mask of units (n,); rooms and kinds with targets, least seen first."""
        *rooms, outside = self.rooms_seen(seen)
        listed = (*worst_first(rooms), outside)
        return CoverageByGroup(
            self.coverage_of(Group("all", self.required), np.ones(len(self.weight), dtype=bool), seen),
            tuple(group for group in listed if group.total),
            worst_first([group for group in self.kinds_seen(seen) if group.total]),
        )

    def rooms_seen(self, seen: BoolArray) -> tuple[GroupCoverage, ...]:
        """Return the coverage of every room, in order, and last of the units that face none."""
        groups = (*self.rooms, Group(OUTSIDE))
        of_group = np.where(self.room < 0, len(self.rooms), self.room)
        return tuple(
            GroupCoverage(group.name, total, could, did, required=group.required, why=group.why)
            for group, (total, could, did) in zip(
                groups, self._sums(of_group, len(groups), seen).tolist(), strict=True
            )
        )

    def kinds_seen(self, seen: BoolArray) -> tuple[GroupCoverage, ...]:
        """Return the coverage of every kind of element, by name."""
        return tuple(
            self.coverage_of(Group(kind, self.kind_required), self._kind == k, seen)
            for k, kind in enumerate(self._kinds)
        )

    def by_element(self, seen: BoolArray) -> tuple[GroupCoverage, ...]:
        """Return the coverage of every element with targets, in the floor's order."""
        sums = self._sums(self.element, len(self.elements), seen).tolist()
        return tuple(
            GroupCoverage(item.id, total=total, visible=could, seen=did)
            for item, (total, could, did) in zip(self.elements, sums, strict=True)
            if total
        )

    def coverage_of(self, group: Group, member: BoolArray, seen: BoolArray) -> GroupCoverage:
        """Return the coverage of a mask of units (n,)."""
        visible = member & self.visible
        total, could, did = (self.amount(mask) for mask in (member, visible, visible & seen))
        return GroupCoverage(group.name, total, could, did, required=group.required, why=group.why)

    def amount(self, units: BoolArray) -> float:
        """Return the amount of a mask of units (n,), in metres or units."""
        return float(int(self.weight[units].sum()) * self.scale)

    @property
    def scale(self) -> float:
        """Metres, or units, of a weight of 1."""
        return 1.0 if self.rule == "paper" else 1e-6

    def _sums(self, group: IntArray, many: int, seen: BoolArray) -> FloatArray:
        """Amount of all, of the visible and of the seen units (n,) in each of so many groups (many, 3)."""
        masks = (None, self.visible, self.visible & seen)
        sums = [np.bincount(group, self._counted(mask), minlength=many) for mask in masks]
        return np.asarray(np.stack(sums, axis=1) * self.scale, dtype=np.float64)

    def _counted(self, mask: BoolArray | None) -> FloatArray:
        return np.asarray(self.weight if mask is None else np.where(mask, self.weight, 0), dtype=np.float64)

    @cached_property
    def _kinds(self) -> list[str]:
        return sorted({item.kind for item in self.elements})

    @cached_property
    def _kind(self) -> IntArray:
        """Index of each unit's kind (n,)."""
        of_element = np.array([self._kinds.index(item.kind) for item in self.elements], dtype=np.int64)
        return frozen(of_element[self.element], np.int64)


def totals_of_plan(visibility: Visibility, why: Mapping[str, str] | None = None) -> CoverageTotals:
    """Return the totals of a plan; `why` has the reason by room where the robot does not go."""
    return totals_of(visibility.space, visibility.visible, visibility.asked, why)


def totals_of(
    space: NavigableSpace, visible: BoolArray, asked: IntArray, why: Mapping[str, str] | None = None
) -> CoverageTotals:
    """Return the totals of a space, from the visible units (n,) and the required views of each (n,)."""
    targets, settings, reasons = space.targets, space.settings, why or {}
    least = settings.least_of_room
    return CoverageTotals(
        rule=settings.coverage_rule,
        weight=weights_of(targets, settings),
        visible=visible,
        room=space.unit_room,
        element=frozen(targets.element[targets.unit_segment], np.int64),
        rooms=tuple(Group(room.name, least, reasons.get(room.name, "")) for room in space.rooms),
        elements=tuple(Seen(item.id, item.kind) for item in space.floor.elements),
        required=settings.coverage,
        kind_required=settings.least_of_kind,
        asked=asked,
    )
