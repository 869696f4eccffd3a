"""What station and robot say to one another: every key and every message, known to this module alone.

Messages are JSON; docs/reference/protocol.md tells them to people. Times that end in `_ns` are
nanoseconds on the robot's clock.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import msgspec

from stopgo.mission.document.decoding import one_decode_error
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
from stopgo.mission.run.orders import Answer, Count, ShortText

VERSION: Final = 1
CHUNK_BYTES: Final = 32 * 1024
"""An order beside a push waits at most for one: 33 ms at 8 Mbit/s."""
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
    """Robot `*` stands for every robot: to ask them or hear them, never to order."""

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
        """Asked every few seconds by whoever watches, who keeps the lease by it if it is theirs."""
        return f"{self.root}/keep"

    @property
    def boot(self) -> str:
        """Asked to find out whether a name is taken."""
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
        """Raw frames: `down` from the vehicle, `up` to it; `alive`, `hello`: the tunnel's end there."""
        return f"{self.root}/mavlink/{what}"

    def robot_of(self, key: str) -> str:
        """The robot whose key this is."""
        return key.removeprefix(self.root.removesuffix(self.robot)).partition("/")[0]


class Tagged(msgspec.Struct, frozen=True, kw_only=True, tag=True, tag_field="is"):
    """Base of most messages: frozen, and says what it is. What a newer peer adds to one is passed over."""


class OwnMap(Transform, frozen=True, forbid_unknown_fields=False):
    """How a robot was told that the site lies on its map; what a newer peer adds to it is passed over."""


class Info(Tagged, frozen=True):
    """What a robot says of itself on `info`."""

    protocol: int
    stopgo: str
    robot: str
    boot_id: str
    clock_ns: Nanoseconds
    """The clock that `valid_for_s` counts on."""
    state: StateReport
    lease: Lease | None
    """The last commander, also when its time is over."""
    chunk_bytes: int
    document_bytes: int
    profiles: tuple[str, ...] | None
    """Scan profiles the scanner knows; `None` if it takes any."""
    to_map: OwnMap | None
    """Site to map, if the robot was told; else each mission's `frame.to_map` counts."""
    capabilities: tuple[str, ...] = ()
    """What it can do beyond the version that it speaks, by name; a robot that tells of none can none."""


class Watching(Tagged, frozen=True):
    """Somebody watches the robot, and keeps the lease if it is theirs; answered with `Info`."""

    commander: ShortText


class Booted(Tagged, frozen=True):
    """Which start of a robot's program answers."""

    boot_id: str


class Manifest(Tagged, frozen=True):
    """What is about to be transferred, on `mission/<id>/begin`."""

    mission_id: ShortText
    revision: Count
    digest: ShortText
    """The mission's own digest."""
    size: Count
    sha256: ShortText
    """Of the transferred bytes."""
    chunk_bytes: Count

    @property
    def chunks(self) -> int:
        return -(-self.size // self.chunk_bytes)


class Ready(Tagged, frozen=True):
    """The robot awaits the chunks that are not in `held`."""

    held: tuple[int, ...]


class ChunkHeld(Tagged, frozen=True):
    index: int
    sha256: str


class Commit(Tagged, frozen=True):
    """Everything has been sent: verify and store it, on `mission/<id>/commit`."""

    manifest: Manifest
    commander: ShortText
    nonce: ShortText
    """Taken once: the same commit may be sent again, but not to undo a later one."""
    not_after_ns: int
    boot_id: ShortText | None = None
    """The start of the robot's program that `not_after_ns` counts in; another refuses what it has not."""
    fence: Count | None = None
    take_over: bool = False


class Accepted(Tagged, frozen=True):
    """The mission is stored on the robot, whole."""

    mission_id: str
    revision: int
    digest: str
    already: bool
    """Whether the robot held exactly this before."""
    waits: bool = False
    """Whether it will be followed from the next stop of the present run on."""


class Rejected(Tagged, frozen=True):
    """The mission was not taken; what the robot held before is unchanged."""

    reason: str
    """One of `Reason`, or what a newer robot calls it."""
    messages: tuple[str, ...]


class MissionPart(Tagged, frozen=True):
    """A piece of the stored mission, read back on `mission/<id>/part/<i>`."""

    manifest: Manifest
    index: int
    data: bytes


class Malformed(Tagged, frozen=True):
    """The request could not be read; nothing was done."""

    message: str


class LogPage(Tagged, frozen=True):
    """Events by number from the journal; `newest` tells whether there are more."""

    bodies: tuple[msgspec.Raw, ...] = msgspec.field(name="events")
    """As the journal has them, also those of kinds that this stopgo does not know."""
    newest: int

    @property
    def events(self) -> tuple[AnyEvent, ...]:
        return tuple(event_of(bytes(body)) for body in self.bodies)


class PosePage(Tagged, frozen=True):
    """Past poses in order; fewer than a page can hold if there are no more."""

    boot_id: str
    """The boot that `seq` and `since` count in."""
    poses: tuple[PoseReport, ...]


class PoseRow(msgspec.Struct, frozen=True, array_like=True):
    """A pose of a record, as an array: what a `PoseReport` tells, but for what all of an entry share."""

    seq: int
    robot_ns: Nanoseconds
    x: float
    y: float
    heading: float
    speed: float


class RecordEntry(msgspec.Struct, frozen=True, kw_only=True):
    """Half a second of a run, as the robot wrote it down; of one boot."""

    number: int
    """From 1 within the run, also over reboots."""
    boot_id: str
    began_ns: Nanoseconds
    """When the run began."""
    poses: tuple[PoseRow, ...] = ()
    states: tuple[StateReport, ...] = ()
    """Those that differ from the one before."""
    health: tuple[Health, ...] = ()
    missing: tuple[PosesMissing, ...] = ()
    """What is not in the record before this."""


class RecordPage(Tagged, frozen=True):
    """Entries of one run's record, by number; `newest` tells whether there are more."""

    run_id: str
    since: int
    """The number before the first entry's."""
    entries: tuple[RecordEntry, ...]
    newest: int
    missing: tuple[PosesMissing, ...] = ()
    """What finds no room at present; an entry tells of it when there is room again."""


class RunKept(msgspec.Struct, frozen=True, kw_only=True):
    """A run of which the robot keeps a record."""

    run_id: str
    entries: int
    bytes: int
    """On the robot's disk."""
    retired: bool
    """Whether only that it was is left, for want of room."""


class RecordIndex(Tagged, frozen=True):
    """The runs that the robot keeps records of, oldest first; the last may be under way."""

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
"""Everything a robot answers with."""

M = TypeVar("M")


def untrusted(error: Exception) -> Rejected:
    """What is answered to those who are not believed, or may not do what they ask."""
    return Rejected(reason="untrusted", messages=(str(error),))


def encode(message: Any) -> bytes:
    return msgspec.json.encode(message)


def decode(payload: bytes, kind: type[M]) -> M:
    """The message in `payload`.

    Raises
    ------
    msgspec.DecodeError
        Whatever is wrong with it; `ValidationError`, which is one, with the JSON path.
    """
    with one_decode_error():
        return msgspec.json.decode(payload, type=kind)


_PLACE = re.compile(rf"(?P<root>(?:.+?/)?sx/{VERSION}/(?P<robot>[^/]+))/(?P<rest>[^\n]*)")


def place_of(key: str) -> tuple[str, str, str]:
    """Root, robot and rest of a robot's key; raises `ValueError` if it is none."""
    found = _PLACE.fullmatch(key)
    if found is None:
        raise ValueError(f"{key[:80]!r} is no robot's key")
    return found["root"], found["robot"], found["rest"]


def parts_of(key: str) -> list[str]:
    """What comes after the robot's name in one of its keys, part by part."""
    return place_of(key)[2].split("/")


def count_of(text: str, *, digits: int = 15) -> int:
    """The number in a key or parameter; raises `ValueError` for anything but a plain, not too large one."""
    if not (text.isascii() and text.isdecimal()) or len(text) > digits:
        raise ValueError(f"{text[:20]!r} is not a number")
    return int(text)
