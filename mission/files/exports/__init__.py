"""Export of a mission to other programs' formats: one module per format, one line in `FORMATS`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from stopgo.mission.console.plugins import Variant, variant
from stopgo.mission.document import Mission, Point
from stopgo.mission.errors import InputError, StopgoError
from stopgo.mission.files.exports import (
    geojson,
    nav2_route,
    nav2_yaml,
    path_mcap,
    qgc_plan,
    qgc_waypoints,
    stops_csv,
    stops_dxf,
    vda5050,
)
from stopgo.mission.files.exports.format import OPTIONS, Format, Supplements
from stopgo.mission.frames.geodesy import LATITUDE_LIMIT

QUANTUM = 0.008
"""Largest distance in metres of 1e-7 degrees."""

WRITING = ("autopilot", "trigger", "scan-wait", "settle")
"""Options for the writing of a mission as items."""

FORMATS: dict[str, Format] = {
    "plan": Format(
        ".plan", "QGroundControl plan", qgc_plan.write, qgc_plan.read_back, QUANTUM,
        georeferenced=True, uses=("origin", *WRITING), notes=qgc_plan.notes,
    ),
    "waypoints": Format(
        ".waypoints", "QGC WPL 110", qgc_waypoints.write, qgc_waypoints.read_back, QUANTUM,
        georeferenced=True, uses=("origin", *WRITING), notes=qgc_waypoints.notes,
    ),
    "dxf": Format(
        ".dxf", "DXF drawing", stops_dxf.write, stops_dxf.read_back, 1e-6,
        uses=("floor", "coverage"), notes=stops_dxf.notes,
    ),
    "csv": Format(
        ".csv", "table of stops", stops_csv.write, stops_csv.read_back, 1e-6,
        uses=("origin",), notes=stops_csv.notes,
    ),
    "nav2-route": Format(  # before .geojson, the end of its suffix
        ".route.geojson", "graph of Nav2's Route Server", nav2_route.write, nav2_route.read_back, 1e-5,
        uses=("map",), notes=nav2_route.notes,
    ),
    "geojson": Format(
        ".geojson", "GeoJSON (RFC 7946)", geojson.write, geojson.read_back, 1e-3,
        georeferenced=True, uses=("origin", "coverage"),
    ),
    "nav2": Format(
        ".nav2.yaml", "Nav2 waypoints", nav2_yaml.write, nav2_yaml.read_back, 1e-5,
        uses=("map",), notes=nav2_yaml.notes,
    ),
    "mcap": Format(
        ".mcap", "nav_msgs/Path in MCAP", path_mcap.write, path_mcap.read_back, 1e-6,
        uses=("map",), notes=path_mcap.notes,
    ),
    "vda5050": Format(
        ".vda5050.json", "VDA 5050 order, version 3.0", vda5050.write, vda5050.read_back, 1e-5,
        uses=("map",), notes=vda5050.notes,
    ),
    "vda5050-2.1": Format(
        ".vda5050-2.1.json", "VDA 5050 order, version 2.1", partial(vda5050.write, edition=vda5050.V2_1),
        vda5050.read_back, 1e-5, uses=("map",), notes=vda5050.notes,
    ),
}  # fmt: skip
"""Every format by its name, which `--to` takes; without it the file's suffix decides."""


def format_named(name: str | None, path: Path) -> str:
    """Return the name of the format for a file: as given, or by suffix.

    Raises
    ------
    InputError
        When there is no such format; it lists all.
    """
    if name is not None:
        form_of(name)
        return name
    fitting = [key for key, form in FORMATS.items() if path.name.lower().endswith(form.suffix)]
    if not fitting:
        known = ", ".join(form.suffix for form in FORMATS.values())
        raise InputError(f"{path}: no format has this suffix; known: {known} (or name one with --to)")
    return fitting[0]


def form_of(name: str) -> Format:
    """Return the format of this name: ours, an installed package's, or `package.module:FORMAT`."""
    return _form(name).what


def _form(name: str) -> Variant[Format]:
    found = variant("format", name, FORMATS, said=f"--to {name}")
    found.of_kind(found.what, Format)
    return found


def check_uses(name: str, given: Mapping[str, object]) -> None:
    """Refuse an option that a format does not use, instead of ignoring it."""
    for option, value in given.items():
        if value is not None and option not in form_of(name).uses:
            fitting = ", ".join(form.suffix for form in FORMATS.values() if option in form.uses)
            flag = OPTIONS.get(option, option)
            raise InputError(f"--{flag}: not used by {form_of(name).title}; only by {fitting}")


def exported(mission: Mission, name: str, supplements: Supplements) -> bytes:
    """Return the mission in a format of `FORMATS`, read back and compared before it is returned.

    Raises
    ------
    InputError
        When the format needs a georeference and the mission has none.
    NegativeResult
        When the format cannot hold what the mission depends on.
    """
    found = _form(name)
    form = found.what
    if form.georeferenced and mission.georeference is None:
        raise InputError(
            f"{mission.name}: no georeference, but {form.title} holds latitudes and longitudes; "
            "give --origin LAT,LON,ALT,HEADING, or plan with it"
        )
    if form.georeferenced and mission.georeference and abs(mission.georeference.lat) > LATITUDE_LIMIT:
        raise InputError(
            f"{mission.name}: georeference.lat is {mission.georeference.lat}; {form.title} ends at "
            f"±{LATITUDE_LIMIT:g}°, give another position with --origin"
        )
    with found.named_errors():
        data = found.of_kind(form.write(mission, supplements), bytes)
        places = form.read_back(data, mission, supplements)
    if not found.ours:
        found.array(places, "read_back", (None, 2))
    _check(places, form, mission)
    return bytes(data)


def _check(places: list[Point], form: Format, mission: Mission) -> None:
    if len(places) != len(mission.stops):
        raise StopgoError(
            f"{form.title}: {len(mission.stops)} stops were written but {len(places)} read back; "
            "the file was not saved, please report this"
        )
    for stop, place in zip(mission.stops, places, strict=True):
        off = math.dist((stop.x, stop.y), place)
        if not off <= min(form.tolerance, QUANTUM):
            raise StopgoError(
                f"{form.title}: stop {stop.id} reads back {off:.6f} m off; the file was not saved, "
                "please report this"
            )
