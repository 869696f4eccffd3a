"""A telemetry log of a vehicle that drove our mission by itself -> the events of its run, as told live."""

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


def followed_events(log: FieldLog, mission: Mission, laid: PlacedLog) -> tuple[AnyEvent, ...]:
    """What is seen of the vehicle's newest run of the mission; nothing, where it cannot be followed.

    It can where the log holds our mission as the vehicle was given it, and poses that are placed by the
    earth, as the vehicle's items are.
    """
    system = laid.source.robot
    if log.format != FORMAT or mission.georeference is None or not laid.by_earth or not system.isdigit():
        return ()
    newest: tuple[AnyEvent, ...] = ()
    for number, upload in enumerate(log.uploads):
        listed = _listed(upload, mission)
        if listed is None:
            continue
        until = log.uploads[number + 1].ns if number + 1 < len(log.uploads) else log.end_ns + 1
        events = _followed(log, listed, upload, until, int(system), laid.alignment.time_offset_ns)
        newest = events or newest
    return newest


def _listed(upload: LoggedMission, mission: Mission) -> ListedMission | None:
    """Which of its items belong to which of our stops; None where it is another mission."""
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
    """The events of the newest run between two uploads in which a stop was reached."""
    run = FollowedRun(
        listed, autopilot_named(upload.autopilot), name=f"replay-{log.digest[:12]}", robot=str(system)
    )
    last_ns = upload.ns
    for heard in messages_of(Path(log.path)):
        if heard.system != system or heard.ns >= until_ns:
            continue
        if heard.ns < upload.ns:
            run.take_earlier(heard.message, heard.ns + offset_ns)
        else:
            last_ns = heard.ns
            run.take(heard.message, heard.ns + offset_ns)
    run.end(last_ns + offset_ns)
    return tuple(run.events) if any(isinstance(event, Arrived) for event in run.events) else ()
