"""Route -> figures: what the stops see of every room and kind, what is left out, and what is doubtful."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mission.figures import Figures, Share, worst_first
from mission.floor import Finding, Rank
from mission.geometry import BoolArray, FloatArray
from mission.planning import Candidates, Route, Selection, weights_of
from mission.seen import seen_units
from planner.appraisal.plausible import doubts_of, near_legs
from planner.appraisal.unreached import unreached
from planner.shapes import local_origin, to_shape
from planner.space.reach import reach_of


def figures_of(route: Route, *, planned: frozenset[int] | None = None) -> Figures:
    """What a plan amounts to; `planned` are the parts of the floor that some plan of it enters."""
    selection = route.selection
    candidates = selection.visibility.candidates
    space, settings = candidates.space, candidates.space.settings
    parts = planned or frozenset([candidates.chosen_part])
    left_out = unreached(candidates, parts)
    reached = _reached_m2(candidates, parts)
    findings = (*space.findings, *doubts_of(route, reached_m2=reached))
    whole, rooms, kinds = shares_of(selection, why={item.room: item.why for item in left_out})
    return Figures(
        rule=settings.coverage_rule,
        whole=whole,
        rooms=rooms,
        kinds=kinds,
        rooms_m2=sum(polygon.area for room in space.rooms for polygon in room.area),
        reached_m2=reached,
        unreached=left_out,
        findings=ranked(findings, near_legs(findings, route)),
    )


def shares_of(
    selection: Selection, *, why: Mapping[str, str] | None = None
) -> tuple[Share, tuple[Share, ...], tuple[Share, ...]]:
    """What the stops see of the whole, of every room and of every kind, the least seen first."""
    space = selection.visibility.candidates.space
    settings, ledger = space.settings, _Ledger(selection)
    kinds = [
        ledger.share(kind, ledger.of_kind(kind), required=settings.least_of_kind) for kind in ledger.kinds
    ]
    whole = ledger.share("all", ledger.everything, required=settings.coverage)
    return whole, _rooms(ledger, selection, why or {}), worst_first(kinds)


def ranked(findings: tuple[Finding, ...], near: set[int]) -> tuple[Finding, ...]:
    """Findings that bear on the plan most first: those beside a leg, then by rank, then as they were.

    `near` are the places in `findings` of those beside a leg; notes are never among them.
    """

    def key(k: int) -> tuple[bool, int]:
        return (k not in near or findings[k].rank == Rank.NOTE, findings[k].rank)

    return tuple(findings[k] for k in sorted(range(len(findings)), key=key))


def _rooms(ledger: _Ledger, selection: Selection, why: Mapping[str, str]) -> tuple[Share, ...]:
    """Rooms with targets, then what faces none of them."""
    space = selection.visibility.candidates.space
    settings = space.settings
    asked = settings.least_of_room
    shares = [
        ledger.share(room.name, space.unit_room == k, required=asked, why=why.get(room.name, ""))
        for k, room in enumerate(space.rooms)
    ]
    outside = ledger.share("in no room", space.unit_room < 0)
    return tuple(share for share in (*worst_first(shares), outside) if share.total)


class _Ledger:
    """Weights of units, in metres or units, to be summed over any of them."""

    def __init__(self, selection: Selection) -> None:
        space = selection.visibility.candidates.space
        targets = space.targets
        scale = 1.0 if space.settings.coverage_rule == "paper" else 1e-6
        self._weight: FloatArray = np.asarray(weights_of(targets, space.settings) * scale, dtype=np.float64)
        self._visible: BoolArray = selection.visibility.visible
        self._seen: BoolArray = seen_units(selection)
        kind = np.array([item.kind for item in space.floor.elements])
        self._kind = kind[targets.element][targets.unit_segment]
        self.everything = np.ones(targets.total, dtype=bool)

    @property
    def kinds(self) -> list[str]:
        return sorted(set(self._kind.tolist()))

    def of_kind(self, kind: str) -> BoolArray:
        found: BoolArray = self._kind == kind
        return found

    def share(self, name: str, member: BoolArray, *, required: float | None = None, why: str = "") -> Share:
        """The share of a mask of units (n,)."""
        masks = (member, member & self._visible, member & self._seen)
        total, visible, seen = (float(self._weight[mask].sum()) for mask in masks)
        return Share(name, total, visible, seen, required=required, why=why)


def _reached_m2(candidates: Candidates, parts: frozenset[int]) -> float:
    """Area of rooms, each by the share of where the robot may drive in it that belongs to these parts."""
    space = candidates.space
    origin = local_origin(space.floor)
    found = reach_of(space).parts
    reached = 0.0
    for room in space.rooms:
        shape = to_shape(room.area, origin)
        areas = found.area_by_part(shape)
        free = sum(areas.values())
        if free > 0:
            reached += shape.area * sum(areas.get(part, 0.0) for part in parts) / free
    return reached
