"""Route -> figures: coverage of every room and kind, floor left out, and doubtful points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from stopgo.mission.floor import Finding, Rank
from stopgo.mission.plan import PartPlan
from stopgo.mission.stages import Candidates, Route, Selection, Unreached, Visibility
from stopgo.mission.stages.coverage_totals import totals_of_plan
from stopgo.mission.stages.covered_intervals import seen_units
from stopgo.mission.stages.figures import ACCURACY_NOT_MET, CoverageByGroup, Figures
from stopgo.planner.appraisal.plausibility import floor_doubts, floor_of_rooms, leg_doubts, near_legs
from stopgo.planner.appraisal.quality import (
    FEWER_VIEWS,
    NOT_MET,
    LimitEstimates,
    fewer_views,
    limit_estimates,
    not_met,
    quality_of,
)
from stopgo.planner.appraisal.unreached import unreached
from stopgo.planner.overlap.registered import (
    SCANS_APART,
    UNSEEN_CONTROL,
    inaccurate,
    scans_apart,
    unseen_control,
)
from stopgo.planner.space.reach import room_areas_by_part


@dataclass(frozen=True)
class FiguresBefore:
    """Figures of a plan that come from its visibility alone: no stop and no leg changes them."""

    unreached: tuple[Unreached, ...]
    reached_m2: float
    rooms_m2: float
    doubts: tuple[Finding, ...]
    views: tuple[Finding, ...]
    estimates: LimitEstimates | None

    @classmethod
    def of(
        cls,
        seen: Visibility,
        planned: frozenset[int] | None = None,
        *,
        before: Visibility | None = None,
        known: LimitEstimates | None = None,
    ) -> FiguresBefore:
        """`planned` are the parts of the floor that any plan enters.

        `seen` may be the visibility `before` with more candidates; these do not change what limits cost,
        which may be `known`.
        """
        candidates = seen.candidates
        space, parts = candidates.space, planned or frozenset([candidates.chosen_part])
        reached = _reached_m2(candidates, parts)
        alike = before is not None and before.in_sight is seen.in_sight
        return cls(
            unreached=unreached(candidates, parts),
            reached_m2=reached,
            rooms_m2=sum(floor_of_rooms(space)),
            doubts=floor_doubts(space, reached_m2=reached),
            views=tuple(not_met(seen)),
            estimates=(alike and known) or limit_estimates(before if before and alike else seen),
        )


def figures_of(route: Route, before: FiguresBefore | None = None) -> Figures:
    """Return the figures of a plan; without those `before`, the plan enters one part of the floor."""
    selection = route.selection
    before = before or FiguresBefore.of(selection.visibility)
    doubts = (*leg_doubts(route), *before.doubts, *before.views, *fewer_views(selection))
    findings = (
        *route.space.findings,
        *doubts,
        *scans_apart(route),
        *inaccurate(route),
        *unseen_control(route),
    )
    groups = coverage_by_group(selection, why={item.room: item.why for item in before.unreached})
    return Figures(
        rule=route.space.settings.coverage_rule,
        whole=groups.whole,
        rooms=groups.rooms,
        kinds=groups.kinds,
        rooms_m2=before.rooms_m2,
        reached_m2=before.reached_m2,
        unreached=before.unreached,
        findings=ranked(findings, near_legs(findings, route)),
        quality=quality_of(selection, before.estimates),
    )


OF_ALL_MISSIONS = (NOT_MET, FEWER_VIEWS, UNSEEN_CONTROL, ACCURACY_NOT_MET, *SCANS_APART)
"""Codes of findings about all stops of a plan, whichever mission has them."""


def figures_of_share(route: Route, plan: PartPlan, before: FiguresBefore) -> Figures:
    """Return the figures of one mission of a plan; the required coverage applies to all together."""
    whole, groups = plan.figures, plan.totals.coverage(seen_units(route.selection))
    of_all = (item for item in whole.findings if item.code in OF_ALL_MISSIONS)
    findings = (*route.space.findings, *leg_doubts(route), *before.doubts, *of_all)
    return replace(
        whole,
        whole=replace(groups.whole, required=None),
        rooms=tuple(replace(group, required=None) for group in groups.rooms),
        kinds=tuple(replace(group, required=None) for group in groups.kinds),
        findings=ranked(findings, near_legs(findings, route)),
        quality=None,
    )


def coverage_by_group(selection: Selection, *, why: Mapping[str, str] | None = None) -> CoverageByGroup:
    """Return the coverage of the whole, of every room and of every kind, the lowest first."""
    return totals_of_plan(selection.visibility, why).coverage(seen_units(selection))


def ranked(findings: tuple[Finding, ...], near: set[int]) -> tuple[Finding, ...]:
    """Sort findings by importance: those near a leg first, then by rank, then in their order.

    `near` are the indices in `findings` of those near a leg; notes do not count as near.
    """

    def key(k: int) -> tuple[bool, int]:
        return (k not in near or findings[k].rank == Rank.NOTE, findings[k].rank)

    return tuple(findings[k] for k in sorted(range(len(findings)), key=key))


def _reached_m2(candidates: Candidates, parts: frozenset[int]) -> float:
    """Reached area of rooms: each room's floor times the fraction of its drive area in these parts."""
    space = candidates.space
    reached = 0.0
    for areas, floor in zip(room_areas_by_part(space), floor_of_rooms(space), strict=True):
        free = sum(areas.values())
        if free > 0:
            reached += floor * sum(areas.get(part, 0.0) for part in parts) / free
    return reached
