"""Visibility -> visibility: the part of it within the limits on views."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stopgo.mission.document.limits import ViewLimits, limits_in_words, limits_of
from stopgo.mission.document.specs import limits_spec_of
from stopgo.mission.errors import NegativeResult
from stopgo.mission.geometry import IntArray, frozen, read_only
from stopgo.mission.settings import Settings
from stopgo.mission.settings.coverage_parameters import ANY_INCIDENCE
from stopgo.mission.stages import Visibility
from stopgo.planner.geometry.shapes import local_origin, to_grid
from stopgo.planner.visibility.sight.well_seen import SeenSegments, clipped

BLOCK = 20_000
"""Runs of units that are tested at a time, for memory and time: five times as many took a fifth longer."""


def within_limits(in_sight: Visibility) -> Visibility:
    """The visibility within the limits of the settings; itself if there are none.

    Raises
    ------
    NegativeResult
        If the limits leave nothing; the message names them.
    """
    settings = in_sight.settings
    limits = limits_of(settings)
    if limits.none:
        return in_sight
    seen = _clipped(in_sight, limits)
    if not len(seen.first):
        name = in_sight.floor.name
        raise NegativeResult(
            f"{name}: no visible target is within the limits: {_empty_reason(in_sight, settings)}"
        )
    return seen


def _clipped(in_sight: Visibility, limits: ViewLimits) -> Visibility:
    candidates, targets = in_sight.candidates, in_sight.targets
    origin = local_origin(candidates.floor)
    a, b, at = (to_grid(xy - origin) for xy in (targets.a, targets.b, candidates.xy[candidates.kept]))
    counts = np.zeros(in_sight.rows, dtype=np.int64)

    def within(begin: int) -> tuple[NDArray[Any], ...]:
        own = slice(begin, min(begin + BLOCK, len(in_sight.first)))
        segment, row = in_sight.segment[own], _row_of(in_sight.pointer, np.arange(own.start, own.stop))
        start = targets.first_unit[:-1][segment]
        stretches = SeenSegments(a[segment] - at[row], b[segment] - at[row], targets.units[segment])
        low, high = (unit[own] - start for unit in (in_sight.first, in_sight.last))
        run, first, last = clipped(stretches, low, high, limits)
        begin, end = int(row.min(initial=0)), int(row.max(initial=-1)) + 1
        counts[begin:end] += np.bincount(row[run] - begin, minlength=end - begin)
        kind = in_sight.first.dtype
        return segment[run], (start[run] + first).astype(kind), (start[run] + last).astype(kind)

    found = map(within, range(0, max(1, len(in_sight.first)), BLOCK))
    segment, first, last = (read_only(np.concatenate(part)) for part in zip(*found, strict=True))
    pointer = frozen(np.concatenate([[0], np.cumsum(counts)]), np.int64)
    return replace(in_sight, pointer=pointer, segment=segment, first=first, last=last, in_sight=in_sight)


def keep_only_visible(in_sight: Visibility) -> None:
    """Forget who sees each unit, but not which units are visible: long ranges have many millions of runs."""
    _ = in_sight.visible  # which is kept
    none = np.empty(0, dtype=in_sight.first.dtype)
    vars(in_sight).update(
        pointer=frozen(np.zeros(len(in_sight.pointer)), np.int64), segment=none, first=none, last=none
    )


def _row_of(pointer: IntArray, run: IntArray) -> IntArray:
    """Row of each run (n,)."""
    return np.searchsorted(pointer, run, side="right") - 1


LIMITS = ("max_incidence", "near", "density", "wall_height", "views")
"""The parameters that set limits."""


def without_limit(settings: Settings, key: str) -> Settings:
    """The settings with one limit switched off."""
    also = {"near": ("blind_cone",), "density": ("angular_step",)}
    off: dict[str, Any] = dict.fromkeys((key, *also.get(key, ())))
    if key == "max_incidence":
        off[key] = ANY_INCIDENCE
    return replace(settings, **off)


def _empty_reason(in_sight: Visibility, settings: Settings) -> str:
    """The limits that leave nothing by themselves, else all of them, and the remedies."""
    set_limits = {
        key: words
        for key, words in limits_in_words(limits_spec_of(settings)).items()
        if key not in ("views", "wall_height")
    }
    alone = {key: words for key, words in set_limits.items() if not _leaves_some(in_sight, settings, key)}
    better = {"max_incidence": "raise --max-incidence", "near": "lower --min-range or --blind-cone"}
    step, away = settings.angular_step or 0.0, max(settings.d_sec, settings.radius)
    square_on = f"{1000 * math.radians(step) * away:.2g} mm at {away:g} m"
    better["density"] = f"raise --density or scan finer than --angular-step {step:g} ({square_on})"
    remedies = ", ".join(better[key] for key in alone or set_limits)
    return f"{', '.join((alone or set_limits).values())}; {remedies}, or lower --grid"


def _leaves_some(in_sight: Visibility, settings: Settings, key: str) -> bool:
    """True if this limit alone leaves anything."""
    for other in LIMITS:
        if other != key:
            settings = without_limit(settings, other)
    return bool(len(_clipped(in_sight, limits_of(settings)).first))
