"""Recordings of one mission, and those that have another mission with its id and revision."""

from __future__ import annotations

from collections.abc import Sequence

from stopgo.mission.errors import InputError
from stopgo.recordings.embedded.reading import Recording


def contradiction(one: Recording, other: Recording) -> str:
    """Return how two recordings have different missions with the same id and revision; empty if they agree."""
    if one.mission_id != other.mission_id:
        return ""
    own = {mission.revision: mission for mission in one.missions}
    for mission in other.missions:
        mine = own.get(mission.revision, mission)
        if mine.digest != mission.digest:
            return (
                f"{other.path.name} has another mission with id {mission.id} and revision {mission.revision}"
                f" (digest {mission.digest[:12]}…, here {mine.digest[:12]}…)"
            )
    return ""


def of_its_mission(recording: Recording, read: Sequence[Recording]) -> list[Recording]:
    """Return the recordings of a recording's mission that agree with it; it is among them."""
    own = [item for item in read if item.mission_id == recording.mission_id]
    return [item for item in own if not contradiction(recording, item)]


def agreeing(read: Sequence[Recording]) -> list[Recording]:
    """Return the recordings without the plans that are of another mission than a run.

    Raises
    ------
    InputError
        Naming two runs, or two plans without a run, that have different missions with one id and revision.
    """
    runs = [item for item in read if item.logs]
    kept = [item for item in read if item.logs or not any(contradiction(run, item) for run in runs)]
    for index, item in enumerate(kept):
        for other in kept[:index]:
            if problem := contradiction(other, item):
                raise InputError(f"{other.path.name}: {problem}; give the recordings of one of them")
    return kept
