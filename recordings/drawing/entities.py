"""Names inside a recording: application, timelines and entity paths, which are defined only here.

Everything under `PLAN` and `FIELD` is 2D, everything under `WORLD` 3D; both are metres from the same local
origin. `PLAN` and `FIELD` have the flip that turns Rerun's y-down 2D views into y-up drawings.
"""

from __future__ import annotations

from dataclasses import dataclass

APPLICATION = "stopgo"

STEP = "stage_step"
"""Sequence of planning steps: floor, space, candidates, each choice of a stop, and the route at the end."""
STOP_NUMBER = "stop"
"""Sequence: the stops in the order of driving, from 1."""
CANDIDATE = "candidate"
"""Sequence: row of `Visibility` whose view is drawn."""
MISSION_TIME = "mission_time"
"""Duration since the mission began: common axis of the planned and the driven run."""
ROBOT_TIME = "robot_time"
"""Timestamp on the robot's clock."""

ROOT = "/"
PLAN = "/plan"
FLOOR = "/plan/floor"
OUTLINE = "/plan/floor/outline"
HOLES = "/plan/floor/holes"
OPENINGS = "/plan/floor/openings"
ROOMS = "/plan/floor/rooms"
ROOM_NAMES = "/plan/floor/room_names"
NAVIGABLE = "/plan/navigable"
DRIVE_AREA = "/plan/navigable/drive"
STOP_AREA = "/plan/navigable/stop"
STOP_AREA_EDGE = "/plan/navigable/stop_edge"
GAPS = "/plan/navigable/gaps"
CANDIDATES = "/plan/candidates"
TARGETS = "/plan/targets"
VISIBILITY = "/plan/visibility"
RAYS = "/plan/visibility/rays"
SEEN = "/plan/visibility/seen"
EYE = "/plan/visibility/candidate"
SELECTION = "/plan/selection"
SELECTION_TARGETS = "/plan/selection/targets"
SELECTION_SEEN = "/plan/selection/seen"
SELECTION_NEW = "/plan/selection/new"
SELECTION_SIGHT = "/plan/selection/sight"
SELECTION_STOPS = "/plan/selection/stops"
SELECTION_ROUTE = "/plan/selection/route"
WHY = "/plan/why"
WHY_SIGHT = "/plan/why/sight"
WHY_SEEN = "/plan/why/seen"
WHY_ALONE = "/plan/why/alone"
WHY_STOP = "/plan/why/stop"
WHY_RUNNERS = "/plan/why/runners"
COVERAGE = "/plan/coverage"
ROUTE = "/plan/route"
STOPS = "/plan/stops"
HEADINGS = "/plan/stops/heading"
NETWORK = "/plan/stops/network"
ERRORS = "/plan/stops/errors"
PLANNED_ROBOT = "/plan/robot"

WORLD = "/world"
WORLD_FLOOR = "/world/floor"
SLAB = "/world/floor/slab"
WORLD_COVERAGE = "/world/coverage"
WORLD_ROUTE = "/world/route"
WORLD_STOPS = "/world/stops"
POLES = "/world/stops/poles"
WORLD_PLANNED_ROBOT = "/world/robot"
WORLD_FIELD = "/world/field"

PROVED = "/plan/proof"
PROVED_PAIRS = "/plan/proof/pairs"
PROVED_TARGETS = "/plan/proof/targets"
PROVED_CLOUDS = "/world/proof/clouds"
WORLD_PROVED_PAIRS = "/world/proof/pairs"

FIELD = "/field"

METRIC_COVERAGE = "/metrics/coverage"
COVERAGE_CHOSEN = "/metrics/coverage/chosen"
COVERAGE_REQUIRED = "/metrics/coverage/required"
COVERAGE_PLANNED = "/metrics/coverage/planned"
CANDIDATE_COVERAGE = "/metrics/coverage/candidate"
METRIC_CROSS_TRACK = "/metrics/cross_track"
METRIC_DEVIATION = "/metrics/deviation"
METRIC_BATTERY = "/metrics/battery"

STOP_RESULTS = "/run/stops"
"""Results of the stops as values: the same columns in every run."""
LOG = "/log"
LOG_PLAN = "/log/plan"
LOG_FIELD = "/log/field"
REPORT = "/report"
LATEST_REPORT = "/latest_report"
"""Report to read first: the plan's, and from the start of a run the run's."""
STORY = "/story"
"""Description of a planning step."""
STOP_STORY = "/stop_story"
"""Description of a stop's purpose."""
PLANNED_STATE = "/plan/schedule/planned"

MISSION = "/carried/mission"
SIGHT = "/carried/sight"
FINDINGS = "/carried/findings"
REASONS = "/carried/reasons"

PROPERTIES = "/__properties"
PROPERTY_PLAN = "plan"
PROPERTY_PARAMETERS = "parameters"
PROPERTY_RUN = "run"
PROPERTY_PROOF = "proof"
PROPERTY_END = "end"


def under(entity: str) -> str:
    """Return the expression that puts an entity and everything below it into a view."""
    return f"{entity}/**"


def child(entity: str, name: str) -> str:
    """Return one of several similar entities below an entity, such as the elements of a kind."""
    return f"{entity}/{name}"


def headings(stops: str) -> str:
    """Headings of the scanner at stops."""
    return f"{stops}/heading"


def poles(stops: str) -> str:
    """Poles below the stops in 3D."""
    return f"{stops}/poles"


def shape(robot: str) -> str:
    """Shape of a robot; the robot's own entity is its pose."""
    return f"{robot}/shape"


@dataclass(frozen=True)
class RunEntities:
    """The entities of one run."""

    run_id: str

    def flat(self, name: str) -> str:
        """Entity in 2D; also for states and texts, which have no space."""
        return f"{FIELD}/{self.run_id}/{name}"

    def solid(self, name: str) -> str:
        """Entity in 3D."""
        return f"{WORLD_FIELD}/{self.run_id}/{name}"

    def metric(self, metric: str) -> str:
        """Entity of a METRIC_ that runs have."""
        return f"{metric}/{self.run_id}"

    def tolerance(self, metric: str) -> str:
        """Tolerance of a metric."""
        return f"{self.metric(metric)}/tolerance"

    def revision(self, number: int) -> Revision:
        """Entities of what a revision changed during the run."""
        return Revision(self, number)

    @property
    def log(self) -> str:
        return f"{LOG_FIELD}/{self.run_id}"

    @property
    def events(self) -> str:
        """Events as values."""
        return self.flat(EVENTS)

    @property
    def health(self) -> str:
        """Health reports of the base as values."""
        return self.flat(HEALTH)

    @property
    def vehicle_health(self) -> str:
        """Battery, position estimate and geofence in words."""
        return self.flat(VEHICLE_HEALTH)


@dataclass(frozen=True)
class Revision:
    """Entities of what a revision changed during a run."""

    run: RunEntities
    number: int

    def flat(self, name: str) -> str:
        """Entity in 2D."""
        return self.run.flat(f"revision_{self.number}/{name}")

    def solid(self, name: str) -> str:
        """Entity in 3D."""
        return self.run.solid(f"revision_{self.number}/{name}")


EVENTS = "events"
HEALTH = "health"
VEHICLE_HEALTH = "vehicle_health"
ROBOT = "robot"
DRIVEN = "driven"
UNSEEN = "unseen"
"""Gaps of the driven path, dashed."""
STATE = "state"
STOP_STATE = "stop_state"
STOP = "stop"
RUN_REPORT = "report"
ACQUIRED = "acquired"
LOST = "lost"
MISSING = "missing"
ARRIVED = "arrived"
SCANNED = "scanned"
SKIPPED = "skipped"
FAILED = "failed"
"""Names within a run, for `RunEntities.flat` and `RunEntities.solid`."""
WITHDRAWN = "withdrawn"
WITHDRAWN_ROUTE = "withdrawn_route"
NEW_STOPS = "stops"
NEW_ROUTE = "route"
"""Names within a revision, for `Revision.flat` and `Revision.solid`."""


def mission(revision: int) -> str:
    """Document of a revision."""
    return f"{MISSION}/revision_{revision}"


def sight(revision: int) -> str:
    """Visibility of a revision's stops."""
    return f"{SIGHT}/revision_{revision}"


def is_embedded(entity: str) -> bool:
    """True if values of the entity are read back."""
    parts = entity.split("/")
    if entity in (FINDINGS, REASONS) or entity.startswith((f"{MISSION}/", f"{SIGHT}/", f"{FLOOR}/")):
        return True
    return len(parts) == 4 and f"/{parts[1]}" == FIELD and parts[3] in (EVENTS, ROBOT, VEHICLE_HEALTH)


def run_of_events(entity: str) -> str | None:
    """Return the run whose events the entity contains; None for other entities."""
    parts = entity.split("/")
    return parts[2] if len(parts) == 4 and entity == RunEntities(parts[2]).events else None


def recording_id(mission_id: str, run_id: str = "") -> str:
    """Return the id of a run's recording; without a run, that of the mission's plan."""
    return f"{mission_id}-{run_id}" if run_id else mission_id
