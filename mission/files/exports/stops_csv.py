"""Table of stops, one row each, that opens the same in spreadsheets of every country.

RFC 4180: commas, full stops in numbers, CRLF, UTF-8. Text that a spreadsheet would read as a formula gets
an apostrophe in front, which `stopgo.mission.files.imports.stops_csv` removes again.
"""

from __future__ import annotations

import csv
import io
import math

from stopgo.mission.document import Mission, Point, Stop
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.frames.geodesy import bearing_deg, to_geodetic
from stopgo.mission.geometry import frozen, polyline_length

FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "'")
"""First characters of a formula in a spreadsheet, and the apostrophe that prevents it."""
PLACES = 6
"""Decimals of metres, as in mission.json."""
DEGREES = 9
"""Decimals of degrees: 0.1 mm."""

CsvRow = dict[str, str]


def write(mission: Mission, supplements: Supplements) -> bytes:
    """The table; latitude, longitude and bearing only where the mission has a georeference."""
    rows = [_row(mission, number, stop) for number, stop in enumerate(mission.stops, 1)]
    text = io.StringIO()
    table = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\r\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue().encode()


def read_back(data: bytes, mission: Mission, supplements: Supplements) -> list[Point]:
    """Return the positions in the table's columns x_m and y_m."""
    rows = csv.DictReader(io.StringIO(data.decode(), newline=""))
    return [(float(row["x_m"]), float(row["y_m"])) for row in rows]


def notes(mission: Mission, supplements: Supplements) -> tuple[str, ...]:
    """Return the note that the table has no row for the return leg."""
    return () if mission.return_ is None else ("the path back to the start is not in a table of stops",)


def guarded(text: str) -> str:
    """Return text that no spreadsheet reads as a formula."""
    return f"'{text}" if text.startswith(FORMULA) else text


def _row(mission: Mission, number: int, stop: Stop) -> CsvRow:
    return {
        "number": str(number),
        "id": guarded(stop.id),
        "x_m": _metres(stop.x),
        "y_m": _metres(stop.y),
        "heading_deg": _degrees(math.degrees(stop.heading)),
        **_geodetic(mission, stop),
        "doorway": "yes" if stop.doorway else "no",
        "tolerance_m": repr(stop.tolerance_m),
        "settle_s": repr(stop.settle_s),
        "scan_profile": guarded(stop.scan.profile),
        "scan_s": repr(stop.scan.duration_s),
        "scan_timeout_s": repr(stop.scan.timeout_s),
        "on_failure": stop.on_failure,
        "retries": str(stop.retries),
        "approach_m": f"{polyline_length(frozen(stop.approach)):.3f}",
        "approach_wkt": wkt(stop.approach),
    }


def _geodetic(mission: Mission, stop: Stop) -> CsvRow:
    origin = mission.georeference
    if origin is None:
        return {}
    place = to_geodetic(origin, (stop.x, stop.y))
    return {
        "lat_deg": _degrees(place.lat),
        "lon_deg": _degrees(place.lon),
        "bearing_deg": _degrees(bearing_deg(origin, stop.heading)),
    }


def wkt(leg: tuple[Point, ...]) -> str:
    """A polyline of the site's metres as well-known text, which GIS programs draw."""
    points = ", ".join(f"{_metres(x)} {_metres(y)}" for x, y in leg)
    return f"LINESTRING ({points})" if len(leg) > 1 else f"POINT ({points})"


def _metres(value: float) -> str:
    return f"{value + 0.0:.{PLACES}f}"


def _degrees(value: float) -> str:
    return f"{value + 0.0:.{DEGREES}f}"
