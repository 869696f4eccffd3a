"""Names inside a recording: its application, timelines and entity paths, which exist nowhere else.

Everything under `PLAN` and `FIELD` is 2D, everything under `WORLD` 3D; both are metres from the same local
origin. `SPACE` carries the flip that turns Rerun's y-down 2D views into y-up drawings.
"""

from __future__ import annotations

APPLICATION = "stopgo"

STEP = "stage_step"
"""Sequence: how many stops have been chosen; 0 holds what comes before the selection."""
CANDIDATE = "candidate"
"""Sequence: the row of `Visibility` whose view is drawn."""
MISSION_TIME = "mission_time"
"""Duration since the mission began: the axis that the planned and the driven run share."""
ROBOT_TIME = "robot_time"
"""Timestamp on the robot's clock."""

ROOT = "/"
PLAN = "/plan"
FLOOR = "/plan/floor"
NAVIGABLE = "/plan/navigable"
CANDIDATES = "/plan/candidates"
TARGETS = "/plan/targets"
VISIBILITY = "/plan/visibility"
SELECTION = "/plan/selection"
COVERAGE = "/plan/coverage"
ROUTE = "/plan/route"
STOPS = "/plan/stops"
PLANNED_ROBOT = "/plan/robot"

WORLD = "/world"
WORLD_FLOOR = "/world/floor"
WORLD_COVERAGE = "/world/coverage"
WORLD_ROUTE = "/world/route"
WORLD_STOPS = "/world/stops"
WORLD_PLANNED_ROBOT = "/world/robot"
WORLD_FIELD = "/world/field"

FIELD = "/field"

METRICS = "/metrics"
METRIC_COVERAGE = "/metrics/coverage"
METRIC_CROSS_TRACK = "/metrics/cross_track"
METRIC_DEVIATION = "/metrics/deviation"
METRIC_BATTERY = "/metrics/battery"

LOG = "/log"
LOG_PLAN = "/log/plan"
LOG_FIELD = "/log/field"
REPORT = "/report"

PROPERTIES = "/__properties"
PROPERTY_PLAN = "plan"
PROPERTY_PARAMETERS = "parameters"
PROPERTY_RUN = "run"


def of_run(parent: str, run_id: str, *names: str) -> str:
    """The entity of one run below `parent`."""
    return "/".join((parent, run_id, *names))


def under(entity: str) -> str:
    """The expression that takes an entity and everything below it into a view."""
    return f"{entity}/**"


def events_of_run(run_id: str) -> str:
    """Where the events of a run are kept as values."""
    return of_run(FIELD, run_id, _EVENTS)


def run_of_events(entity: str) -> str | None:
    """The run whose events the entity holds, if it does."""
    parts = entity.split("/")
    return parts[2] if len(parts) == 4 and entity == events_of_run(parts[2]) else None


_EVENTS = "events"
