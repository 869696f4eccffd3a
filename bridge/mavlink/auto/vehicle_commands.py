"""Commands to a vehicle: decided as a robot decides, carried out by its autopilot, and then stored.

`pause` and `abort` send HOLD before anything is decided, read or stored, and again until the vehicle stands.
No journal delays that, however slow its disk is.

The journal never contains an effect that the vehicle has not shown. While a command is carried out the
journal shows that, so that a process that watches does not take its effects for changes by somebody else.
"""

from __future__ import annotations

import math
import sqlite3
import threading
from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import msgspec

from stopgo.bridge.console import say
from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.auto.commanded_standstill import stand
from stopgo.bridge.mavlink.auto.confirmed_commands import SHOWS_S, ConfirmedCommands, Denied
from stopgo.bridge.mavlink.auto.logbook import Logbook, Ordered
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.robot.answers import answer_to, answered, remember_answer, situation_of
from stopgo.mission.mavlink.autopilots.kind import AUTO, HOLD, why_no_rover
from stopgo.mission.mavlink.following import steps as progress
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.observer import Observer
from stopgo.mission.mavlink.following.resuming import ON_LINE_M, resume_place, route_lines
from stopgo.mission.mavlink.following.steps import Observation, is_replaced
from stopgo.mission.mavlink.local_frame import VehicleOrigin, apart
from stopgo.mission.mavlink.read_back import differences
from stopgo.mission.run import states as runs
from stopgo.mission.run.decision import Decision, decide, handed_over
from stopgo.mission.run.events import Pose
from stopgo.mission.run.lease import Lease
from stopgo.mission.run.run_commands import DRIVING, FREE_VERBS, Answer, Refused, RunCommand, Verb
from stopgo.mission.run.states import Change, Run

ORDERING_NS = 20 * 10**9
"""Longest time of one step of a command; after it, changes count as made by somebody else again."""
PENDING_S = 1.0
"""Time that a process may take to note that a pending command was carried out."""
STOPS_KEPT = 1000
"""Answers to stops of this process that are kept in memory."""
NOWHERE = Pose(x=math.inf, y=math.inf, heading=0.0)
UNREMEMBERED = (
    "no record of a mission pushed to this vehicle; push one by the same URL,"
    " or name the folder of that push with --state"
)
CLEARED = (
    "the vehicle reports no mission: it has lost it in a restart, or somebody has cleared it; push it again"
)
REPLACED = (
    "the vehicle reports {} items, and {} were pushed: somebody has replaced them; push the mission again"
)
HOMEWARD = (
    "an autopilot in AUTO drives its list forward only, and no path back from here is planned; it drives the"
    " mission's return at its end. With stopgo robot --controller mavlink:URL it can drive home"
)


@dataclass(frozen=True)
class Consent:
    """Actions and exceptions that a command must allow explicitly."""

    arm: bool = False
    disarm: bool = False
    any_origin: bool = False
    """The vehicle finds its position by satellites, whatever its origin."""


class VehicleCommands:
    """Carries out commands to one vehicle."""

    def __init__(
        self,
        book: Logbook,
        peer: Peer,
        observer: Observer,
        commands: ConfirmedCommands,
        wall: Clock,
        consent: Consent,
        *,
        stands: bool = False,
    ) -> None:
        """`stands`: the vehicle was commanded to stand, and has reported its standstill."""
        self._book = book
        self._peer = peer
        self._observer = observer
        self._commands = commands
        self._wall = wall
        self._consent = consent
        self._stands = stands
        self._stops: OrderedDict[str, tuple[RunCommand, Answer]] = OrderedDict()
        """Answered stops of this process: one that comes again must not stop a resumed vehicle."""

    def execute(self, order: RunCommand) -> Answer:
        """Carry out a command once, and store the answer.

        Raises
        ------
        OutcomeUnknown
            If the command was sent and the vehicle does not show its effect; nothing is stored then.
        """
        if order.verb in FREE_VERBS:
            return self._stop_once(order)
        before = answered(self._book.journal, order, self._book.run)
        if before is not None:
            return before
        self._await_pending()
        decision = self._conflict(order) or self._decided(order)
        if isinstance(decision, Refused):
            return self._stored(order, decision, None)
        listed = self._book.listed
        assert listed is not None  # `_decided` refuses everything without a mission
        with self._ordering(order):
            try:
                change = VERBS[order.verb](self, order, listed, decision)
            except Denied as denied:
                return self._stored(order, denied.refused, None)
            return self._stored(order, change, decision.lease, decision.note)

    def _stop_once(self, order: RunCommand) -> Answer:
        known = self._stops.get(order.cmd_id)
        if known is not None and known[0] == order:
            return known[1]
        answer = self._stop(order)
        self._stops[order.cmd_id] = (order, answer)
        if len(self._stops) > STOPS_KEPT:
            self._stops.popitem(last=False)
        return answer

    def _stop(self, order: RunCommand) -> Answer:
        """Have the vehicle stand, whatever the run's state; then change the run, if its state allows that."""
        with _Stopping(self._book, ordered_by(order.verb, order.commander)) as stopping:
            try:
                if not self._stands:
                    stand(self._peer, patience_s=SHOWS_S, sent=stopping.note)
                if order.verb == "abort" and self._consent.disarm:
                    self._commands.arm(False)
            except Denied as denied:
                return self._stored(order, denied.refused, None)
            before = answered(self._book.journal, order, self._book.run)
            if before is not None:
                return before
            decision = self._decided(order)
            if isinstance(decision, Refused):
                return self._stored(order, Change(self._book.run), None)
            return self._stored(order, decision.change, decision.lease)

    def _await_pending(self) -> None:
        """Wait a while for the command that the run's progress requires: its HOLD must not follow our AUTO.

        The process that watches sends it; without one it stays pending.
        """
        with self._commands.news:
            self._commands.news.wait_for(lambda: self._book.pending is None, SHOWS_S + PENDING_S)

    def _conflict(self, order: RunCommand) -> Refused | None:
        """Refuse a second command at a time."""
        other = self._book.ordered
        if other is None or other.until_ns <= self._book.clock.now_ns():
            return None
        return Refused("wrong_state", f"{other.verb} by {other.by} is being carried out; wait for its end")

    def _wrong_origin(self, listed: ListedMission) -> Refused | None:
        """Refuse a vehicle whose local frame has not the mission's origin: its position means nothing."""
        if self._consent.any_origin:
            return None
        origin = self._peer.origin() or self._origin_given_again(listed)
        if origin is None:
            return Refused(
                "wrong_origin",
                "the vehicle has no origin (GPS_GLOBAL_ORIGIN), or reports none; set it to the mission's"
                " (stopgo push --set-origin)",
            )
        wrong = apart(listed.sent.origin, origin)
        satellites = "; or add --skip-origin-check, if it finds its position by satellites"
        return Refused("wrong_origin", wrong + satellites) if wrong else None

    def _origin_given_again(self, listed: ListedMission) -> VehicleOrigin | None:
        """Give a vehicle the mission's origin that lost it by a restart during the run; its new origin."""
        if self._book.run.over:
            return None
        site = listed.sent.origin
        origin = self._peer.set_origin(VehicleOrigin(lat=site.lat, lon=site.lon, alt=site.alt))
        if origin is not None:
            say(f"{self._peer}: it had no origin after its restart, and got the mission's again")
            with self._commands.news:
                self._commands.news.wait_for(lambda: self._pose is not None, SHOWS_S)
        return origin

    def _decided(self, order: RunCommand) -> Decision | Refused:
        listed, run = self._book.listed, self._book.run
        if listed is None:
            return Refused("no_mission", UNREMEMBERED)
        items = self._observer.position.items
        if order.verb in DRIVING and items == 0:
            return Refused("no_mission", CLEARED)
        if order.verb in DRIVING and run.state == "READY" and is_replaced(items, listed):
            return Refused("mission_differs", REPLACED.format(items, listed.end))
        wrong_origin = self._wrong_origin(listed) if order.verb in DRIVING else None
        if wrong_origin is not None:
            return wrong_origin
        here = self._pose
        if here is None and order.verb not in FREE_VERBS:
            return Refused("no_position", "the vehicle reports no position; does its navigation run?")
        if here is not None and order.verb != "start":
            here = on_path(run, listed, here)
        situation = situation_of(
            self._book.journal, listed.mission, run=run, pose=here or NOWHERE,
            now_ns=self._book.clock.now_ns(), command_ns=self._wall.now_ns(),
            battery=self._observer.status.health.charge, endurance_s=None, boot_id=self._book.boot_id,
        )  # fmt: skip
        return decide(order, situation)

    # One function per verb

    def _start(self, order: RunCommand, listed: ListedMission, decision: Decision) -> Change:
        run = decision.change.run
        observed = self._observe(run, listed)
        self._ready(listed)
        first = 0 if run.at == 0 else resume_place(run, listed, replace(observed, place=-1), self._here())
        self._go(listed, first, None)
        return decision.change

    def _resume(self, order: RunCommand, listed: ListedMission, decision: Decision) -> Change:
        run = self._book.run
        observed = self._observe(run, listed)
        self._ready(listed)
        lost = run.stop_state == "SCANNING" and not self._scan_goes_on(run, listed, observed)
        run = runs.changed(run, stop_state="WAITING") if lost else run
        self._go(listed, resume_place(run, listed, observed, self._here()), observed)
        return self._resumed(run, order, decision)

    def _resumed(self, run: Run, order: RunCommand, decision: Decision) -> Change:
        """Let the run go on, under its present commander."""
        before = self._book.journal.fact("lease", Lease)
        change = runs.resumed(run, order.commander)
        return Change(change.run, (*handed_over(before, decision.lease), *change.events))

    def _scan_goes_on(self, run: Run, listed: ListedMission, observed: Observation) -> bool:
        items = listed.stops[run.at]
        return items.at < observed.place < items.after

    def _retry(self, order: RunCommand, listed: ListedMission, decision: Decision) -> Change:
        """Drive to the stop again; the vehicle is on the path to it, or next to it."""
        run = runs.changed(self._book.run, stop_state="WAITING", approaches=0)
        observed = self._observe(run, listed)
        self._ready(listed)
        self._go(listed, resume_place(run, listed, observed, self._here()), observed)
        return self._resumed(run, order, decision)

    def _skip(self, order: RunCommand, listed: ListedMission, decision: Decision) -> Change:
        """Skip the stop: the vehicle still drives the path to it, and passes its waits once it is there."""
        before, after = self._book.run, decision.change.run
        observed = self._observe(after, listed)
        beyond = progress.after_skipped(after, listed, observed)
        if after.over:
            self._commands.hold()
        elif before.state == "HELD":
            wrong_origin = self._wrong_origin(listed)
            if wrong_origin is not None:
                raise Denied(wrong_origin)
            self._ready(listed)
            self._go(listed, resume_place(after, listed, observed, self._here()), observed)
        elif before.state == "RUNNING" and beyond is not None:
            self._commands.jump(listed.sequence(beyond))
        return decision.change

    def _home(self, order: RunCommand, listed: ListedMission, decision: Decision) -> Change:
        raise Denied(Refused("unsupported", HOMEWARD))

    # Shared by several verbs

    def _observe(self, run: Run, listed: ListedMission) -> Observation:
        observed = self._observer.observe(run, listed)
        if observed is None:
            raise Denied(Refused("no_position", "the vehicle does not report its current item"))
        return observed

    @property
    def _pose(self) -> Pose | None:
        return self._observer.poses.pose(self._book.clock.now_ns())

    def _here(self) -> Pose:
        return self._pose or NOWHERE

    def _ready(self, listed: ListedMission) -> None:
        """Make the vehicle ready to drive: check that it holds the mission, put it on hold, and arm it.

        In AUTO it would drive off as soon as it is armed, and a mode that is on does not begin again.
        """
        unfit = why_no_rover(self._peer.heartbeat.type)
        if unfit:
            raise Denied(Refused("unsupported", unfit))
        unplaced = self._peer.unplaced()
        if unplaced:
            raise Denied(Refused("no_position", unplaced))
        lasting = self._observer.status.health.lasting(self._book.run.reason)
        if lasting:
            raise Denied(Refused("not_ready", lasting))
        self._check_mission(listed)
        armed = self._observer.status.armed
        if not armed and not self._consent.arm:
            raise Denied(Refused("not_armed", "the vehicle is disarmed; arm it, or add --arm"))
        if self._observer.status.mode == AUTO:
            self._commands.hold()
        if not armed:
            self._commands.arm()

    def _check_mission(self, listed: ListedMission) -> None:
        found = differences(listed.sent, download(self._peer))
        if found:
            more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
            raise Denied(
                Refused("mission_differs", f"not what was pushed: {found[0]}{more}; push the mission again")
            )

    def _go(self, listed: ListedMission, place: int, observed: Observation | None) -> None:
        """Change to AUTO from an item on; if that skips the first ones, set the speed that they contain."""
        restarts = observed is None or observed.place >= listed.end
        jumps = restarts or observed is None or place != observed.place
        if jumps:
            self._commands.jump(listed.sequence(place), reset=restarts)
        self._commands.auto()
        if jumps and place > 0 and listed.speed is not None:
            self._commands.speed(listed.speed)

    # Storing

    def _ordering(self, order: RunCommand) -> _Ordering:
        ordered = ordered_by(order.verb, order.commander)
        return _Ordering(self._book, ordered, self._commands)

    def _stored(
        self, order: RunCommand, outcome: Change | Refused, lease: Lease | None, note: str = ""
    ) -> Answer:
        """Store the answer together with the changes by the command."""
        refused = outcome if isinstance(outcome, Refused) else None
        journal = self._book.journal
        with journal.transaction():
            if isinstance(outcome, Change):
                self._book.move(lambda run: (outcome,) if run != outcome.run else ())
                journal.forget_fact("pending")
            if lease is not None:
                journal.store_fact("lease", lease)
            answer = answer_to(order, refused, self._book.run, note)
            remember_answer(journal, order, answer)
        return answer


def ordered_by(verb: Verb, commander: str, *, until_ns: int = 0) -> Ordered:
    """The note of a command that is carried out until then."""
    return Ordered(verb=verb, by=commander, mode=HOLD if verb in FREE_VERBS else AUTO, until_ns=until_ns)


class _Noted:
    """The note in the journal that a command is being carried out; one with unknown outcome stays there."""

    def __init__(self, book: Logbook, ordered: Ordered) -> None:
        self._book = book
        self._ordered = ordered

    def __exit__(self, kind: object, *exception: object) -> None:
        if kind is None:
            self._book.journal.forget_fact("ordered")
        else:
            self._extend(0)

    def _until(self, ns: int) -> Ordered:
        return msgspec.structs.replace(self._ordered, until_ns=self._book.clock.now_ns() + ns)

    def _extend(self, ns: int) -> None:
        """Show that it is being carried out for this time from now."""
        self._book.journal.store_fact("ordered", self._until(ns))


class _Ordering(_Noted):
    """The note of a command that waits for the journal before each step."""

    def __init__(self, book: Logbook, ordered: Ordered, commands: ConfirmedCommands) -> None:
        super().__init__(book, ordered)
        self._commands = commands

    def __enter__(self) -> None:
        self._commands.working = lambda: self._extend(ORDERING_NS)
        self._commands.working()

    def __exit__(self, kind: object, *exception: object) -> None:
        self._commands.working = lambda: None
        super().__exit__(kind, *exception)


class _Stopping(_Noted):
    """The note of a stop: in memory at once; a thread of its own writes it after the first HOLD was sent."""

    def __enter__(self) -> _Stopping:
        self._book.own_order = self._until(ORDERING_NS)
        self._writing = threading.Thread(target=self._write, daemon=True)
        return self

    def note(self) -> None:
        """Begin to write the note for other processes; do not wait for the journal."""
        self._writing.start()

    def __exit__(self, kind: object, *exception: object) -> None:
        if self._writing.ident is not None:
            self._writing.join()
        self._book.own_order = None
        super().__exit__(kind, *exception)

    def _write(self) -> None:
        with suppress(sqlite3.DatabaseError):  # what follows reports a failed disk
            self._extend(ORDERING_NS)


VERBS: dict[str, Callable[[VehicleCommands, RunCommand, ListedMission, Decision], Change]] = {
    "start": VehicleCommands._start,
    "resume": VehicleCommands._resume,
    "skip": VehicleCommands._skip,
    "retry": VehicleCommands._retry,
    "home": VehicleCommands._home,
}


def on_path(run: Run, listed: ListedMission, pose: Pose) -> Pose:
    """The pose, or the nearest point of the path if the vehicle is within `ON_LINE_M` of it."""
    near = min(route_lines(run, listed), key=lambda piece: piece.away(pose), default=None)
    if near is None or near.away(pose) > ON_LINE_M:
        return pose
    x, y = near.nearest(pose)
    return Pose(x=x, y=y, heading=pose.heading)
