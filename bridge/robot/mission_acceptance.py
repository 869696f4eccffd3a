"""Accepting a mission that has arrived whole: to be run, or to be followed from the next stop on."""

from __future__ import annotations

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.link.protocol import Commit, Rejected
from stopgo.bridge.robot.base import Base
from stopgo.bridge.robot.mission_fitness import fitness_inputs, follows, why_unfit
from stopgo.bridge.robot.run_store import RunStore
from stopgo.mission.document import Mission
from stopgo.mission.run import revision
from stopgo.mission.run import states as runs
from stopgo.mission.run.decision import handed_over
from stopgo.mission.run.lease import claimed
from stopgo.mission.run.revision import RevisionPolicy
from stopgo.mission.run.run_commands import Refused
from stopgo.mission.run.states import Change, Run


class MissionAcceptance:
    """Accepts or rejects whole missions; called from the link's threads."""

    def __init__(
        self, store: RunStore, *, base: Base, command_clock: Clock, revisions: RevisionPolicy
    ) -> None:
        self._store = store
        self._base = base
        self._command_clock = command_clock
        self._revisions = revisions

    def take(self, commit: Commit, mission: Mission) -> Rejected | None:
        """Store a whole mission and make it the one to be run, or to be followed from the next stop on.

        Long checks of a long mission are done before, without the lock: a pause or an abort must not wait
        for them. They are repeated if the run has changed meanwhile.
        """
        while True:
            run, held = self._store.snapshot()
            unfit = None
            if not follows(run, mission):
                unfit = why_unfit(mission, base=self._base, run=run, held=held, revisions=self._revisions)
            with self._store.lock:
                if fitness_inputs(run) == fitness_inputs(self._store.run):
                    return self._take(commit, mission, unfit)

    def waits(self, mission: Mission) -> bool:
        """True if the robot will follow the mission from the next stop on."""
        run = self._store.run
        return (run.mission_id, run.next_revision) == (mission.id, mission.revision)

    def _take(self, commit: Commit, mission: Mission, unfit: Refused | None) -> Rejected | None:
        store, before = self._store, self._store.lease
        lease = claimed(
            before, commit.commander,
            fence=commit.fence, take_over=commit.take_over, now_ns=self._command_clock.now_ns(),
        )  # fmt: skip
        if isinstance(lease, Refused):
            return Rejected(reason=lease.reason, messages=(lease.message,))
        known = follows(store.run, mission)
        refused = self._expired(commit, known) or unfit
        if refused:
            return Rejected(reason=refused.reason, messages=(refused.message,))
        change = Change(store.run) if known else _change_to(mission, store.run)
        with store.journal.transaction():
            store.journal.missions.complete_transfer(commit.manifest)
            store.journal.store_nonce(commit.nonce, mission.digest)
            store.store_lease(lease)
            run = store.store(Change(change.run, (*handed_over(before, lease), *change.events)))
            store.journal.missions.retire(
                *((run.mission_id, wanted) for wanted in (run.revision, run.next_revision))
            )
        store.pending.clear()
        if not known:
            store.current.newest = mission
            store.adopt(run, interrupts=run.over)
        return None

    def _expired(self, commit: Commit, known: bool) -> Refused | None:
        """Refuse a commit that comes too late, or a second time; `None` if it is in time."""
        if self._command_clock.now_ns() >= commit.not_after_ns:
            return Refused("expired", "the commit is older than it allows; push again")
        if not known and commit.boot_id not in (None, self._store.boot_id):
            return Refused("expired", "the robot restarted after the commit; push again")
        if not known and self._store.journal.nonce(commit.nonce) is not None:
            return Refused("replayed", "this commit was taken before, and another mission since; push again")
        return None


def _change_to(mission: Mission, run: Run) -> Change:
    """Return the run with the mission installed, or waiting for the next stop."""
    return Change(runs.installed(run, mission)) if run.over else revision.waits(run, mission)
