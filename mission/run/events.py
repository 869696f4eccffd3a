"""A robot's reports while it runs a mission: events from its journal, and telemetry.

Times are nanoseconds on the robot's clock (`robot_ns`, since 1970) and seconds since the run began
(`mission_time_s`). Poses are in the mission's frame.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

import msgspec

from stopgo.mission.document.decoding import converted, decoded

State = Literal["IDLE", "READY", "RUNNING", "PAUSED", "HELD", "HOMING", "FINISHED", "ABORTED"]
StopState = Literal[
    "WAITING",
    "NAVIGATING",
    "SETTLING",
    "SCANNING",
    "VERIFYING",
    "DONE",
    "RETRIABLE",
    "SKIPPED",
    "FAILED",
]


Nanoseconds = Annotated[int, msgspec.Meta(ge=0, le=2**62)]
"""Since 1970, up to the year 2116: a recording holds times in 64 bits."""
RunSeconds = Annotated[float, msgspec.Meta(ge=-9e9, le=9e9)]
"""Seconds that fit into 64 bits as nanoseconds, too."""


class Pose(msgspec.Struct, frozen=True, kw_only=True):
    x: float
    y: float
    heading: float


class Event(msgspec.Struct, frozen=True, kw_only=True, tag=True, tag_field="event"):
    """One line of the robot's journal; `number` counts from 1 and never repeats on a robot."""

    number: int
    robot: str
    boot_id: str
    run_id: str
    mission_id: str
    revision: int
    robot_ns: Nanoseconds
    mission_time_s: RunSeconds


class Started(Event, frozen=True, kw_only=True):
    commander: str


class Arrived(Event, frozen=True, kw_only=True):
    stop: str
    pose: Pose
    deviation_m: float
    """Distance of the pose from the stop."""


class Settled(Event, frozen=True, kw_only=True):
    stop: str
    pose: Pose


class Scanned(Event, frozen=True, kw_only=True):
    stop: str
    pose: Pose
    file: str
    size: int
    sha256: str
    points: int


class Unconfirmed(Event, frozen=True, kw_only=True):
    """The robot is done with a stop, and no scan is confirmed: the autopilot does not report scans."""

    stop: str
    pose: Pose | None
    """Pose of the robot at the stop; `None` if no pose was received."""
    reason: str


class Skipped(Event, frozen=True, kw_only=True):
    stop: str
    reason: str


JUMPED_OVER = "jumped over by"
"""First words of the reason of a stop that was skipped by no command from here."""


class Failed(Event, frozen=True, kw_only=True):
    stop: str
    reason: str


class Held(Event, frozen=True, kw_only=True):
    reason: str


class Paused(Event, frozen=True, kw_only=True):
    reason: str


class Resumed(Event, frozen=True, kw_only=True):
    commander: str


class TakenOver(Event, frozen=True, kw_only=True):
    """The robot has another commander; `run_id` is empty when there is no run."""

    commander: str
    before: str


class LinkLost(Event, frozen=True, kw_only=True):
    """No data from any station for `silent_s`; `policy` is the mission's reaction."""

    silent_s: float
    policy: str


class Homing(Event, frozen=True, kw_only=True):
    """The robot is returning, by legs it has driven or by the return leg."""

    reason: str


class RevisionWaits(Event, frozen=True, kw_only=True):
    """A new revision of the mission is accepted; the robot follows it from the next stop on."""

    waiting: int


class RevisionTaken(Event, frozen=True, kw_only=True):
    """From here on the run follows a new revision, which `revision` names."""

    before: int


class RevisionDropped(Event, frozen=True, kw_only=True):
    """The run ended before the waiting revision was followed; it must be pushed again."""

    waiting: int


class Finished(Event, frozen=True, kw_only=True):
    pass


class Aborted(Event, frozen=True, kw_only=True):
    reason: str


class UnknownKind(Event, frozen=True, kw_only=True):
    """An event of a kind that only a newer stopgo knows."""

    kind: str


AnyEvent = (
    Started
    | Arrived
    | Settled
    | Scanned
    | Unconfirmed
    | Skipped
    | Failed
    | Held
    | Paused
    | Resumed
    | TakenOver
    | LinkLost
    | Homing
    | RevisionWaits
    | RevisionTaken
    | RevisionDropped
    | Finished
    | Aborted
    | UnknownKind
)
KINDS: tuple[str, ...] = tuple(kind.__name__ for kind in get_args(AnyEvent))


def event_of(body: bytes) -> AnyEvent:
    """Decode the event in a line of JSON; keys that only a newer stopgo knows are ignored.

    Raises
    ------
    msgspec.DecodeError
        If it is not an event.
    """
    try:
        return decoded(body, AnyEvent)
    except msgspec.ValidationError:
        fields = decoded(body, dict[str, Any])
        if fields.get("event") in KINDS:
            raise
        kind = fields.get("event")
        return converted({**fields, "event": "UnknownKind", "kind": kind}, UnknownKind)


STOPS_LISTED = 50
"""In a state; the journal has them all."""


UNKNOWN_CHARGE = -1.0
"""Charge of a battery that nobody reports; a number, because stations of 0.1 read nothing else."""


def reported_charge(charge: float | None) -> float:
    """Return a charge as reports hold it."""
    return UNKNOWN_CHARGE if charge is None else charge


def known_charge(reported: float) -> float | None:
    """Return the charge in a report, 0 to 1; `None` if it is not known."""
    return None if reported < 0 else reported


class StateReport(msgspec.Struct, frozen=True, kw_only=True):
    """A full snapshot, sent on every change and at least every second."""

    robot: str
    boot_id: str
    seq: int
    robot_ns: Nanoseconds
    state: str
    """One of `State`, or another word of a newer robot."""
    run_id: str | None
    mission_id: str | None
    revision: int | None
    stop: str | None
    stop_state: str | None
    done: tuple[str, ...]
    """The newest of them, at most STOPS_LISTED, so that a state is small whatever the mission."""
    skipped: tuple[str, ...]
    battery: float
    """0 to 1, or UNKNOWN_CHARGE; see `charge`."""
    last_event: int
    """Number of the newest event in the journal, 0 if none."""
    next_revision: int | None = None
    """The revision that will be followed from the next stop on."""
    done_count: int = 0
    skipped_count: int = 0
    outside: tuple[str, ...] = ()
    """Newest of the done stops that were scanned outside tolerance."""
    outside_count: int = 0
    battery_ok: bool | None = None
    """False while a failsafe of the battery lasts; `None` if it is not known, as the next two."""
    position_ok: bool | None = None
    """False while the autopilot's estimator has no position."""
    fence_ok: bool | None = None
    """False while the geofence is breached."""

    @property
    def charge(self) -> float | None:
        """Charge of the battery, 0 to 1; `None` if it is not known."""
        return known_charge(self.battery)


class PoseReport(msgspec.Struct, frozen=True, kw_only=True):
    """Pose of the robot, 10 to 50 times a second."""

    robot: str
    boot_id: str
    seq: int
    robot_ns: Nanoseconds
    run_id: str | None
    mission_time_s: RunSeconds | None
    pose: Pose
    speed: float


class Health(msgspec.Struct, frozen=True, kw_only=True):
    """Health of a robot's base; each value is `None` if the base does not report it."""

    robot_ns: Nanoseconds
    run_id: str | None
    battery: float
    """0 to 1, or UNKNOWN_CHARGE; see `charge`."""
    localisation: float | None = None
    """Quality of the localisation, 0 to 1."""
    emergency_stop: bool | None = None
    """True if an emergency stop is pressed."""
    safety_field: bool | None = None
    """True if something is in the field that the safety scanners watch."""

    @property
    def charge(self) -> float | None:
        """Charge of the battery, 0 to 1; `None` if it is not known."""
        return known_charge(self.battery)


class PosesMissing(msgspec.Struct, frozen=True, kw_only=True):
    """A gap in the poses of a run, and its reason."""

    run_id: str
    robot_ns: Nanoseconds
    """From this time on."""
    until_ns: Nanoseconds
    mission_time_s: RunSeconds
    """Of `robot_ns`."""
    reason: str

    @property
    def words(self) -> str:
        """The gap in words."""
        seconds = (self.until_ns - self.robot_ns) / 1e9
        return f"no poses for {seconds:.1f} s: {self.reason}" if seconds > 0 else f"no poses: {self.reason}"


class ReportsMissing(msgspec.Struct, frozen=True, kw_only=True):
    """Topics of a robot that do not arrive, and the age of its newest state; without topics, all arrive."""

    run_id: str | None
    robot_ns: Nanoseconds
    """Time of the newest state on the robot's clock."""
    state: StateReport | None
    """The newest state, also one whose events are missing; `None` if none came."""
    age_s: float
    """Age of that state."""
    topics: tuple[str, ...]
    """A line for each topic, with the reason."""
    changed: bool = True
    """True if other topics were missing before."""

    @property
    def words(self) -> str:
        """The gaps in words, with the newest state and its age."""
        if not self.topics:
            return "all reports arrive again"
        state = "no state" if self.state is None else f"{self.state.state} {self.age_s:.0f} s ago"
        return f"{'; '.join(self.topics)} (newest state: {state})"


Report = StateReport | PoseReport | AnyEvent
"""Report of a robot on itself and its run."""
