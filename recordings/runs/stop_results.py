"""Results of a run's stops as values on one entity: a query over many runs needs one set of columns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr

from stopgo.mission.comparing.compare import compare
from stopgo.mission.comparing.comparison import StopComparison
from stopgo.mission.comparing.run_collector import SOURCE
from stopgo.mission.document import Mission
from stopgo.mission.run.events import AnyEvent
from stopgo.mission.run.run_log import RunLog
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas

NUMBERS = (
    "planned_s", "arrived_s", "settle_s", "deviation_m", "along_m", "across_m", "heading_rad", "tolerance_m"
)  # fmt: skip
"""Fields of a stop that are numbers; NaN where one did not happen."""


def draw_stop_results(canvas: Canvas, events: Sequence[AnyEvent], revisions: Sequence[Mission]) -> None:
    """Write a row for each stop of a run that has ended: its outcome, position error and times."""
    last = events[-1]
    about = (last.robot, last.run_id, last.mission_id, last.revision)
    comparison = compare(RunLog(*about, SOURCE, events=tuple(events)), revisions)
    stops = comparison.stops
    began_ns = comparison.log.began_ns or 0
    seconds = [_end_s(item, events, comparison.log.duration_s) for item in stops]
    count = len(stops)
    values: dict[str, Any] = {
        "run_id": [last.run_id] * count,
        "robot": [last.robot] * count,
        "mission_id": [last.mission_id] * count,
        "stop": [item.stop for item in stops],
        "outcome": [item.outcome for item in stops],
        "reason": [item.reason for item in stops],
        "tries": np.array([item.tries for item in stops], np.int64),
    }
    for name in NUMBERS:
        found = [getattr(item, name) for item in stops]
        values[name] = np.array([math.nan if value is None else value for value in found])
    ns = began_ns + np.rint(np.array(seconds) * 1e9).astype(np.int64)
    canvas.columns(
        entities.STOP_RESULTS,
        [
            rr.TimeColumn(entities.STOP_NUMBER, sequence=np.arange(1, count + 1)),
            rr.TimeColumn(entities.MISSION_TIME, duration=np.array(seconds)),
            rr.TimeColumn(entities.ROBOT_TIME, timestamp=ns.astype("datetime64[ns]")),
        ],
        rr.DynamicArchetype.columns(archetype="StopResult", components=values),
    )


def _end_s(item: StopComparison, events: Sequence[AnyEvent], duration_s: float) -> float:
    """Return when the work at a stop ended; the end of the run for a stop without an event."""
    mine = [event.mission_time_s for event in events if getattr(event, "stop", None) == item.stop]
    return mine[-1] if mine else duration_s
