"""Reader of QGC WPL 110, the table of Mission Planner, MAVProxy and QGroundControl: row 0 is home."""

from __future__ import annotations

import math
from dataclasses import replace

from stopgo.mission.errors import InputError
from stopgo.mission.files.imports.item_track import Listed, assumptions, autopilot_for, track_of
from stopgo.mission.files.imports.qgc_plan import LARGEST_CODE
from stopgo.mission.files.imports.track import ImportedRoute, ImportOptions
from stopgo.mission.frames.transform import SiteOrigin

HEAD = "QGC WPL 110"
COLUMNS = 12


def read(data: bytes, source: str, given: ImportOptions) -> ImportedRoute:
    """The track of a table; degrees by ArduPilot's rule unless another autopilot is given.

    Raises
    ------
    InputError
        Naming the line or the item.
    """
    rows = _rows(data, source)
    if not rows:
        raise InputError(f"{source}: has no row after '{HEAD}'")
    origin = given.origin or _home(rows[0], source)
    track = track_of(rows[1:], origin=origin, autopilot=autopilot_for(given.autopilot), source=source)
    return replace(track, notes=assumptions(given, heading=False, firmware=False))


def _rows(data: bytes, source: str) -> list[Listed]:
    try:
        lines = data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise InputError(f"{source}: not text (byte {error.start}); give a table '{HEAD}'") from None
    head = " ".join(lines[0].split()) if lines else ""
    if head != HEAD:
        raise InputError(f"{source}: begins with {head[:40]!r}, not '{HEAD}'; save the waypoints again")
    told = [(number, line) for number, line in enumerate(lines[1:], 2) if line.strip() and line[0] != "#"]
    return [_row(line, number, count, source) for count, (number, line) in enumerate(told)]


def _row(line: str, number: int, count: int, source: str) -> Listed:
    """Row `count` of the table; home is row 0."""
    cells = line.split()
    if len(cells) != COLUMNS:
        raise InputError(f"{source}: line {number} has {len(cells)} columns, not {COLUMNS}; save it again")
    try:
        sequence, frame, command = int(cells[0]), int(cells[2]), int(cells[3])
        params = tuple(map(float, cells[4:11]))
    except ValueError:
        raise InputError(
            f"{source}: line {number} holds something that is no number: {line.strip()[:60]}"
        ) from None
    if not (0 <= frame <= LARGEST_CODE and 0 <= command <= LARGEST_CODE):
        raise InputError(
            f"{source}: line {number} has a frame or a command above {LARGEST_CODE}, which is none"
        )
    if sequence != count:
        raise InputError(
            f"{source}: line {number} is row {sequence}, but {count} is due; a row is missing or moved"
        )
    return Listed(count, command, frame, params)


def _home(row: Listed, source: str) -> SiteOrigin:
    lat, lon, alt = row.params[4:7]
    if not (abs(lat) <= 90 and abs(lon) <= 180 and math.isfinite(alt)) or lat == lon == 0:
        raise InputError(
            f"{source}: home (row 0) is at latitude {lat:g}, longitude {lon:g}, which is no position; "
            "give --origin LAT,LON,ALT,HEADING"
        )
    return SiteOrigin(lat=lat, lon=lon, alt=alt, heading_deg=0.0)
