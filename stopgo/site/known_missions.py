"""Missions that robots hold, with the floors and the visibility of their plans in the site's folder."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.floor.polylines import FloorLines
from stopgo.recordings.catalog.run_index import index_of
from stopgo.site.page_drawing import mission_drawing_json

if TYPE_CHECKING:
    from stopgo.recordings.embedded.reading import Recording

MOST_MISSIONS = 64


@dataclass(frozen=True, eq=False)
class KnownMission:
    """A mission, and the recording of its plan if the folder has one."""

    mission: Mission
    recording: Recording | None = None
    trouble: str = ""
    """Reason why floor and coverage are not known; empty if they are."""

    @cached_property
    def drawing(self) -> dict[str, Any]:
        """Drawing for the page; made once."""
        sights = () if self.recording is None else self.recording.sights
        sight = next((one for one in sights if one.digest == self.mission.digest), None)
        return mission_drawing_json(self.mission, _shapes(self.recording), sight) | {"trouble": self.trouble}

    def coverage(self, done: tuple[str, ...], skipped: tuple[str, ...]) -> dict[str, float | None] | None:
        """Return the coverage by the scanned stops, and what skipped ones lose, of all visible."""
        sights = () if self.recording is None else self.recording.sights
        sight = next((one for one in sights if one.digest == self.mission.digest), None)
        if sight is None:
            return None
        whole = sight.coverage(done).whole
        with_skipped = sight.coverage((*done, *skipped)).whole
        lost = None
        if whole.coverage is not None and with_skipped.coverage is not None:
            lost = with_skipped.coverage - whole.coverage
        planned = sight.planned.whole.coverage
        return {"acquired": whole.coverage, "planned": planned, "required": whole.required, "lost": lost}


class KnownMissions:
    """Missions by id and revision, the last used ones."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._reading = threading.Lock()
        self._found: OrderedDict[tuple[str, int], KnownMission] = OrderedDict()

    def get(self, mission_id: str, revision: int) -> KnownMission | None:
        """Return a mission that was added before."""
        with self._lock:
            return self._found.get((mission_id, revision))

    def add(self, mission: Mission) -> KnownMission:
        """Add a mission that a robot holds, and look for its plan in the folder."""
        known = self.get(mission.id, mission.revision)
        if known is not None and known.mission.digest == mission.digest and known.recording is not None:
            return known
        with self._reading:
            made = _with_plan(self._folder, mission)
        with self._lock:
            self._found[mission.id, mission.revision] = made
            self._found.move_to_end((mission.id, mission.revision))
            while len(self._found) > MOST_MISSIONS:
                self._found.popitem(last=False)
        return made


def _with_plan(folder: Path, mission: Mission) -> KnownMission:
    """Return the mission with the newest plan of its id; with the reason if there is none."""
    try:
        from stopgo.recordings.embedded.reading import read_recording
    except ModuleNotFoundError:
        return KnownMission(mission, None, "stopgo[record] is not installed")
    try:
        plans = [
            (plan.revision, name) for name, plan in index_of(folder).plans() if plan.mission_id == mission.id
        ]
        if not plans:
            return KnownMission(mission, None, "no_plan")
        exact = [name for revision, name in plans if revision == mission.revision]
        return KnownMission(mission, read_recording(folder / (exact or [max(plans)[1]])[0]))
    except (InputError, OSError) as error:
        return KnownMission(mission, None, str(error))


def _shapes(recording: Recording | None) -> FloorLines | None:
    if recording is None:
        return None
    from stopgo.recordings.embedded.floor_lines import floor_lines
    from stopgo.recordings.embedded.plan import origin_in

    return floor_lines(recording.values, origin_in(recording))
