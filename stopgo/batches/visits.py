"""Visits of earlier days: which floor was scanned by which mission, by the recordings of its runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from stopgo.batches.entries import Entry
from stopgo.batches.record import EntryRecord
from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.recordings.catalog.run_index import IndexedRun, index_of

FILE = "missions.json"
LAST = "last"


class PlannedMission(msgspec.Struct, frozen=True):
    """A mission of this or an earlier batch."""

    site: str
    """Floor that it was planned for, such as `tower/EG`."""
    date: str
    """Day of the construction status; empty without one."""
    together: tuple[str, ...] = ()
    """Ids of all missions of its plan, which cover the floor together; empty if it is the only one."""


@dataclass(frozen=True)
class Visits:
    """Runs of the missions of a folder of batches."""

    missions: Mapping[str, PlannedMission]
    """By mission id."""
    runs: Mapping[str, Sequence[IndexedRun]]
    """By mission id, the newest first."""

    def acquired(self, mission_ids: Sequence[str]) -> bool:
        """True if a run of each mission acquired what was required."""
        return bool(mission_ids) and all(
            any(run.answer == "yes" for run in self.runs.get(mission_id, ())) for mission_id in mission_ids
        )

    def begun(self, mission_ids: Sequence[str]) -> list[IndexedRun]:
        """Return the newest run of each mission that has one but was not acquired."""
        found = [self.runs[mission_id] for mission_id in mission_ids if mission_id in self.runs]
        return [runs[0] for runs in found if all(run.answer != "yes" for run in runs)]

    def last_date(self, site: str) -> str | None:
        """Return the newest construction status of a floor that was acquired."""
        dates = [
            mission.date
            for mission_id, mission in self.missions.items()
            if mission.site == site and mission.date and self.acquired(mission.together or [mission_id])
        ]
        return max(dates, default=None)


def read_visits(out: Path, recordings: Path | None) -> Visits:
    """Return the missions of a batch's folder, and their runs in a folder of recordings.

    Raises
    ------
    InputError
        When one of them cannot be read.
    """
    path = out / FILE
    try:
        missions = decoded(path.read_bytes(), dict[str, PlannedMission])
    except FileNotFoundError:
        missions = {}
    except (OSError, msgspec.DecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); remove it, or name another folder") from None
    runs: dict[str, list[IndexedRun]] = {}
    for _, run in () if recordings is None else index_of(recordings).runs():
        runs.setdefault(run.mission_id, []).append(run)
    return Visits(missions, runs)


def note_missions(
    out: Path, before: Visits, entries: Sequence[Entry], records: Sequence[EntryRecord]
) -> None:
    """Add the missions of a batch to those of the folder."""
    sites = {entry.name: (entry.site, entry.settings.date or "") for entry in entries}
    new = {
        mission_id: PlannedMission(*sites[item.name], tuple(item.missions) if len(item.missions) > 1 else ())
        for item in records
        for mission_id in item.missions
    }
    write_atomic(out / FILE, msgspec.json.format(msgspec.json.encode({**before.missions, **new}), indent=1))


def with_since(entries: Sequence[Entry], since: str | None, visits: Visits) -> tuple[list[Entry], list[str]]:
    """Return the entries limited to what was finished since a day, and one sentence per entry left out.

    `since` is a day, or `last`: the construction status of the floor's last acquired run. None: no limit.
    """
    limited, left_out = [], []
    for entry in entries:
        date = entry.settings.date
        day = visits.last_date(entry.site) if since == LAST else since
        if date is None or day is None:
            limited.append(entry)
        elif day >= date:
            left_out.append(f"{entry.name}: scanned at its status of {day}")
        else:
            limited.append(replace(entry, settings=replace(entry.settings, since=day)))
    return limited, left_out
