"""Visibility -> visibility: of what is in sight, what is seen well enough."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from stopgo.mission.document.limits import ViewLimits, limits_in_words, limits_of
from stopgo.mission.document.specs import limits_spec_of
from stopgo.mission.errors import NegativeResult
from stopgo.mission.geometry import frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Visibility
from stopgo.planner.geometry.shapes import local_origin, to_grid
from stopgo.planner.visibility.sight.well_seen import SeenSegments, clipped


def within_limits(in_sight: Visibility) -> Visibility:
    """The same with what is seen within the limits of the settings only; itself where there are none.

    Raises
    ------
    NegativeResult
        When they leave nothing, naming the limits.
    """
    settings = in_sight.candidates.space.settings
    limits = limits_of(settings)
    if limits.none:
        return in_sight
    seen = _clipped(in_sight, limits)
    if not len(seen.first):
        name = in_sight.candidates.space.floor.name
        raise NegativeResult(
            f"{name}: nothing in sight is seen well enough: {_why_nothing(in_sight, settings)}"
        )
    return seen


def _clipped(in_sight: Visibility, limits: ViewLimits) -> Visibility:
    candidates, targets = in_sight.candidates, in_sight.targets
    origin = local_origin(candidates.space.floor)
    row = np.repeat(np.arange(in_sight.rows), np.diff(in_sight.pointer))
    place = to_grid(candidates.xy[candidates.kept] - origin)[row]
    a, b = (to_grid(end - origin)[in_sight.segment] - place for end in (targets.a, targets.b))
    begin = targets.first_unit[:-1][in_sight.segment]
    stretches = SeenSegments(a, b, targets.units[in_sight.segment])
    run, first, last = clipped(stretches, in_sight.first - begin, in_sight.last - begin, limits)
    return replace(
        in_sight,
        pointer=frozen(np.searchsorted(row[run], np.arange(in_sight.rows + 1)), np.int64),
        segment=frozen(in_sight.segment[run], np.int64),
        first=frozen(begin[run] + first, np.int64),
        last=frozen(begin[run] + last, np.int64),
        in_sight=in_sight,
    )


LIMITS = ("max_incidence", "near", "density", "wall_height", "views")
"""The parameters that set limits."""


def without(settings: Settings, key: str) -> Settings:
    """The settings with one limit switched off."""
    off: dict[str, Any] = dict.fromkeys((key, "blind_cone") if key == "near" else (key,))
    return replace(settings, **off)


def _why_nothing(in_sight: Visibility, settings: Settings) -> str:
    """Which limits leave nothing alone, else all of them together, and what to do."""
    told = {
        key: words
        for key, words in limits_in_words(limits_spec_of(settings)).items()
        if key not in ("views", "wall_height")
    }
    alone = {key: words for key, words in told.items() if not _shows(in_sight, settings, key)}
    better = {"max_incidence": "raise --max-incidence", "near": "lower --near or --blind-cone"}
    step, away = settings.angular_step or 0.0, max(settings.d_sec, settings.radius)
    square_on = f"{1000 * math.radians(step) * away:.2g} mm at {away:g} m"
    better["density"] = f"raise --density or scan finer than --angular-step {step:g} ({square_on})"
    ways_out = ", ".join(better[key] for key in alone or told)
    return f"{', '.join((alone or told).values())}; {ways_out}, or lower --grid"


def _shows(in_sight: Visibility, settings: Settings, key: str) -> bool:
    """Whether anything is left with this limit alone."""
    for other in LIMITS:
        if other != key:
            settings = without(settings, other)
    return bool(len(_clipped(in_sight, limits_of(settings)).first))
