"""Names inside a recording: its application, timelines and entity paths, which exist nowhere else.

Everything under `PLAN` and `FIELD` is 2D, everything under `WORLD` 3D; both are metres from the same local
origin. `SPACE` carries the flip that turns Rerun's y-down 2D views into y-up drawings.
"""

from __future__ import annotations

from dataclasses import dataclass

APPLICATION = "stopgo"

STEP = "stage_step"
"""Sequence: the planning story: floor, space, candidates, each choice of a stop, and at last the route."""
STOP_NUMBER = "stop"
"""Sequence: the stops in the order of driving, from 1."""
CANDIDATE = "candidate"
"""Sequence: the row of `Visibility` whose view is drawn."""
MISSION_TIME = "mission_time"
"""Duration since the mission began: the axis that the planned and the driven run share."""
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

METRICS = "/metrics"
METRIC_COVERAGE = "/metrics/coverage"
COVERAGE_CHOSEN = "/metrics/coverage/chosen"
COVERAGE_REQUIRED = "/metrics/coverage/required"
COVERAGE_PLANNED = "/metrics/coverage/planned"
SIGHT = "/metrics/coverage/candidate"
METRIC_CROSS_TRACK = "/metrics/cross_track"
METRIC_DEVIATION = "/metrics/deviation"
METRIC_BATTERY = "/metrics/battery"

LOG = "/log"
LOG_PLAN = "/log/plan"
LOG_FIELD = "/log/field"
REPORT = "/report"
LATEST_REPORT = "/latest_report"
"""What is to be read first: the plan's report, and from a run's start on that of the run."""
STORY = "/story"
"""What a planning step did, in words."""
STOP_STORY = "/stop_story"
"""What a stop is for, in words."""
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
    """The expression that takes an entity and everything below it into a view."""
    return f"{entity}/**"


def part(entity: str, name: str) -> str:
    """One of several alike below an entity, such as the elements of a kind."""
    return f"{entity}/{name}"


def headings(stops: str) -> str:
    """Where the scanner faces at stops."""
    return f"{stops}/heading"


def poles(stops: str) -> str:
    """What stops stand on in 3D."""
    return f"{stops}/poles"


def shape(robot: str) -> str:
    """What is drawn of a robot; the robot's own entity is its pose."""
    return f"{robot}/shape"


@dataclass(frozen=True)
class RunEntities:
    """The entities of one run."""

    run_id: str

    def flat(self, name: str) -> str:
        """In 2D; also states and texts, which are in no space."""
        return f"{FIELD}/{self.run_id}/{name}"

    def solid(self, name: str) -> str:
        """In 3D."""
        return f"{WORLD_FIELD}/{self.run_id}/{name}"

    def metric(self, metric: str) -> str:
        """Of the METRIC_s that are of runs."""
        return f"{metric}/{self.run_id}"

    def tolerance(self, metric: str) -> str:
        """What is tolerated of a metric."""
        return f"{self.metric(metric)}/tolerance"

    def revision(self, number: int) -> Revision:
        """Of what a revision changed while the run was under way."""
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
        """How the base was, as values."""
        return self.flat(HEALTH)


@dataclass(frozen=True)
class Revision:
    """What a revision changed while a run was under way."""

    run: RunEntities
    number: int

    def flat(self, name: str) -> str:
        """In 2D."""
        return self.run.flat(f"revision_{self.number}/{name}")

    def solid(self, name: str) -> str:
        """In 3D."""
        return self.run.solid(f"revision_{self.number}/{name}")


EVENTS = "events"
HEALTH = "health"
ROBOT = "robot"
DRIVEN = "driven"
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
    """The document of a revision."""
    return f"{MISSION}/revision_{revision}"


def sight(revision: int) -> str:
    """What the stops of a revision see."""
    return f"{SIGHT}/revision_{revision}"


def carries(entity: str) -> bool:
    """Whether values of the entity are read back."""
    parts = entity.split("/")
    if entity in (FINDINGS, REASONS) or entity.startswith((f"{MISSION}/", f"{SIGHT}/", f"{FLOOR}/")):
        return True
    return len(parts) == 4 and f"/{parts[1]}" == FIELD and parts[3] in (EVENTS, ROBOT)


def run_of_events(entity: str) -> str | None:
    """The run whose events the entity holds, if it does."""
    parts = entity.split("/")
    return parts[2] if len(parts) == 4 and entity == RunEntities(parts[2]).events else None
