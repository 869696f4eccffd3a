"""Journal values that every report of a robot needs; the last known ones while the disk cannot be read."""

from __future__ import annotations

import sqlite3
from contextlib import suppress

from stopgo.bridge.robot.journal import Journal
from stopgo.mission.run.events import AnyEvent
from stopgo.mission.run.lease import Lease


class ReportedJournal:
    """Newest event number, events and lease of a journal; a failed disk keeps no robot from its reports."""

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self._newest = journal.newest
        self._lease = journal.fact("lease", Lease)

    @property
    def newest(self) -> int:
        with suppress(sqlite3.DatabaseError):
            self._newest = self._journal.newest
        return self._newest

    @property
    def lease(self) -> Lease | None:
        with suppress(sqlite3.DatabaseError):
            self._lease = self._journal.fact("lease", Lease)
        return self._lease

    def events(self, *, since: int) -> tuple[AnyEvent, ...]:
        """Return the events after `since`; none while they cannot be read."""
        try:
            return self._journal.events(since=since)
        except sqlite3.DatabaseError:
            return ()
