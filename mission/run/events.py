"""What a robot tells while it runs a mission: events from its journal, and telemetry.

Times are nanoseconds on the robot's clock (`robot_ns`, since 1970) and seconds since the run began
(`mission_time_s`). Poses are in the mission's frame.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

import msgspec

from stopgo.mission.document.decoding import one_decode_error

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
"""Which in nanoseconds fit there, too."""


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
    """The robot is through with a stop, and nobody says that a scan was made (autopilots without a word)."""

    stop: str
    pose: Pose | None
    """Where it stood; `None` if nobody saw it."""
    reason: str


class Skipped(Event, frozen=True, kw_only=True):
    stop: str
    reason: str


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
    """The robot has changed hands; `run_id` is empty when there is no run."""

    commander: str
    before: str


class LinkLost(Event, frozen=True, kw_only=True):
    """No station has been heard for a time, and the mission's policy says what follows."""

    silent_s: float
    policy: str


class Homing(Event, frozen=True, kw_only=True):
    """The robot is on its way back, by legs it has driven or by the return."""

    reason: str


class RevisionWaits(Event, frozen=True, kw_only=True):
    """A new revision of the mission has been taken, and will be followed from the next stop on."""

    waiting: int


class RevisionTaken(Event, frozen=True, kw_only=True):
    """From here on the run follows a new revision, which `revision` names."""

    before: int


class RevisionDropped(Event, frozen=True, kw_only=True):
    """The run is over before the revision that waited was followed; it must be pushed again."""

    waiting: int


class Finished(Event, frozen=True, kw_only=True):
    pass


class Aborted(Event, frozen=True, kw_only=True):
    reason: str


class UnknownKind(Event, frozen=True, kw_only=True):
    """An event of a kind that a newer stopgo tells of, and this one does not know."""

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
    """The event in a line of JSON; what a newer stopgo adds to it is passed over.

    Raises
    ------
    msgspec.DecodeError
        If it is not an event.
    """
    with one_decode_error():
        try:
            return _EVENTS.decode(body)
        except msgspec.ValidationError:
            told = _ENVELOPE.decode(body)
            if told.get("event") in KINDS:
                raise
            kind = told.get("event")
            return msgspec.convert({**told, "event": "UnknownKind", "kind": kind}, UnknownKind)


_EVENTS = msgspec.json.Decoder(AnyEvent)
_ENVELOPE = msgspec.json.Decoder(dict[str, Any])


STOPS_LISTED = 50
"""In a state; the journal has them all."""


class StateReport(msgspec.Struct, frozen=True, kw_only=True):
    """A full snapshot, sent on every change and at least every second."""

    robot: str
    boot_id: str
    seq: int
    robot_ns: Nanoseconds
    state: str
    """One of `State`, or what a newer robot calls it."""
    run_id: str | None
    mission_id: str | None
    revision: int | None
    stop: str | None
    stop_state: str | None
    done: tuple[str, ...]
    """The newest of them, at most STOPS_LISTED, so that a state is small whatever the mission."""
    skipped: tuple[str, ...]
    battery: float
    """0 to 1."""
    last_event: int
    """Number of the newest event in the journal, 0 if none."""
    next_revision: int | None = None
    """The revision that will be followed from the next stop on."""
    done_count: int = 0
    skipped_count: int = 0
    outside: tuple[str, ...] = ()
    """Of those that are done, the newest that were scanned farther from their places than is tolerated."""
    outside_count: int = 0


class PoseReport(msgspec.Struct, frozen=True, kw_only=True):
    """Where the robot is, 10 to 50 times a second."""

    robot: str
    boot_id: str
    seq: int
    robot_ns: Nanoseconds
    run_id: str | None
    mission_time_s: RunSeconds | None
    pose: Pose
    speed: float


class Health(msgspec.Struct, frozen=True, kw_only=True):
    """How a robot's base is, as far as it tells; each thing is `None` where it does not."""

    robot_ns: Nanoseconds
    run_id: str | None
    battery: float
    """0 to 1."""
    localisation: float | None = None
    """How well it knows where it is, 0 to 1."""
    emergency_stop: bool | None = None
    """Whether an emergency stop is pressed."""
    safety_field: bool | None = None
    """Whether something stands in the field that its safety scanners watch."""


class PosesMissing(msgspec.Struct, frozen=True, kw_only=True):
    """Where the robot was between two times of a run is not known, and why not."""

    run_id: str
    robot_ns: Nanoseconds
    """From this time on."""
    until_ns: Nanoseconds
    mission_time_s: RunSeconds
    """Of `robot_ns`."""
    reason: str

    @property
    def words(self) -> str:
        """As a person reads it."""
        seconds = (self.until_ns - self.robot_ns) / 1e9
        return f"no poses for {seconds:.1f} s: {self.reason}" if seconds > 0 else f"no poses: {self.reason}"


Report = StateReport | PoseReport | AnyEvent
"""What a robot tells of itself and its run."""
