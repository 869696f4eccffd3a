"""Headings at the stops, for a scanner that does not see all round: a wrong one shows it another part.

A heading is evidence against a stop only if the log's headings are those of the driving robot. A table in
another unit, or with a compass that was not converted, has others.
"""

from __future__ import annotations

import math

import numpy as np

from stopgo.mission.comparing.acquired import Certainty
from stopgo.mission.comparing.comparison import DONE, StopComparison
from stopgo.mission.run.scans import HEADING_RAD, needs_heading
from stopgo.recordings.replay.replayed import Replay

NEIGHBOURS = 4
"""Number of visited stops around one whose heading errors may be a drift that it has too."""


def heading_answer(replay: Replay, number: int, *, drifts: bool) -> tuple[Certainty, str]:
    """Return whether the robot faced as its scanner needs at a stop, and why if it is undecided.

    `drifts`: the log's positions drift, or may.
    """
    item, scanner = replay.comparison.asked[number], replay.mission.scanner
    if not needs_heading(scanner):
        return "yes", ""
    if item.heading_rad is None:
        return "unknown", NO_HEADINGS.format(scanner.fov_deg)
    if replay.inferred and not _is_measured(replay, number):
        return "unknown", NO_HEADING_THERE.format(scanner.fov_deg)
    if not item.turned_rad or not replay.inferred:
        return ("no" if item.turned_rad else "yes"), ""
    if not replay.drives_ahead:
        return "unknown", OTHER_HEADINGS
    return ("unknown", DRIFTS) if drifts and _is_alike(replay, item, number) else ("no", "")


def unknown_headings(replay: Replay) -> str:
    """Return why the log does not show where the scanner looked at a visited stop; empty if it does."""
    asked = enumerate(replay.comparison.asked)
    placed = [number for number, item in asked if item.outcome in DONE and item.deviation_m is not None]
    answers = (heading_answer(replay, number, drifts=False) for number in placed)
    return next((why for answer, why in answers if answer == "unknown"), "")


NO_HEADINGS = "its scanner sees {:g}°, and the log has no headings; give another source of poses"
NO_HEADING_THERE = "its scanner sees {:g}°, and the log has no heading there; give another source of poses"
OTHER_HEADINGS = (
    "its heading is not the planned one, but the log's headings are not the directions of driving either; "
    "check their unit, or give another source of poses"
)
DRIFTS = "its heading is not the planned one, and the log drifts; give poses matched to a map"


def _is_measured(replay: Replay, number: int) -> bool:
    """True if the log has a heading of a standstill at the stop; those between others are interpolated."""
    source, offset_ns = replay.placed.source, replay.placed.alignment.time_offset_ns
    known = source.ns[np.isfinite(source.heading)] + offset_ns
    found = [match.standstill for match in replay.at(number)]
    return any(((known >= item.begin_ns) & (known <= item.end_ns)).any() for item in found)


def _is_alike(replay: Replay, item: StopComparison, number: int) -> bool:
    """True if the visited stops around one have nearly its heading error, or there is none."""
    others = [
        (abs(k - number), math.remainder(other.heading_rad - (item.heading_rad or 0.0), math.tau))
        for k, other in enumerate(replay.comparison.asked)
        if k != number and other.heading_rad is not None
    ]
    near = [apart for _, apart in sorted(others)[:NEIGHBOURS]]
    return not near or abs(float(np.median(near))) <= HEADING_RAD
