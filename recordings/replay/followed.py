"""Events of a run from the telemetry log of a vehicle that drove our mission by itself, as in a live run."""

from __future__ import annotations

from pathlib import Path

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.following.followed_run import FollowedRun
from stopgo.mission.mavlink.following.listed_mission import ListedMission, listed_mission
from stopgo.mission.mavlink.items import ItemList
from stopgo.mission.mavlink.recognise import recognise
from stopgo.mission.run.events import AnyEvent, Arrived
from stopgo.recordings.logs.field_log import FieldLog, LoggedMission
from stopgo.recordings.logs.telemetry_log import FORMAT, messages_of
from stopgo.recordings.replay.log_placing import PlacedLog
from stopgo.recordings.replay.uploaded import differences


def followed_events(log: FieldLog, mission: Mission, placed_log: PlacedLog) -> tuple[AnyEvent, ...]:
    """Return the events of the vehicle's newest run of the mission; none if it cannot be followed.

    That needs our mission as uploaded to the vehicle, and poses placed by latitude and longitude, like its
    items.
    """
    system = placed_log.source.robot
    if (
        log.format != FORMAT
        or mission.georeference is None
        or not placed_log.by_earth
        or not system.isdigit()
    ):
        return ()
    newest: tuple[AnyEvent, ...] = ()
    for number, upload in enumerate(log.uploads):
        listed = _listed(upload, mission)
        if listed is None:
            continue
        until = log.uploads[number + 1].ns if number + 1 < len(log.uploads) else log.end_ns + 1
        events = _followed(log, listed, upload, until, int(system), placed_log.alignment.time_offset_ns)
        newest = events or newest
    return newest


def _listed(upload: LoggedMission, mission: Mission) -> ListedMission | None:
    """Return the mission's stops by the vehicle's items; None for another mission."""
    assert mission.georeference is not None
    if any(differences(upload, mission)):
        return None
    try:
        placed = recognise(upload.items, mission=mission)
        return listed_mission(mission, ItemList(upload.autopilot, mission.georeference, placed))
    except InputError:
        return None


def _followed(
    log: FieldLog, listed: ListedMission, upload: LoggedMission, until_ns: int, system: int, offset_ns: int
) -> tuple[AnyEvent, ...]:
    """Return the events of the newest run between two uploads in which a stop was reached."""
    run = FollowedRun(
        listed, autopilot_named(upload.autopilot), name=f"replay-{log.digest[:12]}", robot=str(system)
    )
    last_ns = upload.ns
    for received in messages_of(Path(log.path)):
        if received.system != system or received.ns >= until_ns:
            continue
        if received.ns < upload.ns:
            run.take_earlier(received.message, received.ns + offset_ns)
        else:
            last_ns = received.ns
            run.take(received.message, received.ns + offset_ns)
    run.end(last_ns + offset_ns)
    return tuple(run.events) if any(isinstance(event, Arrived) for event in run.events) else ()
