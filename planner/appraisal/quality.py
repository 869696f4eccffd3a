"""Quality limits on a plan's views: their cost in stops, and the rooms that cannot meet them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from stopgo.mission.document.limits import limits_in_words
from stopgo.mission.document.specs import limits_spec_of
from stopgo.mission.floor import Finding
from stopgo.mission.geometry import BoolArray, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Selection, Visibility
from stopgo.mission.stages.coverage_totals import totals_of_plan
from stopgo.mission.stages.figures import LimitCost, Quality, percent
from stopgo.planner.selection import forget_large_cover, quick_count, quick_estimate
from stopgo.planner.visibility import within_all_limits
from stopgo.planner.visibility.limited import without_limit

NOT_MET = "limits_not_met"
FEWER_VIEWS = "fewer_views"
MOST_NAMED = 5
"""Rooms and kinds that a finding names."""


@dataclass(frozen=True)
class LimitEstimates:
    """Numbers of stops of fast selections, with all limits and without each alone."""

    limited: int
    free: Mapping[str, tuple[int, int]]
    """By limit: the number without it, and a lower bound."""


def limit_estimates(seen: Visibility) -> LimitEstimates | None:
    """Return fast selections on the known visibility; None if there are no limits.

    They are approximate: their scans need not register.
    """
    settings = seen.settings
    limits = limits_in_words(limits_spec_of(settings))
    if not limits:
        return None
    in_sight = _in_sight(seen)
    alike = seen.candidates is in_sight.candidates
    limited = quick_count(seen if alike else _under(in_sight, settings))
    if alike:
        forget_large_cover(seen)
    free = {key: quick_estimate(_under(in_sight, without_limit(settings, key))) for key in limits}
    return LimitEstimates(limited, free)


def quality_of(selection: Selection, estimates: LimitEstimates | None) -> Quality | None:
    """Return the cost of the limits on views, each switched off alone; None if there are no limits."""
    if estimates is None:
        return None
    seen, stops = selection.visibility, len(selection.chosen)
    costs = []
    for key, words in limits_in_words(limits_spec_of(seen.settings)).items():
        free, bound = estimates.free[key]
        without = max(bound, stops - max(0, estimates.limited - free))
        costs.append(LimitCost(key, words, stops=stops, without=without, bound=bound))
    totals = totals_of_plan(seen)
    return Quality(tuple(costs), totals.amount(_in_sight(seen).visible), totals.amount(_possible(seen)))


def _in_sight(seen: Visibility) -> Visibility:
    return seen if seen.in_sight is None else seen.in_sight


def _under(in_sight: Visibility, settings: Settings) -> Visibility:
    """Visibility within the limits of other settings."""
    candidates = in_sight.candidates
    space = replace(candidates.space, settings=settings)
    return within_all_limits(replace(in_sight, candidates=replace(candidates, space=space)))


def _possible(seen: Visibility) -> BoolArray:
    """True for each unit that enough candidates see within the limits."""
    required = seen.settings.least_views
    return frozen(seen.visible & (seen.asked >= required), np.bool_)


def not_met(seen: Visibility) -> Iterator[Finding]:
    """A finding if no stops can reach the required coverage within the limits."""
    limits = limits_in_words(limits_spec_of(seen.settings))
    if not limits:
        return
    totals = replace(totals_of_plan(seen), visible=_in_sight(seen).visible)
    groups = totals.coverage(_possible(seen))
    short = [f"{item.name} {percent(item.coverage)}" for item in groups.short]
    if short:
        more = f" and {len(short) - MOST_NAMED} more" if len(short) > MOST_NAMED else ""
        yield Finding(
            NOT_MET,
            f"seen {', '.join(limits.values())} can be, of the visible targets, only: "
            f"{', '.join(short[:MOST_NAMED])}{more}; lower --grid or --clearance, or ask for less",
        )


def fewer_views(selection: Selection) -> Iterator[Finding]:
    """A finding if targets count although fewer stops see them than required: no more candidates do."""
    seen = selection.visibility
    required = seen.settings.least_views
    counted = seen.seen_from(selection.chosen) & seen.visible
    fewer = frozen(counted & (seen.views_from(selection.chosen) < required), np.bool_)
    if fewer.any():
        totals = totals_of_plan(seen)
        unit = "units" if totals.rule == "paper" else "m"
        yield Finding(
            FEWER_VIEWS,
            f"{totals.amount(fewer):.1f} {unit} count as covered from fewer than {required} stops, as no "
            "more candidates see them; lower --grid for more candidates",
        )
