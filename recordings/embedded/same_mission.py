"""Recordings of one mission, and those that have another mission with its id and revision."""

from __future__ import annotations

from collections.abc import Sequence

from stopgo.mission.errors import InputError
from stopgo.recordings.embedded.reading import Recording


def contradiction(one: Recording, other: Recording) -> str:
    """Return which mission of one id and revision differs in two recordings; empty if none does."""
    if one.mission_id != other.mission_id:
        return ""
    own = {mission.revision: mission for mission in one.missions}
    for mission in other.missions:
        mine = own.get(mission.revision, mission)
        if mine.digest != mission.digest:
            return (
                f"{other.path} has another mission with id {mission.id} and revision {mission.revision}"
                f" (digest {mission.digest[:12]}…, here {mine.digest[:12]}…)"
            )
    return ""


def of_its_mission(recording: Recording, read: Sequence[Recording]) -> list[Recording]:
    """Return the recordings of a recording's mission that agree with it; it is among them."""
    own = [item for item in read if item.mission_id == recording.mission_id]
    return [item for item in own if not contradiction(recording, item)]


def agreeing(read: Sequence[Recording]) -> list[Recording]:
    """Return the recordings without the plans that contradict a run, or a later one of these plans.

    Raises
    ------
    InputError
        Naming two runs that have different missions with one id and revision.
    """
    kept: list[Recording] = []
    for item in sorted(reversed(read), key=lambda item: not item.logs):
        problem = next(filter(None, (contradiction(item, other) for other in kept)), "")
        if problem and item.logs:
            raise InputError(f"{item.path}: {problem}; give the recordings of one of them")
        if not problem:
            kept.append(item)
    return [item for item in read if item in kept]
