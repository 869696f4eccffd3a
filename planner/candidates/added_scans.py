"""Candidates -> candidates with scan poses added, such as those of scans that were taken."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, frozen
from stopgo.mission.stages import KEPT, Candidates


def with_scans(found: Candidates, poses: FloatArray, doorway: BoolArray | None = None) -> Candidates:
    """Return the candidates with scan poses (n, 3) added; these do not count for the visible share."""
    count = len(poses)
    more: dict[str, Any] = {
        "xy": poses[:, :2], "room": np.full(count, -1), "reason": np.full(count, KEPT),
        "part": np.full(count, found.chosen_part),
        "doorway": np.zeros(count, bool) if doorway is None else doorway, "must": np.zeros(count, bool),
    }  # fmt: skip
    if len(found.heading):
        more["heading"] = poses[:, 2]
    both = {name: _frozen(getattr(found, name), values) for name, values in more.items()}
    extra = found.extra if len(found.extra) else np.zeros(len(found.xy), bool)
    return replace(found, **both, extra=_frozen(extra, np.ones(count, bool)))


def _frozen(one: Any, other: Any) -> Any:
    return frozen(np.concatenate([one, other]), one.dtype)
