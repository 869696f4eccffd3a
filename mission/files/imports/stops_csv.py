"""Reads a table of stops: the output of `stopgo export`, or a surveyor's own with some of its columns.

Numbers have full stops. A spreadsheet that writes decimal commas separates cells by semicolons: there commas
are decimal, unless full stops are there too.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, get_args

from stopgo.mission.document import OnFailure, Point
from stopgo.mission.document.problems import JOIN
from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import rows_of, separator_of
from stopgo.mission.files.imports.track import ImportedRoute, ImportOptions, Visit
from stopgo.mission.frames.geodesy import Geodetic, from_geodetic, heading_of

METRES = ("x_m", "y_m")
DEGREES = ("lat_deg", "lon_deg")
TOLD = ("number", "approach_m")
"""Informative columns: the order, and a length that follows from the rest."""
KNOWN = (
    *METRES, *DEGREES, *TOLD, "id", "heading_deg", "bearing_deg", "doorway", "tolerance_m", "settle_s",
    "scan_profile", "scan_s", "scan_timeout_s", "on_failure", "retries", "approach_wkt",
)  # fmt: skip
MOST = 100_000
"""Rows; no site has more stops."""
LARGEST = 1e9
_WKT = re.compile(r"(?:LINESTRING|POINT)\s*\(([^()]*)\)", re.IGNORECASE)


@dataclass(frozen=True)
class _Row:
    """A row by its column names, and its line in the file."""

    cells: dict[str, str]
    line: int
    source: str
    comma: bool
    """True if a comma is decimal."""

    def refused(self, column: str, right: str) -> InputError:
        return InputError(
            f"{self.source}: line {self.line}: {column} is {self.cells[column][:40]!r}; {right}"
        )

    def text(self, column: str) -> str | None:
        """A cell without the apostrophe that guards it against being a formula; None if empty."""
        cell = self.cells.get(column, "")
        return (cell[1:] if cell.startswith("'") else cell) or None

    def number(self, column: str) -> float | None:
        cell = self.cells.get(column, "").strip()
        if not cell:
            return None
        value = _as_number(cell.replace(",", ".") if self.comma else cell)
        if value is None:
            raise self.refused(column, "it must be a number with a full stop, such as 2.5")
        return value


def read(data: bytes, source: str, given: ImportOptions) -> ImportedRoute:
    """The track of a table of stops, in metres of the site or in degrees.

    Raises
    ------
    InputError
        Naming line and column.
    """
    rows = _rows(data, source)
    place = _placing(rows[0].cells, source, given)
    visits = [_visit(row, place(row), given) for row in _in_order(rows)]
    start, legs = _legs(_in_order(rows), visits)
    return ImportedRoute(legs, start=start, origin=given.origin)


def _rows(data: bytes, source: str) -> list[_Row]:
    text = _text(data, source)
    lines = rows_of(text, source, strict=True)
    if len(lines) < 2:
        raise InputError(f"{source}: holds no stop; it needs a row of column names and a row per stop")
    if len(lines) > MOST:
        raise InputError(f"{source}: holds {len(lines) - 1} rows; a mission has at most {MOST}")
    names = _names(lines[0][1], source)
    for line, cells in lines[1:]:
        if len(cells) != len(names):
            raise InputError(
                f"{source}: line {line} has {len(cells)} cells, not {len(names)}; mend or save it again"
            )
    comma = separator_of(text) != "," and not any(map(_has_point, text.splitlines()[1:]))
    return [_Row(dict(zip(names, cells, strict=True)), line, source, comma) for line, cells in lines[1:]]


def _text(data: bytes, source: str) -> str:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{source}: not UTF-8 text (byte {error.start}); save it as CSV UTF-8") from None
    if "\0" in text:
        raise InputError(f"{source}: holds zero bytes, which no table does; save it as CSV UTF-8")
    return text


def _has_point(line: str) -> bool:
    return re.search(r"\d\.\d", line) is not None


def _names(cells: Sequence[str], source: str) -> list[str]:
    names = [cell.strip() for cell in cells]
    for name in names:
        if name not in KNOWN:
            raise InputError(f"{source}: column {name[:40]!r} is not known; known: {', '.join(KNOWN)}")
        if names.count(name) > 1:
            raise InputError(f"{source}: column {name} occurs {names.count(name)} times; keep one")
    return names


def _in_order(rows: list[_Row]) -> list[_Row]:
    """Rows by their number, so that a table that was sorted by something else keeps its route."""
    if "number" not in rows[0].cells:
        return rows
    numbers = [row.number("number") for row in rows]
    times = Counter(numbers)
    for row, number in zip(rows, numbers, strict=True):
        if number is None or number != round(number) or times[number] > 1:
            raise row.refused(
                "number", "it must be the stop's position in the route, a number no other row has"
            )
    return [row for _, row in sorted(zip(numbers, rows, strict=True), key=lambda pair: pair[0] or 0.0)]


def _placing(columns: dict[str, str], source: str, given: ImportOptions) -> Callable[[_Row], Point]:
    """Return the form of positions: metres if the table has them, else degrees."""
    if all(name in columns for name in METRES):
        return lambda row: _pair(row, METRES)
    if not all(name in columns for name in DEGREES):
        raise InputError(f"{source}: has neither columns x_m, y_m nor lat_deg, lon_deg; name the columns so")
    origin = given.origin
    if origin is None:
        raise InputError(f"{source}: positions are in degrees; give --origin LAT,LON,ALT,HEADING of the site")

    def place(row: _Row) -> Point:
        lat, lon = _pair(row, DEGREES)
        if not (abs(lat) <= 90 and abs(lon) <= 180):
            raise row.refused("lat_deg", "latitude is within ±90, longitude within ±180")
        x, y = from_geodetic(origin, Geodetic(lat=lat, lon=lon))
        if not math.hypot(x, y) < 10_000:
            raise row.refused("lat_deg", "it is more than 10 km from the origin; give the site's --origin")
        return (x, y)

    return place


def _pair(row: _Row, columns: tuple[str, str]) -> Point:
    one, other = (row.number(column) for column in columns)
    if one is None or other is None:
        raise row.refused(columns[0] if one is None else columns[1], "every stop needs its position")
    return (one, other)


def _visit(row: _Row, xy: Point, given: ImportOptions) -> Visit:
    retries = _least(row, "retries", 0.0)
    if retries is not None and retries != round(retries):
        raise row.refused("retries", "it must be a whole number")
    return Visit(
        xy,
        id=row.text("id"),
        heading=_heading(row, given),
        settle_s=_least(row, "settle_s", 0.0),
        scan_s=_least(row, "scan_s", 0.0),
        timeout_s=_least(row, "scan_timeout_s", 0.0),
        profile=row.text("scan_profile"),
        tolerance_m=_least(row, "tolerance_m", 1e-6),
        on_failure=_choice(row, "on_failure", get_args(OnFailure)),
        retries=None if retries is None else int(retries),
        doorway=_choice(row, "doorway", ("yes", "no")) == "yes",
    )


def _heading(row: _Row, given: ImportOptions) -> float | None:
    heading, bearing = row.number("heading_deg"), row.number("bearing_deg")
    if heading is not None:
        return math.remainder(math.radians(heading), math.tau)
    if bearing is None:
        return None
    if given.origin is None:
        raise row.refused(
            "bearing_deg", "give --origin LAT,LON,ALT,HEADING of the site, or column heading_deg"
        )
    return heading_of(given.origin, bearing)


def _least(row: _Row, column: str, least: float) -> float | None:
    value = row.number(column)
    if value is not None and value < least:
        raise row.refused(column, f"it must be at least {least:g}")
    return value


def _choice(row: _Row, column: str, words: tuple[str, ...]) -> Any:
    word = row.text(column)
    if word is not None and word not in words:
        raise row.refused(column, f"it must be one of {', '.join(words)}")
    return word


def _legs(rows: Sequence[_Row], visits: Sequence[Visit]) -> tuple[Point | None, tuple[Visit, ...]]:
    """Return the beginning of the first leg, and the visits with the points of their legs."""
    begin, legs, before = None, list[Visit](), None
    for row, visit in zip(rows, visits, strict=True):
        leg = _leg(row)
        if leg:
            _check_leg(row, leg, before, visit)
            begin = leg[0] if before is None else begin
        legs.append(replace(visit, via=tuple(leg[1:-1])))
        before = visit
    return begin, tuple(legs)


def _leg(row: _Row) -> list[Point]:
    text = row.text("approach_wkt")
    if text is None:
        return []
    found = _WKT.fullmatch(text.strip())
    points = [part.split() for part in found.group(1).split(",")] if found else [[]]
    numbers = [[_as_number(cell) for cell in point] for point in points]
    if any(len(point) != 2 or None in point for point in numbers):
        raise row.refused("approach_wkt", "write LINESTRING (x y, x y), or leave it empty for a straight leg")
    return [(x, y) for x, y in numbers if x is not None and y is not None]


def _check_leg(row: _Row, leg: list[Point], before: Visit | None, visit: Visit) -> None:
    """A stop that was moved, or a row taken out, makes a leg lead elsewhere."""
    if math.dist(leg[-1], visit.xy) > JOIN:
        raise row.refused("approach_wkt", "it does not end at its stop; leave it empty for a straight leg")
    if before is not None and math.dist(leg[0], before.xy) > JOIN:
        raise row.refused(
            "approach_wkt", "it does not begin at the stop before; leave it empty for a straight leg"
        )


def _as_number(cell: str) -> float | None:
    """A finite number as people write one; not Python's underscores, nan or inf."""
    if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?", cell, re.ASCII):
        return None
    value = float(cell)
    return value if abs(value) < LARGEST else None
