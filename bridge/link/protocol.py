"""Key expressions and messages between station and robot; no other module knows them.

Messages are JSON; docs/reference/protocol.md describes them. Times that end in `_ns` are
nanoseconds on the robot's clock.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import msgspec

from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import (
    AnyEvent,
    Health,
    Nanoseconds,
    PoseReport,
    PosesMissing,
    StateReport,
    event_of,
)
from stopgo.mission.run.lease import Lease
from stopgo.mission.run.run_commands import Answer, Count, ShortText

VERSION: Final = 1
CHUNK_BYTES: Final = 32 * 1024
"""During a push a command waits at most for one chunk: 33 ms at 8 Mbit/s."""
MAX_CHUNK_BYTES: Final = 256 * 1024
MAX_DOCUMENT_BYTES: Final = 64 * 1024 * 1024
LOG_PAGE: Final = 100
"""Events in one answer of the log: some 30 kB, a second on a slow line."""
POSE_PAGE: Final = 50
"""Poses in one answer: some 12 kB."""
RECORD_PAGE: Final = 20
"""Entries of a record in one answer: ten seconds of a run, some 25 kB."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_SITE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}(/[A-Za-z0-9][A-Za-z0-9_.-]{0,63})*")


@dataclass(frozen=True)
class KeyExpressions:
    """The key expressions of one robot, `[<site>/]sx/1/<robot>/…`, or of every robot of a site."""

    robot: str
    site: str | None = None
    every: bool = False
    """True if the robot is `*`, every robot: for questions and publications, never for commands."""

    @classmethod
    def of_every_robot(cls, site: str | None) -> KeyExpressions:
        return cls("*", site, every=True)

    def __post_init__(self) -> None:
        if not self.every and not _NAME.fullmatch(self.robot):
            raise InputError(f"robot name {self.robot!r}: use letters, digits, '_', '.' and '-' (at most 64)")
        if self.site is not None and not _SITE.fullmatch(self.site):
            raise InputError(
                f"site {self.site!r}: use letters, digits, '_', '.', '-', with '/' between parts"
            )
        if self.site is not None and "sx" in self.site.split("/"):
            raise InputError(f"site {self.site!r}: no part of it can be 'sx', as robots' keys begin")

    @property
    def root(self) -> str:
        return f"{self.site + '/' if self.site else ''}sx/{VERSION}/{self.robot}"

    @property
    def alive(self) -> str:
        return f"{self.root}/alive"

    @property
    def info(self) -> str:
        return f"{self.root}/info"

    @property
    def log(self) -> str:
        return f"{self.root}/log"

    @property
    def poses(self) -> str:
        return f"{self.root}/poses"

    @property
    def record(self) -> str:
        return f"{self.root}/record"

    @property
    def state(self) -> str:
        return f"{self.root}/tel/state"

    @property
    def pose(self) -> str:
        return f"{self.root}/tel/pose"

    @property
    def event(self) -> str:
        return f"{self.root}/tel/event"

    @property
    def health(self) -> str:
        return f"{self.root}/tel/health"

    @property
    def keep(self) -> str:
        """Queried every few seconds by a station that watches; it renews that station's lease."""
        return f"{self.root}/keep"

    @property
    def boot(self) -> str:
        """Queried to find out if a name is in use."""
        return f"{self.root}/boot"

    def watcher(self, name: str) -> str:
        """Token of a station that watches the robot."""
        return f"{self.root}/watch/{name}"

    def command(self, verb: str) -> str:
        return f"{self.root}/cmd/{verb}"

    def mission(self, mission_id: str, step: str) -> str:
        """`begin`, `chunk/<i>`, `commit` or `part/<i>` of one mission's transfer."""
        return f"{self.root}/mission/{mission_id}/{step}"

    def mavlink(self, what: str) -> str:
        """Raw frames: `down` from the vehicle, `up` to it; `alive`, `hello`: the tunnel's robot end."""
        return f"{self.root}/mavlink/{what}"

    def robot_of(self, key: str) -> str:
        """Return the robot that a key belongs to."""
        return key.removeprefix(self.root.removesuffix(self.robot)).partition("/")[0]


class Tagged(msgspec.Struct, frozen=True, kw_only=True, tag=True, tag_field="is"):
    """Base of most messages: frozen, with the message's name in `is`. Unknown fields are ignored."""


class OwnMap(Transform, frozen=True, forbid_unknown_fields=False):
    """Transform from the site to a robot's map; unknown fields are ignored."""


class Info(Tagged, frozen=True):
    """Identity, state and limits of a robot, on `info`."""

    protocol: int
    stopgo: str
    robot: str
    boot_id: str
    clock_ns: Nanoseconds
    """Time on the clock that `valid_for_s` counts on."""
    state: StateReport
    lease: Lease | None
    """The newest lease, also when it has ended."""
    chunk_bytes: int
    document_bytes: int
    profiles: tuple[str, ...] | None
    """Names of the scanner's profiles; `None` if it accepts any."""
    to_map: OwnMap | None
    """Transform from the site to the map, if the robot was given one; else each mission's `frame.to_map`."""
    capabilities: tuple[str, ...] = ()
    """Names of the robot's capabilities beyond its protocol version."""


class Watching(Tagged, frozen=True):
    """Sign of a station that watches the robot; renews its lease, if it has it; answered with `Info`."""

    commander: ShortText
    token: ShortText | None = None
    """Name of the sender's token on `watch/<name>`; while it is shown, the sender is in contact."""


class Booted(Tagged, frozen=True):
    """The start of a robot's program that answers."""

    boot_id: str


class Manifest(Tagged, frozen=True):
    """Description of the document that will be transferred, on `mission/<id>/begin`."""

    mission_id: ShortText
    revision: Count
    digest: ShortText
    """The mission's own digest."""
    size: Count
    sha256: ShortText
    """Hash of the transferred bytes."""
    chunk_bytes: Count

    @property
    def chunks(self) -> int:
        return -(-self.size // self.chunk_bytes)


class Ready(Tagged, frozen=True):
    """The robot waits for the chunks that are not in `held`."""

    held: tuple[int, ...]


class ChunkHeld(Tagged, frozen=True):
    index: int
    sha256: str


class Commit(Tagged, frozen=True):
    """Request to verify and store a mission whose chunks have all been sent, on `mission/<id>/commit`."""

    manifest: Manifest
    commander: ShortText
    nonce: ShortText
    """Accepted once: the same commit may be sent again, but not to undo a later one."""
    not_after_ns: int
    boot_id: ShortText | None = None
    """The start of the robot's program that `not_after_ns` belongs to; after another start it is refused."""
    fence: Count | None = None
    take_over: bool = False


class Accepted(Tagged, frozen=True):
    """Confirmation that the whole mission is stored on the robot."""

    mission_id: str
    revision: int
    digest: str
    already: bool
    """True if the robot had exactly this mission before."""
    waits: bool = False
    """True if the current run will follow it from the next stop on."""


class Rejected(Tagged, frozen=True):
    """The mission was not accepted; the robot's earlier mission is unchanged."""

    reason: str
    """One of `Reason`, or a newer robot's name for it."""
    messages: tuple[str, ...]


class MissionPart(Tagged, frozen=True):
    """A part of the stored mission, read back on `mission/<id>/part/<i>`."""

    manifest: Manifest
    index: int
    data: bytes


class Malformed(Tagged, frozen=True):
    """Refusal of a request that could not be read; nothing was done."""

    message: str


class LogPage(Tagged, frozen=True):
    """Events from the journal by number; there are more if `newest` is higher."""

    bodies: tuple[msgspec.Raw, ...] = msgspec.field(name="events")
    """As in the journal, including kinds that this stopgo does not know."""
    newest: int

    @property
    def events(self) -> tuple[AnyEvent, ...]:
        return tuple(event_of(bytes(body)) for body in self.bodies)


class PosePage(Tagged, frozen=True):
    """Past poses in order; a page that is not full is the last."""

    boot_id: str
    """The boot that `seq` and `since` belong to."""
    poses: tuple[PoseReport, ...]


class PoseRow(msgspec.Struct, frozen=True, array_like=True):
    """A pose of a record, as an array: a `PoseReport` without the values that its whole entry shares."""

    seq: int
    robot_ns: Nanoseconds
    x: float
    y: float
    heading: float
    speed: float


class RecordEntry(msgspec.Struct, frozen=True, kw_only=True):
    """Half a second of a run, of one boot, as the robot recorded it."""

    number: int
    """From 1 within the run, also over reboots."""
    boot_id: str
    began_ns: Nanoseconds
    """Begin of the run."""
    poses: tuple[PoseRow, ...] = ()
    states: tuple[StateReport, ...] = ()
    """States that differ from the one before."""
    health: tuple[Health, ...] = ()
    missing: tuple[PosesMissing, ...] = ()
    """Gaps in the record before this entry."""


class RecordPage(Tagged, frozen=True):
    """Entries of one run's record by number; there are more if `newest` is higher."""

    run_id: str
    since: int
    """The number before the first entry's."""
    entries: tuple[RecordEntry, ...]
    newest: int
    missing: tuple[PosesMissing, ...] = ()
    """Poses that cannot be written at present; an entry reports them when there is space again."""


class RunKept(msgspec.Struct, frozen=True, kw_only=True):
    """A run with a record on the robot."""

    run_id: str
    entries: int
    bytes: int
    """On the robot's disk."""
    retired: bool
    """True if only its name is left, for lack of space."""


class RecordIndex(Tagged, frozen=True):
    """The recorded runs, oldest first; the last may still run."""

    runs: tuple[RunKept, ...]


Reply = (
    Info
    | Booted
    | Ready
    | ChunkHeld
    | Accepted
    | Rejected
    | Answer
    | LogPage
    | PosePage
    | RecordPage
    | RecordIndex
    | MissionPart
    | Malformed
)
"""All answers of a robot."""

M = TypeVar("M")


def untrusted(error: Exception) -> Rejected:
    """Return the answer to a sender that is not trusted, or not allowed to do this."""
    return Rejected(reason="untrusted", messages=(str(error),))


def encode(message: Any) -> bytes:
    return msgspec.json.encode(message)


def decode(payload: bytes, kind: type[M]) -> M:
    """Return the message in `payload`.

    Raises
    ------
    msgspec.DecodeError
        Whatever is wrong with it; `ValidationError`, which is one, with the JSON path.
    """
    return decoded(payload, kind)


_PLACE = re.compile(rf"(?P<root>(?:.+?/)?sx/{VERSION}/(?P<robot>[^/]+))/(?P<rest>[^\n]*)")


def place_of(key: str) -> tuple[str, str, str]:
    """Return root, robot and rest of a robot's key; raises `ValueError` if it is not one."""
    found = _PLACE.fullmatch(key)
    if found is None:
        raise ValueError(f"{key[:80]!r} is no robot's key")
    return found["root"], found["robot"], found["rest"]


def parts_of(key: str) -> list[str]:
    """Return the parts of a robot's key after its name."""
    return place_of(key)[2].split("/")


def count_of(text: str, *, digits: int = 15) -> int:
    """Return the number in a key or parameter; raises `ValueError` if it is not plain, or too large."""
    if not (text.isascii() and text.isdecimal()) or len(text) > digits:
        raise ValueError(f"{text[:20]!r} is not a number")
    return int(text)
