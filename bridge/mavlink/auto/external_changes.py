"""Changes to a vehicle by somebody else: another mission, a run begun elsewhere, another mode."""

from __future__ import annotations

import uuid

from stopgo.bridge.mavlink.auto.list_guard import ListGuard
from stopgo.bridge.mavlink.auto.logbook import Logbook, Ordered
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.mavlink.autopilots.kind import AUTO
from stopgo.mission.mavlink.following import steps as progress
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.observer import Observer
from stopgo.mission.mavlink.following.progress_watch import STALLED_S
from stopgo.mission.mavlink.following.steps import SOMEBODY, Observation
from stopgo.mission.mavlink.local_frame import apart
from stopgo.mission.run import states as runs
from stopgo.mission.run.states import Change, Run

SETTLED_NS = 1_500_000_000
"""A heartbeat this soon after a change of the run may have been sent before it."""
REMEMBERED_NS = 60 * 10**9
"""Time for which a command with unknown outcome counts as the cause of a change of mode."""


class ExternalChanges:
    """Finds the change to a run that somebody else has caused, with the name of who caused it if known."""

    def __init__(self, book: Logbook, peer: Peer, observer: Observer, guard: ListGuard) -> None:
        self._book = book
        self._peer = peer
        self._observer = observer
        self._guard = guard
        self._was_at_mission = False
        """True while the vehicle has the mission's origin, or a run goes on that began with it."""

    def change(self, run: Run, listed: ListedMission, observed: Observation) -> Change | None:
        """The change by somebody else, once the vehicle's mode has settled and is explained."""
        settled = self._observer.status.mode_ns >= self._book.changed_ns + SETTLED_NS
        if not (settled and self._observer.mode_explained(self._book.clock.now_ns())):
            return None
        if self._peer.foreign.awaits_channels(self._mode_age_s):
            return None
        if self._guard.difference(listed, run):  # then no mode of the vehicle lets the run go on
            return self.changed_list(run, listed)
        return (
            self._begun_elsewhere(run, listed, observed)
            or self._misplaced(run, listed, observed)
            or progress.taken_over(run, listed, observed, by=self._by(observed))
            or self._set_back(run, listed, observed)
            or self._stalled(run, listed, observed)
        )

    def _misplaced(self, run: Run, listed: ListedMission, observed: Observation) -> Change | None:
        """Hold the run of a vehicle whose origin was the mission's and was moved: positions count from there.

        One that finds its position by satellites may have another origin from the start.
        """
        origin = self._observer.poses.origin
        if origin is None:
            return None
        wrong = apart(listed.sent.origin, origin)
        if not wrong or run.state != "RUNNING":
            self._was_at_mission = not wrong
        if not (wrong and self._was_at_mission and run.state == "RUNNING" and observed.drives):
            return None
        return runs.held(run, f"somebody has moved the vehicle's origin: {wrong}; then retry")

    def _set_back(self, run: Run, listed: ListedMission, observed: Observation) -> Change | None:
        """Hold the run of a vehicle whose item somebody has set back, to a leg that lies behind the run's."""
        position = self._observer.position
        if not observed.drives or observed.place >= listed.end or not position.went_back:
            return None
        if run.state == "HOMING":  # whatever was set before the run went on is not meant
            is_behind = observed.place < listed.stops[-1].after and position.since_ns > self._book.changed_ns
        else:
            is_behind = run.state == "RUNNING" and observed.place < _first_of(run, listed)
        if not is_behind:
            return None
        if not self._guard.is_ours(listed, position.since_ns):
            self._guard.want()  # another list, perhaps: that is said first
            return None
        stop = listed.sent.placed[observed.place].stop
        to = f" (to {stop}, which is behind)" if stop else ""
        on = listed.stops[run.at].stop if run.at < len(listed.stops) else "the end"
        return runs.held(
            run,
            f"{self._item_set_by(position.since_ns)} has set the vehicle's current item back to"
            f" {listed.sequence(observed.place)}{to}; retry drives on to {on}",
        )

    def _stalled(self, run: Run, listed: ListedMission, observed: Observation) -> Change | None:
        """Hold the run of a vehicle that stands, although its mode, its item and no command explain it."""
        stalled_s = self._observer.progress.stalled_s(listed)
        if run.state not in ("RUNNING", "HOMING") or not observed.drives or stalled_s < STALLED_S:
            return None
        stop = listed.sent.placed[observed.place].stop
        return runs.held(
            run,
            f"the vehicle has stood in AUTO for {stalled_s:.0f} s at item {listed.sequence(observed.place)}"
            f"{f' (to {stop})' if stop else ''}: it neither drives nor turns, and no wait explains it;"
            " see what stops it, then retry",
        )

    def changed_list(self, run: Run, listed: ListedMission) -> Change | None:
        """Hold the run, if the vehicle's list is not the one that was sent."""
        if run.over or run.state == "HELD":
            return None
        why = self._guard.difference(listed, run)
        return runs.held(run, f"{why}; push it again (stopgo push), then retry") if why else None

    def _begun_elsewhere(self, run: Run, listed: ListedMission, observed: Observation) -> Change | None:
        """Start the run, if the vehicle drives the list that it was sent without a start from here."""
        by = self._by(observed)
        ours = by != SOMEBODY or self._guard.is_compared(listed)
        if run.state != "READY" or not observed.drives or observed.place >= listed.end or not ours:
            return None
        now_ns = self._book.clock.now_ns()
        return runs.started(run, run_id=uuid.uuid4().hex[:12], now_ns=now_ns, by=by)

    def _by(self, observed: Observation) -> str:
        """Author of a change of mode, or of disarming.

        First the author of a recent command for it whose outcome was unknown, then a station whose command
        was heard. A remote control counts only without a failsafe, which may move its channels itself.
        """
        ordered, foreign, age_s = self._book.ordered, self._peer.foreign, self._mode_age_s
        if ordered is not None and self._recent(ordered) and ordered.mode == observed.mode:
            return ordered.by
        if observed.mode == AUTO and not observed.armed:
            station = foreign.station("arming", age_s)
        else:
            station = foreign.station("mode", age_s, self._peer.autopilot.mode_of(self._peer.heartbeat))
        return station or ("" if observed.failsafe else foreign.remote_control(age_s)) or SOMEBODY

    @property
    def _mode_age_s(self) -> float:
        """Seconds since the vehicle was first seen in its present mode."""
        return (self._book.clock.now_ns() - self._observer.status.mode_began_ns) / 1e9

    def jumped_by(self) -> str:
        """Author of a jump to an item beyond the run's stop."""
        return self._item_set_by(self._observer.position.jumped_ns)

    def _item_set_by(self, seen_ns: int) -> str:
        """Author of a change of the current item, which was seen then."""
        age_s = (self._book.clock.now_ns() - seen_ns) / 1e9
        return self._peer.foreign.station("item", age_s) or SOMEBODY

    def _recent(self, ordered: Ordered) -> bool:
        return self._book.clock.now_ns() < ordered.until_ns + REMEMBERED_NS


def _first_of(run: Run, listed: ListedMission) -> int:
    """Return the first item of the run's leg; 0 once all stops are behind."""
    return listed.stops[min(run.leg, run.at)].first if run.at < len(listed.stops) else 0
