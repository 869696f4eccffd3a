"""Journal values that every report of a robot needs; the last known ones while the disk does not answer."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from stopgo.bridge.robot.journal import Journal
from stopgo.mission.run.events import AnyEvent
from stopgo.mission.run.lease import Lease

PATIENCE_S = 0.1
"""Longest wait of a report for a transaction."""


class ReportedJournal:
    """Newest event number, events and lease of a journal.

    A disk that has failed or does not answer keeps no robot from its reports.
    """

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self._newest = journal.newest
        self._lease = journal.fact("lease", Lease)

    @property
    def newest(self) -> int:
        with self._free() as free:
            if free:
                self._newest = self._journal.newest
        return self._newest

    @property
    def lease(self) -> Lease | None:
        with self._free() as free:
            if free:
                self._lease = self._journal.fact("lease", Lease)
        return self._lease

    def events(self, *, since: int) -> tuple[AnyEvent, ...]:
        """Return the events after `since`; none while they cannot be read."""
        with self._free() as free:
            if free:
                return self._journal.events(since=since)
        return ()

    @contextmanager
    def _free(self) -> Iterator[bool]:
        with suppress(sqlite3.DatabaseError), self._journal.rows.free_within(PATIENCE_S) as free:
            yield free
