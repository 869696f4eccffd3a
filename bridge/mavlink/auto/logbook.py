"""Logbook of a vehicle, in a folder of the station: the mission that it was sent, and its run.

Every process that communicates with the vehicle opens the same folder, one after another or at the same time.
A process moves the run on only from the state in the journal. So two that see the same thing store it once,
and no run goes back.
"""

from __future__ import annotations

import hashlib
import re
import shlex
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Literal

import msgspec
from msgspec.structs import replace

from stopgo.bridge.link.clock import Clock, WallClock
from stopgo.bridge.link.protocol import CHUNK_BYTES, Manifest
from stopgo.bridge.mavlink.auto.vehicle_boots import VehicleBoots
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.journal_file import owner_of, shared_journal
from stopgo.mission.console.state_folder import state_folder
from stopgo.mission.document import Mission
from stopgo.mission.document.decoding import decoded, unpacked
from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.following.capture_reports import ScanFile
from stopgo.mission.mavlink.following.listed_mission import ListedMission, listed_mission
from stopgo.mission.mavlink.items import ItemList
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import Aborted, Scanned
from stopgo.mission.run.states import Change, Run


class Sent(msgspec.Struct, frozen=True, kw_only=True):
    """The mission that was sent to the vehicle, and the list of items that carried it."""

    mission_id: str
    revision: int
    sha256: str
    """Digest of the items."""
    digest: str = ""
    """Digest of the mission; empty in a record of an earlier version."""


class PackedItems(msgspec.Struct, frozen=True):
    """An `ItemList` as msgpack, which knows NaN."""

    packed: bytes


class Ordered(msgspec.Struct, frozen=True, kw_only=True):
    """A command that a process is carrying out: its effects are not changes by somebody else."""

    verb: str
    by: str
    mode: str
    """The mode that the command leads to."""
    until_ns: int
    """Time after which no process is carrying it out any more."""


class PendingCommand(msgspec.Struct, frozen=True, kw_only=True):
    """A command that the vehicle must get because of the run's progress."""

    command: Literal["hold", "jump"]
    place: int
    since_ns: int


class Used(msgspec.Struct, frozen=True, kw_only=True):
    """The last scan that was used; before the first one, the vehicle's time when the run began."""

    boot_id: str
    index: int
    boot_ms: int


class Moved(msgspec.Struct, frozen=True, kw_only=True):
    """The vehicle's time when the run last changed, as the station knew it that stored the change."""

    boot_id: str
    boot_ms: int


class Moment(msgspec.Struct, frozen=True):
    at_ns: int


class Logbook:
    """One vehicle's run in the station's journal."""

    def __init__(self, journal: Journal, robot: str, clock: Clock, address: str = "") -> None:
        """`address`: options of a command to this vehicle, after a space."""
        self.journal = journal
        self.robot = robot
        self.clock = clock
        self.boots = VehicleBoots(journal)
        self.address = address
        self.own_order: Ordered | None = None
        """The command that this process carries out; it counts before the journal has it."""
        self._listed: tuple[Sent, ListedMission] | None = None
        self._scanned: tuple[tuple[str | None, tuple[str, ...]], frozenset[ScanFile]] = (
            (None, ()), frozenset(),
        )  # fmt: skip

    @property
    def run(self) -> Run:
        return self.journal.fact("run", Run) or Run()

    @property
    def listed(self) -> ListedMission | None:
        """The mission that was sent last, with its items; the same object until another was sent."""
        sent = self.journal.fact("sent", Sent)
        if sent is None:
            return None
        if self._listed is None or self._listed[0] != sent:
            self._listed = (sent, self._read_listed(sent))
        return self._listed[1]

    def _read_listed(self, sent: Sent) -> ListedMission:
        stored = self.journal.missions.read(sent.mission_id, sent.revision)
        items = self.journal.fact("items", PackedItems)
        assert stored is not None and items is not None
        mission = decoded(stored[1], Mission)
        return listed_mission(mission, unpacked(items.packed, ItemList), self.address)

    def was_sent(self, mission: Mission, sent: ItemList) -> bool:
        """True if this very mission was the last that was sent, as this list."""
        last, manifest = self.journal.fact("sent", Sent), None
        if last is not None:
            manifest = self.journal.missions.manifest(last.mission_id, last.revision)
        if last is None or manifest is None:
            return False
        return replace(last, digest=last.digest or manifest.digest) == _record(mission, sent)

    def scanned_files(self, run: Run) -> frozenset[ScanFile]:
        """Name and sha256 of each scan that has counted in the run."""
        if self._scanned[0] != (run.run_id, run.done):
            events = self.journal.events(run_id=run.run_id) if run.run_id else ()
            files = frozenset((event.file, event.sha256) for event in events if isinstance(event, Scanned))
            self._scanned = (run.run_id, run.done), files
        return self._scanned[1]

    @property
    def boot_id(self) -> str:
        """Id of the vehicle's last boot."""
        return self.boots.boot_id

    def move(self, moved: Callable[[Run], tuple[Change, ...]], pending: PendingAfter | None = None) -> Run:
        """Store the changes of the run; `moved` computes them from the stored run.

        `pending` computes the command that a change requires of the vehicle; it is stored with the change.
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
        self.journal.store_fact("moved", Moved(boot_id=self.boot_id, boot_ms=self.boots.boot_ms))
        if run.run_id != before.run_id:
            self.use(-1, self.boots.boot_ms)
        if run.state != before.state:
            self.journal.store_fact("changed", Moment(now_ns))

    @property
    def is_behind(self) -> bool:
        """True if the run was changed by reports that have come to another station, and not yet here."""
        moved = self.journal.fact("moved", Moved)
        if moved is None or moved.boot_id != self.boot_id:
            return False
        return 0 < self.boots.boot_ms <= moved.boot_ms

    @property
    def used(self) -> tuple[int, int]:
        """Number and time of the last scan that was used, if that was in this boot; else -1, -1."""
        used = self.journal.fact("used", Used)
        return (used.index, used.boot_ms) if used and used.boot_id == self.boot_id else (-1, -1)

    def use(self, index: int, boot_ms: int) -> None:
        """Count that scan, or all before that time, no more."""
        self.journal.store_fact("used", Used(boot_id=self.boot_id, index=index, boot_ms=boot_ms))

    @property
    def changed_ns(self) -> int:
        """Time of the last change of the run's state."""
        moment = self.journal.fact("changed", Moment)
        return moment.at_ns if moment else 0

    @property
    def ordered(self) -> Ordered | None:
        """The command that is being carried out, or was the last."""
        return self.own_order or self.journal.fact("ordered", Ordered)

    @property
    def pending(self) -> PendingCommand | None:
        return self.journal.fact("pending", PendingCommand)

    def clear_pending(self, pending: PendingCommand) -> None:
        """Forget a command that was carried out, unless another one is pending already."""
        with self.journal.transaction():
            if self.pending == pending:
                self.journal.forget_fact("pending")


PendingAfter = Callable[[Run, Run], PendingCommand | None]


def remember(book: Logbook, mission: Mission, sent: ItemList) -> None:
    """Store that the vehicle holds this mission as this list; a run that is not over ends."""
    document = msgspec.json.encode(mission)
    manifest = Manifest(
        mission_id=mission.id, revision=mission.revision, digest=mission.digest, size=len(document),
        sha256=hashlib.sha256(document).hexdigest(), chunk_bytes=CHUNK_BYTES,
    )  # fmt: skip
    listed_mission(mission, sent)
    with book.journal.transaction():
        book.journal.missions.store(manifest, document)
        book.move(lambda run: () if run.over else (_replaced(run, "a mission was pushed to the vehicle"),))
        book.journal.store_fact("run", runs.installed(book.run, mission))
        book.journal.store_fact("sent", _record(mission, sent))
        book.journal.store_fact("items", PackedItems(msgspec.msgpack.encode(sent)))
        book.journal.forget_fact("pending")


def _record(mission: Mission, sent: ItemList) -> Sent:
    """Return the record of a mission; by its bytes a list equals itself, although it contains NaN."""
    packed = hashlib.sha256(msgspec.msgpack.encode(sent)).hexdigest()
    return Sent(mission_id=mission.id, revision=mission.revision, sha256=packed, digest=mission.digest)


def forget(book: Logbook) -> None:
    """Store that the vehicle holds no mission any more; a run that is not over ends."""
    with book.journal.transaction():
        book.move(lambda run: () if run.over else (_replaced(run, "the vehicle's mission was cleared"),))
        book.journal.store_fact("run", Run())
        for name in ("sent", "items", "pending"):
            book.journal.forget_fact(name)


def _replaced(run: Run, reason: str) -> Change:
    over = runs.changed(run, state="ABORTED", reason=reason)
    return Change(over, (partial(Aborted, reason=over.reason),))


@contextmanager
def logbook(url: Url, vehicle: int, state: Path | None = None, *, make: bool = True) -> Iterator[Logbook]:
    """The logbook of the vehicle with this system id at `url`; in `state`, if given.

    Raises
    ------
    InputError
        If the folder cannot be used, belongs to another vehicle, or is missing and must not be made.
    """
    robot, folder = name_of(vehicle), state or usual_folder(url, vehicle)
    if not make and not folder.is_dir():
        raise InputError(f"--state {folder}: there is no such folder; name the folder of the push")
    with shared_journal(folder, robot) as journal:
        wall = WallClock()
        clock = WallClock(origin_ns=max(wall.now_ns(), journal.newest_ns + 1))
        options = "" if state is None else f" --state {shlex.quote(str(state))}"
        yield Logbook(journal, robot, clock, f" --mavlink {url}{options}")


def name_of(vehicle: int) -> str:
    """Name of the robot with this system id."""
    return f"mavlink-{vehicle}"


def usual_folder(url: Url, vehicle: int) -> Path:
    """Folder `$XDG_STATE_HOME/stopgo/…`, named by URL and vehicle."""
    return state_folder() / f"{re.sub(r'[^A-Za-z0-9.-]+', '-', str(url))}-vehicle-{vehicle}"


def recorded_vehicles(url: Url, state: Path | None = None) -> tuple[int, ...]:
    """System ids of the vehicles at `url` with a usual folder, or of the vehicle of a named folder."""
    if state is not None:
        owner, stem = owner_of(state) or "", name_of(0).removesuffix("0")
        return (int(end),) if (end := owner.removeprefix(stem)).isdecimal() and end != owner else ()
    folder = usual_folder(url, 0)
    stem = folder.name.removesuffix("0")
    ends = (path.name.removeprefix(stem) for path in folder.parent.glob(f"{stem}*"))
    return tuple(sorted(int(end) for end in ends if end.isdecimal()))
