"""Commands that a vehicle must get because of its run's progress; at most one of them is pending."""

from __future__ import annotations

from stopgo.bridge.mavlink.auto.commanded_standstill import stand
from stopgo.bridge.mavlink.auto.confirmed_commands import SHOWS_S, ConfirmedCommands, Denied
from stopgo.bridge.mavlink.auto.list_guard import ListGuard
from stopgo.bridge.mavlink.auto.logbook import Logbook, PendingCommand
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.mavlink.autopilots.kind import AUTO
from stopgo.mission.mavlink.following import steps as progress
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.observer import Observer
from stopgo.mission.mavlink.following.steps import Observation, tried_again
from stopgo.mission.run import states as runs
from stopgo.mission.run.states import Run


class PendingCommands:
    """Decides on pending commands, and sends them."""

    def __init__(
        self, book: Logbook, peer: Peer, observer: Observer, commands: ConfirmedCommands, guard: ListGuard
    ) -> None:
        self._book = book
        self._peer = peer
        self._observer = observer
        self._commands = commands
        self._guard = guard

    def after_step(self, listed: ListedMission, before: Run, after: Run) -> PendingCommand | None:
        """The command that a step of the run requires; none for a run that somebody else has stopped."""
        since_ns = self._book.clock.now_ns()
        if tried_again(before, after):
            return PendingCommand(command="jump", place=listed.stops[after.at].at, since_ns=since_ns)
        sequence = self._observer.position.sequence or 0
        early = after.state == "FINISHED" and sequence < listed.sequence(listed.end - 1)
        stops = before.state == "RUNNING" and (after.state in ("HELD", "ABORTED") or early)
        if stops and self._observer.status.mode == AUTO:
            return PendingCommand(command="hold", place=0, since_ns=since_ns)
        return None

    def past_skipped(self, run: Run, listed: ListedMission, observed: Observation) -> PendingCommand | None:
        """The command for a vehicle that waits at a skipped stop: it goes on at once."""
        if run.state not in ("RUNNING", "HOMING") or not observed.drives:
            return None
        place = progress.after_skipped(run, listed, observed)
        if place is None:
            return None
        return PendingCommand(command="jump", place=place, since_ns=self._book.clock.now_ns())

    def held_again(self, run: Run, listed: ListedMission, observed: Observation) -> PendingCommand | None:
        """The command for a vehicle that drives another list than the one that was sent: it must stand."""
        if run.state != "HELD" or not observed.drives or not self._guard.difference(listed, run):
            return None
        return PendingCommand(command="hold", place=0, since_ns=self._book.clock.now_ns())

    def hold_before_storing(self, pending: PendingCommand | None) -> None:
        """Send a HOLD once already; it is stored, sent again and confirmed afterwards."""
        if pending is not None and pending.command == "hold":
            self._commands.send_hold()

    def send(self, pending: PendingCommand, listed: ListedMission) -> None:
        """Send a command; a refused one holds the run. It is pending no more after either.

        HOLD is sent until the vehicle reports a standstill: another station may command AUTO meanwhile.

        Raises
        ------
        OutcomeUnknown, RobotUnreachable
            If it is still pending.
        """
        try:
            if pending.command == "hold":
                stand(self._peer, patience_s=SHOWS_S)
            else:
                self._commands.jump(listed.sequence(pending.place))
        except Denied as denied:
            reason = denied.refused.message
            self._book.move(lambda run: () if run.state != "RUNNING" else (runs.held(run, reason),))
        self._book.clear_pending(pending)
