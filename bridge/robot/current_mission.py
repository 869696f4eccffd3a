"""The mission that a robot's run follows, read from the journal when the run goes over to another."""

from __future__ import annotations

from collections.abc import Callable

from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.mission_reading import read_mission
from stopgo.mission.document import Mission
from stopgo.mission.run.states import Run


class CurrentMission:
    """The mission of the current run; used under the lock of the run."""

    def __init__(self, journal: Journal, mission_taken: Callable[[Mission], None]) -> None:
        """`mission_taken` is called with each mission that the run begins to follow."""
        self._journal = journal
        self._mission_taken = mission_taken
        self.mission: Mission | None = None
        self.newest: Mission | None = None
        """The mission that was accepted last; it is not read from the journal again."""

    def follow(self, run: Run) -> None:
        """Make the run's mission the current one."""
        current = self.mission
        if (run.mission_id, run.revision) == (current and current.id, current and current.revision):
            return
        self.mission = self.accepted(run.mission_id, run.revision)
        if self.mission is not None:
            self._mission_taken(self.mission)

    def accepted(self, mission_id: str | None, revision: int | None) -> Mission | None:
        """Return a mission that the robot accepted before; `None` if the journal does not have it."""
        newest = self.newest
        if newest is not None and (newest.id, newest.revision) == (mission_id, revision):
            return newest
        stored = None if mission_id is None else self._journal.missions.read(mission_id, revision or 0)
        return None if stored is None else read_mission(stored[1])
