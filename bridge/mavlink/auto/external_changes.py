"""Changes to a vehicle by somebody else: another mission, a run begun elsewhere, another mode."""

from __future__ import annotations

import uuid
from contextlib import suppress

from stopgo.bridge.mavlink.auto.logbook import Logbook, Ordered
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.errors import NegativeResult, RobotUnreachable
from stopgo.mission.mavlink.following import steps as progress
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.observer import Observer
from stopgo.mission.mavlink.following.steps import SOMEBODY, Observation
from stopgo.mission.mavlink.read_back import differences
from stopgo.mission.run import states as runs
from stopgo.mission.run.states import Change, Run

SETTLED_NS = 1_500_000_000
"""A heartbeat this soon after a change of the run may have been sent before it."""
REMEMBERED_NS = 60 * 10**9
"""Time for which a command with unknown outcome counts as the cause of a change of mode."""


class ExternalChanges:
    """Finds the change to a run that somebody else has caused, with the name of who caused it if known."""

    def __init__(self, book: Logbook, peer: Peer, observer: Observer) -> None:
        self._book = book
        self._peer = peer
        self._observer = observer
        self._difference: str | None = None
        """Difference between the vehicle's list and the one that was sent; `None` before a comparison."""

    def compare_list(self) -> None:
        """Compare the vehicle's list with the one that was sent, unless the vehicle does not send it now."""
        listed, state = self._book.listed, self._book.run.state
        if listed is None or state in ("FINISHED", "ABORTED"):
            return
        with suppress(NegativeResult, RobotUnreachable):
            self._difference = next(iter(differences(listed.sent, download(self._peer))), "")

    def change(self, run: Run, listed: ListedMission, observed: Observation) -> Change | None:
        """The change by somebody else, once the vehicle's mode has settled and is explained."""
        settled = self._observer.mode_ns >= self._book.changed_ns + SETTLED_NS
        if not (settled and self._observer.mode_explained(self._book.clock.now_ns())):
            return None
        return (
            self.changed_list(run, listed)
            or self._begun_elsewhere(run, listed, observed)
            or progress.taken_over(run, listed, observed, by=self._by(observed))
        )

    def changed_list(self, run: Run, listed: ListedMission) -> Change | None:
        """Hold the run, if the vehicle's list is not the one that was sent."""
        if run.over or run.state == "HELD":
            return None
        items, why = self._observer.items, self._difference
        if items is not None and items != listed.end:
            why = f"it holds {items} items, {listed.end} were sent"
        return runs.held(run, f"somebody has changed the vehicle's mission: {why}") if why else None

    def _begun_elsewhere(self, run: Run, listed: ListedMission, observed: Observation) -> Change | None:
        """Start the run, if the vehicle drives the list that it was sent without a start from here."""
        by = self._by(observed)
        ours = by != SOMEBODY or self._difference == ""
        if run.state != "READY" or not observed.drives or observed.place >= listed.end or not ours:
            return None
        now_ns = self._book.clock.now_ns()
        return runs.started(run, run_id=uuid.uuid4().hex[:12], now_ns=now_ns, by=by)

    def _by(self, observed: Observation) -> str:
        """Who changed the mode: the author of a recent command for it whose outcome was unknown."""
        ordered = self._book.ordered
        if ordered is None or not self._recent(ordered) or ordered.mode != observed.mode:
            return SOMEBODY
        return ordered.by

    def _recent(self, ordered: Ordered) -> bool:
        return self._book.clock.now_ns() < ordered.until_ns + REMEMBERED_NS
