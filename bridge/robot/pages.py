"""Answers in pages: past events, past poses, and the parts of a stored mission."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

import msgspec

from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import (
    CHUNK_BYTES,
    LOG_PAGE,
    POSE_PAGE,
    LogPage,
    Malformed,
    MissionPart,
    PosePage,
    Rejected,
    Reply,
    count_of,
    parts_of,
)
from stopgo.bridge.robot.journal import Journal
from stopgo.mission.run.events import PoseReport

POSES_KEPT = 3000
"""Poses in memory, for stations that come late or were disconnected."""


def events_page(journal: Journal, request: Request) -> Reply:
    """Return the events above a number, of one run if the request names it."""
    try:
        since = count_of(request.parameters.get("since", "0"))
    except ValueError as error:
        return Malformed(message=f"since: {error}")
    bodies = journal.bodies(since=since, run_id=request.parameters.get("run"), limit=LOG_PAGE)
    return LogPage(bodies=tuple(map(msgspec.Raw, bodies)), newest=journal.newest)


def poses_page(poses: Iterable[PoseReport], boot_id: str, request: Request) -> Reply:
    """Return the poses above a number, of one run if the request names it."""
    try:
        since = count_of(request.parameters.get("since", "0"))
    except ValueError as error:
        return Malformed(message=f"since: {error}")
    run_id = request.parameters.get("run")
    later = (pose for pose in poses if pose.seq > since and run_id in (None, pose.run_id))
    return PosePage(boot_id=boot_id, poses=tuple(islice(later, POSE_PAGE)))


def part_page(journal: Journal, request: Request) -> Reply:
    """Return the part of a stored mission that is requested on `…/mission/<id>/part/<number>`."""
    mission_id, step = address_of(request.key)
    try:
        number, revision = count_of(step[1]), count_of(request.parameters.get("revision", ""))
    except ValueError as error:
        return Malformed(message=f"{'/'.join(step)}: {error}")
    manifest = journal.missions.manifest(mission_id, revision)
    if manifest is None:
        message = f"mission {mission_id} revision {revision} is not on this robot"
        return Rejected(reason="no_mission", messages=(message,))
    data = journal.missions.part(manifest, number * CHUNK_BYTES, CHUNK_BYTES)
    return MissionPart(manifest=manifest, index=number, data=data)


def address_of(key: str) -> tuple[str, list[str]]:
    """Return mission id and step of `…/sx/1/<robot>/mission/<id>/<step…>`."""
    _, mission_id, *step = parts_of(key)
    return mission_id, step
