"""What a vehicle cannot remember, in a folder of the station: the mission it was sent, and what became of it.

Every process that talks to the vehicle opens the same folder, one after another or at the same time. What a
process sees moves the run on only from where the journal says that it is: so two that see the same tell it
once, and none goes back.
"""

from __future__ import annotations

import hashlib
import os
import re
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Literal

import msgspec

from stopgo.bridge.link.clock import Clock, WallClock
from stopgo.bridge.link.protocol import CHUNK_BYTES, Manifest
from stopgo.bridge.mavlink.line.url import Url
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.journal_file import shared_journal
from stopgo.mission.document import Mission
from stopgo.mission.mavlink.following.listed_mission import ListedMission, listed_mission
from stopgo.mission.mavlink.items import ItemList
from stopgo.mission.mavlink.telemetry import BACK_MS
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import Aborted
from stopgo.mission.run.states import Change, Run

REBOOT_NS = 5 * 10**9
"""A vehicle whose clock began so much later than it was known to was started anew."""


class Sent(msgspec.Struct, frozen=True, kw_only=True):
    """The list by which the vehicle was sent its mission."""

    mission_id: str
    revision: int
    sha256: str
    """Of the items."""


class PackedItems(msgspec.Struct, frozen=True):
    """An `ItemList` as msgpack, which knows NaN."""

    packed: bytes


class Boot(msgspec.Struct, frozen=True, kw_only=True):
    """Since when the vehicle is on."""

    boot_id: str
    began_ns: int
    """At the latest, on the station's clock."""


class Ordered(msgspec.Struct, frozen=True, kw_only=True):
    """An order that a process is carrying out: what the vehicle does meanwhile is not somebody else's."""

    verb: str
    by: str
    mode: str
    """The one the vehicle is to end in."""
    until_ns: int
    """Then nobody is carrying it out any more."""


class PendingCommand(msgspec.Struct, frozen=True, kw_only=True):
    """What the vehicle must be told because of what the run has come to."""

    command: Literal["hold", "jump"]
    place: int
    since_ns: int


class Used(msgspec.Struct, frozen=True, kw_only=True):
    """The scan that was taken last; before it, the vehicle's time when the run began."""

    boot_id: str
    index: int
    boot_ms: int


class Moment(msgspec.Struct, frozen=True):
    at_ns: int


class Logbook:
    """One vehicle's run, as the station's journal has it."""

    def __init__(self, journal: Journal, robot: str, clock: Clock) -> None:
        self.journal = journal
        self.robot = robot
        self.clock = clock
        self.boot_ms = 0
        """The vehicle's time since it was started, as last told."""
        self._listed: tuple[Sent, ListedMission] | None = None

    @property
    def run(self) -> Run:
        return self.journal.fact("run", Run) or Run()

    @property
    def listed(self) -> ListedMission | None:
        """The mission that was sent last, and how; the same object until another was."""
        sent = self.journal.fact("sent", Sent)
        if sent is None:
            return None
        if self._listed is None or self._listed[0] != sent:
            self._listed = (sent, self._read_course(sent))
        return self._listed[1]

    def _read_course(self, sent: Sent) -> ListedMission:
        stored = self.journal.missions.read(sent.mission_id, sent.revision)
        items = self.journal.fact("items", PackedItems)
        assert stored is not None and items is not None
        mission = msgspec.json.decode(stored[1], type=Mission)
        return listed_mission(mission, msgspec.msgpack.decode(items.packed, type=ItemList))

    @property
    def boot_id(self) -> str:
        boot = self.journal.fact("boot", Boot)
        return boot.boot_id if boot else "unknown"

    def booted(self, began_ns: int, *, went_back: bool = False) -> bool:
        """Told when the vehicle's clock began: whether it was started anew since anybody last looked.

        A clock that was seen to go back is believed sooner.
        """
        boot, slack_ns = self.journal.fact("boot", Boot), BACK_MS * 10**6 if went_back else REBOOT_NS
        if boot is not None and boot.began_ns <= began_ns <= boot.began_ns + slack_ns:
            return False
        with self.journal.transaction():
            boot = self.journal.fact("boot", Boot)
            anew = boot is None or began_ns > boot.began_ns + slack_ns
            boot_id = uuid.uuid4().hex[:12] if boot is None or anew else boot.boot_id
            self.journal.store_fact("boot", Boot(boot_id=boot_id, began_ns=began_ns))
        return anew and boot is not None

    def move(self, moved: Callable[[Run], tuple[Change, ...]], pending: PendingAfter | None = None) -> Run:
        """Store all that has happened to the run; `moved` says what, from the run as it is stored.

        `pending` tells what each change wants of the vehicle; it is stored with it.
        """
        if not moved(self.run):
            return self.run
        with self.journal.transaction():
            run = self.run
            for change in moved(run):
                self._put(change)
                command = pending(run, change.run) if pending else None
                if command is not None:
                    self.journal.store_fact("pending", command)
                run = change.run
        return run

    def _put(self, change: Change) -> None:
        now_ns, run, before = self.clock.now_ns(), change.run, self.run
        self.journal.store_change(change, robot=self.robot, boot_id=self.boot_id, now_ns=now_ns)
        if run.run_id != before.run_id:
            self.use(-1, self.boot_ms)
        if run.state != before.state:
            self.journal.store_fact("changed", Moment(now_ns))

    @property
    def used(self) -> tuple[int, int]:
        """Number and time of the scan that was taken last; none of this boot's if it was before."""
        used = self.journal.fact("used", Used)
        return (used.index, used.boot_ms) if used and used.boot_id == self.boot_id else (-1, -1)

    def use(self, index: int, boot_ms: int) -> None:
        """That scan, or what was before that time, counts no more."""
        self.journal.store_fact("used", Used(boot_id=self.boot_id, index=index, boot_ms=boot_ms))

    @property
    def changed_ns(self) -> int:
        """When the run's state last changed."""
        moment = self.journal.fact("changed", Moment)
        return moment.at_ns if moment else 0

    @property
    def ordered(self) -> Ordered | None:
        """The order that is being carried out, or was the last."""
        return self.journal.fact("ordered", Ordered)

    @property
    def pending(self) -> PendingCommand | None:
        return self.journal.fact("pending", PendingCommand)

    def clear_pending(self, pending: PendingCommand) -> None:
        """The vehicle was told; unless something else is pending already."""
        with self.journal.transaction():
            if self.pending == pending:
                self.journal.forget_fact("pending")


PendingAfter = Callable[[Run, Run], PendingCommand | None]


def remember(book: Logbook, mission: Mission, sent: ItemList) -> None:
    """The vehicle holds this mission now, as this list; a run of another, or of this, is over with it."""
    document = msgspec.json.encode(mission)
    manifest = Manifest(
        mission_id=mission.id, revision=mission.revision, digest=mission.digest, size=len(document),
        sha256=hashlib.sha256(document).hexdigest(), chunk_bytes=CHUNK_BYTES,
    )  # fmt: skip
    packed = msgspec.msgpack.encode(sent)
    told = Sent(mission_id=mission.id, revision=mission.revision, sha256=hashlib.sha256(packed).hexdigest())
    listed_mission(mission, sent)
    with book.journal.transaction():
        book.journal.missions.store(manifest, document)
        book.move(lambda run: () if run.over else (_replaced(run, "a mission was pushed to the vehicle"),))
        book.journal.store_fact("run", runs.installed(book.run, mission))
        book.journal.store_fact("sent", told)
        book.journal.store_fact("items", PackedItems(packed))
        book.journal.forget_fact("pending")


def forget(book: Logbook) -> None:
    """The vehicle holds no mission any more; a run is over with it."""
    with book.journal.transaction():
        book.move(lambda run: () if run.over else (_replaced(run, "the vehicle's mission was cleared"),))
        book.journal.store_fact("run", Run())
        for name in ("sent", "items", "pending"):
            book.journal.forget_fact(name)


def _replaced(run: Run, reason: str) -> Change:
    over = runs.changed(run, state="ABORTED", reason=reason)
    return Change(over, (partial(Aborted, reason=over.reason),))


@contextmanager
def logbook(url: Url, vehicle: int, state: Path | None = None) -> Iterator[Logbook]:
    """The logbook of the vehicle with this system id at `url`; in `state`, if given.

    Raises
    ------
    InputError
        If the folder cannot be used, or belongs to another vehicle.
    """
    robot = name_of(vehicle)
    with shared_journal(state or usual_folder(url, vehicle), robot) as journal:
        wall = WallClock()
        yield Logbook(journal, robot, WallClock(origin_ns=max(wall.now_ns(), journal.newest_ns + 1)))


def name_of(vehicle: int) -> str:
    """What the robot with this system id is called."""
    return f"mavlink-{vehicle}"


def usual_folder(url: Url, vehicle: int) -> Path:
    """`$XDG_STATE_HOME/stopgo/…`, named by URL and vehicle."""
    home = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(home) / "stopgo" / f"{re.sub(r'[^A-Za-z0-9.-]+', '-', str(url))}-vehicle-{vehicle}"
