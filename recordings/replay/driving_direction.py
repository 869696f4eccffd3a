"""Headings of a log, compared with the directions in which the robot drove: are they of the driving robot?"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from stopgo.mission.run.run_log import Track

MOST_POSES = 20_000
STEP_M = 0.3
"""Length of path over which a direction of driving is measured."""
ALONG_RAD, MOSTLY = math.radians(20.0), 0.8
"""Greatest angle between heading and driving, and the fraction of the path where it must hold."""


def drives_ahead(track: Track) -> bool:
    """True if the robot mostly drove where its headings point."""
    rows = [0]
    for k in range(0, len(track), max(1, len(track) // MOST_POSES)):
        if math.dist(track.xy[k], track.xy[rows[-1]]) >= STEP_M:
            rows.append(k)
    along = []
    for a, b in pairwise(rows):
        x, y = track.xy[b] - track.xy[a]
        away = math.remainder(float(track.heading[(a + b) // 2]) - math.atan2(y, x), math.tau)
        along.append(abs(away) <= ALONG_RAD)
    return bool(along) and float(np.mean(along)) >= MOSTLY
