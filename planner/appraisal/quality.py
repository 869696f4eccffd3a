"""How well a plan's targets are to be seen: what that costs in stops, and where it cannot be had."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stopgo.mission.document.limits import limits_in_words
from stopgo.mission.document.specs import limits_spec_of
from stopgo.mission.floor import Finding
from stopgo.mission.geometry import BoolArray, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Selection, Visibility
from stopgo.mission.stages.coverage_totals import ledger_of
from stopgo.mission.stages.figures import LimitCost, Quality, percent
from stopgo.planner.selection import quick_estimate
from stopgo.planner.visibility import within_all_limits
from stopgo.planner.visibility.limited import without_limit

NOT_MET = "limits_not_met"
MOST_NAMED = 5
"""Rooms and kinds that a finding names."""


def quality_of(selection: Selection) -> Quality | None:
    """What the limits on views cost, each switched off alone; None where there are none.

    Plans for that are made quickly from what is known to be in sight, so they are about right.
    """
    seen = selection.visibility
    settings = seen.candidates.space.settings
    told = limits_in_words(limits_spec_of(settings))
    if not told:
        return None
    in_sight = _in_sight(seen)
    stops, costs = len(selection.chosen), []
    for key, words in told.items():
        fewer, bound = quick_estimate(_under(in_sight, without_limit(settings, key)))
        costs.append(LimitCost(key, words, stops=stops, without=fewer, bound=bound))
    ledger = ledger_of(seen)
    return Quality(tuple(costs), ledger.amount(in_sight.visible), ledger.amount(_possible(seen)))


def _in_sight(seen: Visibility) -> Visibility:
    return seen if seen.in_sight is None else seen.in_sight


def _under(in_sight: Visibility, settings: Settings) -> Visibility:
    """What is seen well enough by other settings."""
    candidates = in_sight.candidates
    space = replace(candidates.space, settings=settings)
    return within_all_limits(replace(in_sight, candidates=replace(candidates, space=space)))


def _possible(seen: Visibility) -> BoolArray:
    """Whether as many candidates see each unit well enough as stops are asked for."""
    asked = seen.candidates.space.settings.least_views
    return frozen(seen.visible & (seen.asked >= asked), np.bool_)


def not_met(selection: Selection) -> Iterator[Finding]:
    """Where so little can be seen well enough that the shares asked for are out of reach of any stops."""
    seen = selection.visibility
    told = limits_in_words(limits_spec_of(seen.candidates.space.settings))
    if not told:
        return
    ledger = replace(ledger_of(seen), visible=_in_sight(seen).visible)
    shares = ledger.shares(_possible(seen))
    short = [f"{item.name} {percent(item.coverage)}" for item in shares.short]
    if short:
        more = f" and {len(short) - MOST_NAMED} more" if len(short) > MOST_NAMED else ""
        yield Finding(
            NOT_MET,
            f"seen {', '.join(told.values())} can be, of what is in sight, only: "
            f"{', '.join(short[:MOST_NAMED])}{more}; lower --grid or --d-sec, or ask for less",
        )
