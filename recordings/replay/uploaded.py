"""MAVLink missions that a log contains: compared with ours stop by stop, or used as the plan."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from stopgo.mission.console.table import counted
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.files.imports.assembling import mission_of
from stopgo.mission.files.imports.item_track import Listed, track_of
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.items import Item
from stopgo.mission.mavlink.recognise import PLACES, recognise
from stopgo.mission.mavlink.recognised_tour import RecognisedStop, recognised_tour
from stopgo.mission.settings import Settings
from stopgo.recordings.logs.field_log import FieldLog, LoggedMission

SAME_M, SAME_S = 0.02, 0.05
"""Tolerances: steps of 1e-7 degrees are a centimetre, times in float32 are nearly exact."""


def mission_in(log: FieldLog) -> Mission:
    """Return the mission uploaded last, as one of ours.

    Raises
    ------
    InputError
        When the log contains none, or one that is not a mission of scan stops.
    """
    whole = [upload for upload in log.uploads if upload.complete]
    if not whole:
        raise InputError(f"{log.path}: no mission in it; give its mission.json with --mission")
    upload = whole[-1]
    origin = upload.home or next((track.origin for track in log.poses if track.origin is not None), None)
    if origin is None:
        raise InputError(
            f"{log.path}: the mission in it has no home, and no pose gives its origin; give --mission"
        )
    listed = [
        Listed(number, item.command, item.frame, _params(item)) for number, item in enumerate(upload.items, 1)
    ]
    flat = SiteOrigin(lat=origin.lat, lon=origin.lon, alt=origin.alt, heading_deg=0.0)
    track = track_of(listed, origin=flat, autopilot=upload.autopilot, source=log.path)
    track = replace(track, start=(0.0, 0.0))  # home: where the vehicle was switched on
    path = Path(log.path)
    return mission_of(track, Settings(), name=path.stem, file=path.name, digest=log.digest)


def _params(item: Item) -> tuple[float, ...]:
    """Return the parameters as a file lists them: degrees if the command has a position."""
    if item.command in PLACES:
        return (*item.params, item.x / 1e7, item.y / 1e7, item.z)
    return (*item.params, float(item.x), float(item.y), item.z)


def differences_of(log: FieldLog, mission: Mission) -> tuple[str, ...]:
    """Return the differences between each uploaded mission and ours, one line each, with its time."""
    lines: list[str] = []
    for number, upload in enumerate(log.uploads, 1):
        when = f"mission {number} in the log, {(upload.ns - log.begin_ns) / 1e9:.1f} s after it begins"
        found = list(differences(upload, mission))
        lines_of = found or [f"the same {counted(len(mission.stops), 'stop')}"]
        lines += [f"{when}: {line}" for line in lines_of]
    return tuple(lines)


def differences(upload: LoggedMission, mission: Mission) -> Iterator[str]:
    """Yield the differences between an uploaded mission and ours; nothing if they are the same."""
    if not upload.complete:
        yield f"only {counted(len(upload.items), 'item')}, the upload was interrupted"
        return
    if mission.georeference is None:
        yield f"{len(upload.items)} items; ours has no georeference for a comparison"
        return
    try:
        placed = recognise(upload.items, mission=mission)
        tour = recognised_tour(placed, mission.georeference, upload.autopilot)
    except InputError as error:
        yield str(error)
        return
    ids = [one.stop for one in placed if one.role == "stop"]
    if len(ids) == len(mission.stops) and set(ids) != {stop.id for stop in mission.stops}:
        ids = [stop.id for stop in mission.stops]  # numbered by another program: the order decides
    found = dict(zip(ids, tour.visits, strict=True))
    known = {stop.id for stop in mission.stops}
    for stop in mission.stops:
        visit = found.get(stop.id)
        if visit is None:
            yield f"stop {stop.id} is missing from its items"
        else:
            yield from _stop_differences(stop.id, visit, mission)
    yield from (f"its stop {name} is missing from ours" for name in ids if name not in known)


def _stop_differences(name: str, visit: RecognisedStop, mission: Mission) -> Iterator[str]:
    stop = next(stop for stop in mission.stops if stop.id == name)
    distance_m = math.dist(visit.at, (stop.x, stop.y))
    item = f"item {visit.index + 1} (stop {name})"
    if distance_m > SAME_M:
        yield f"{item} lies {distance_m:.3f} m from ours"
    if abs(visit.settle_s - stop.settle_s) > SAME_S:
        yield f"{item} settles {visit.settle_s:g} s, ours {stop.settle_s:g} s"
    if visit.scan_s is not None and abs(visit.scan_s - stop.scan.duration_s) > SAME_S:
        yield f"{item} waits {visit.scan_s:g} s for the scan, ours {stop.scan.duration_s:g} s"
