"""Events of a run from the telemetry log of a vehicle that drove our mission by itself, as in a live run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from msgspec.structs import replace as changed

from stopgo.mission.document import Mission, Stop
from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.captures import NEAR_M
from stopgo.mission.mavlink.following.followed_run import FollowedRun
from stopgo.mission.mavlink.following.listed_mission import ListedMission, listed_mission
from stopgo.mission.mavlink.items import ItemList
from stopgo.mission.mavlink.recognise import recognise
from stopgo.mission.run.events import AnyEvent, Arrived, Pose, Scanned, Settled, Unconfirmed
from stopgo.mission.run.run_log import Track
from stopgo.recordings.logs.field_log import FieldLog, LoggedMission
from stopgo.recordings.logs.telemetry_log import FORMAT, messages_of
from stopgo.recordings.replay.log_placing import PlacedLog
from stopgo.recordings.replay.matching import long_enough
from stopgo.recordings.replay.standstills import Standstill
from stopgo.recordings.replay.uploaded import differences


def followed_events(
    log: FieldLog, mission: Mission, placed_log: PlacedLog, standstills: Sequence[Standstill]
) -> tuple[AnyEvent, ...]:
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
    for upload, listed, until_ns in _held(log, mission):
        events = _followed(log, listed, upload, until_ns, int(system), placed_log)
        newest = events or newest
    return tuple(_with_standstills(newest, mission, standstills))


def _held(log: FieldLog, mission: Mission) -> Iterator[tuple[LoggedMission, ListedMission, int]]:
    """Yield each time during which the vehicle held our mission: its first list, and the end.

    A list with the same contents, uploaded or read back, ends nothing.
    """
    lists = [(upload, _listed(upload, mission)) for upload in log.uploads]
    for ours, group in groupby(enumerate(lists), key=lambda item: item[1][1] is not None):
        held = list(group)
        upload, listed = held[0][1]
        after = held[-1][0] + 1
        if ours and listed is not None:
            yield upload, listed, log.uploads[after].ns if after < len(lists) else log.end_ns + 1


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
    log: FieldLog,
    listed: ListedMission,
    upload: LoggedMission,
    until_ns: int,
    system: int,
    placed_log: PlacedLog,
) -> tuple[AnyEvent, ...]:
    """Return the events of the newest run between two uploads in which a stop was reached or left out."""
    offset_ns = placed_log.alignment.time_offset_ns
    run = FollowedRun(
        listed,
        autopilot_named(upload.autopilot),
        name=f"replay-{log.digest[:12]}",
        robot=str(system),
        pose_at=partial(_pose_at, placed_log.track),
    )
    last_ns = upload.ns
    for received in messages_of(Path(log.path)):
        if received.system != system or received.ns >= until_ns or _of_another_component(received.message):
            continue
        if received.ns < upload.ns:
            run.take_earlier(received.message, received.ns + offset_ns)
        else:
            last_ns = received.ns
            run.take(received.message, received.ns + offset_ns)
    run.end(last_ns + offset_ns)
    return tuple(run.events) if any(isinstance(event, Arrived) for event in run.events) else ()


def _with_standstills(
    events: Sequence[AnyEvent], mission: Mission, standstills: Sequence[Standstill]
) -> Iterator[AnyEvent]:
    """Give unconfirmed stops the pose of the standstill which the poses of the log show there.

    An arrival is reported while the vehicle still brakes: of a stop without a report of its scan, the pose
    after it has settled counts.
    """
    stops = {stop.id: stop for stop in mission.stops}
    after_ns, settled = 0, None
    for event in events:
        if isinstance(event, Unconfirmed):
            yield _at_standstill(event, stops[event.stop], standstills, after_ns, settled)
        else:
            yield event
        if isinstance(event, Arrived | Scanned | Unconfirmed):
            after_ns, settled = event.robot_ns, None
        if isinstance(event, Settled):
            settled = event


def _at_standstill(
    event: Unconfirmed, stop: Stop, standstills: Sequence[Standstill], after_ns: int, settled: Settled | None
) -> Unconfirmed:
    """Return the event with the last standstill at the stop since a time, else with the settled pose.

    That of the arrival is no evidence: the vehicle still braked.
    """
    found = [
        item
        for item in standstills
        if after_ns < item.end_ns and item.begin_ns < event.robot_ns
        if math.dist(item.xy, (stop.x, stop.y)) <= NEAR_M and long_enough(item, stop)
    ]
    if not found:
        own = settled is not None and settled.stop == event.stop
        return changed(event, pose=settled.pose if settled is not None and own else None)
    pose = Pose(x=found[-1].x, y=found[-1].y, heading=found[-1].heading)
    reason = f"{event.reason}; stationary {found[-1].seconds:.1f} s"
    return changed(event, pose=pose, reason=reason)


def _of_another_component(message: Any) -> bool:
    """True for a heartbeat of a camera or companion computer: it has no mode of the vehicle."""
    return str(message.get_type()) == "HEARTBEAT" and message.autopilot == NO_AUTOPILOT


def _pose_at(track: Track, ns: int) -> Pose | None:
    """Return the newest pose of the log, if it is recent."""
    index = track.last_until(ns)
    if index is None or ns - int(track.ns[index]) > RECENT_NS:
        return None
    x, y = track.xy[index].tolist()
    return Pose(x=x, y=y, heading=float(track.heading[index]))


NO_AUTOPILOT = 8
"""MAV_AUTOPILOT_INVALID."""
RECENT_NS = 5 * 10**8
