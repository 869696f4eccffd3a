"""Georeference of a model: from its map conversion, else its site; implausible values become findings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import pyproj
from pyproj.exceptions import CRSError, ProjError

from stopgo.mission.floor import Finding, Georeference
from stopgo.mission.settings.parameter import HIGHEST_M
from stopgo.planner.floors.ifc.model import OnEarth, Placement
from stopgo.planner.floors.legible_text import legible

DEFAULTS = {
    "Boston, as Revit sets it": (42.358, -71.06),
    "Boston, as an older Revit sets it": (42.213, -71.033),
    "London, as Archicad sets it": (51.50015, -0.12624),
    "0, 0": (0.0, 0.0),
}
"""Default sites that programs write if the user gave none."""
NEAR_DEFAULT = 0.005
"""A site this near to a default is one, degrees."""
UNITS = {"m": 1.0, "mm": 1e-3, "ft": 0.3048, "cm": 1e-2, "US survey ft": 1200 / 3937}
"""Possible units of eastings, the likelier first."""
FARTHEST_SITE = 10_000.0
"""A site that is placed farther from the model's origin says nothing of it, metres."""
APART = 1000.0
"""Map conversion and site say two things if they lie this far apart, metres."""
STEP = 100.0
"""Metres along +y over which its bearing is taken."""
EARTH = pyproj.Geod(ellps="WGS84")


@dataclass(frozen=True)
class _Read:
    """A position of the model's origin, or None, and the findings."""

    at: Georeference | None
    findings: tuple[Finding, ...] = ()


def georeference_of(place: OnEarth, *, level: float) -> tuple[Georeference | None, list[Finding]]:
    """Position on earth of the drawing's origin, at a floor `level` metres above the model's zero."""
    mapped, sited = _by_map(place), _by_site(place)
    chosen = mapped.at or sited.at
    findings = [*mapped.findings, *(sited.findings if mapped.at is None else _disagreeing(mapped, sited))]
    if chosen is None:
        return None, findings
    raised = Georeference(chosen.lat, chosen.lon, chosen.alt + level, chosen.heading_deg)
    if abs(raised.alt) > HIGHEST_M:
        beyond = _refused(f"the floor would lie {raised.alt:g} m above the sea")
        return None, [*findings, *beyond.findings]
    return raised, findings


def _disagreeing(mapped: _Read, sited: _Read) -> list[Finding]:
    if mapped.at is None or sited.at is None:
        return []
    away = EARTH.inv(mapped.at.lon, mapped.at.lat, sited.at.lon, sited.at.lat)[2]
    if away < APART:
        return []
    text = (
        f"the site's latitude and longitude lie {away / 1000:.0f} km from the map conversion, which is used"
    )
    return [Finding("georeference_two", text)]


def _by_map(place: OnEarth) -> _Read:
    """By IfcMapConversion or its property set; its scale is never applied: in real files it turns units."""
    if not place.said_by:
        return _Read(None)
    east, north = place.eastings, place.northings
    if not east or not north:
        return _refused(f"{place.said_by} is blank (eastings {east}, northings {north})")
    try:
        crs = pyproj.CRS.from_user_input(place.crs or "")
    except CRSError:
        return _refused(f"{place.said_by} names no known reference system ('{legible(place.crs or '')}')")
    if not crs.is_projected and not (crs.is_compound and crs.sub_crs_list[0].is_projected):
        return _refused(f"{place.said_by} names {legible(place.crs or '')}, which is no map projection")
    return _in_use(place, crs, (east, north))


def _refused(text: str) -> _Read:
    return _Read(None, (Finding("georeference_odd", f"{text}; it gives no position"),))


def _in_use(place: OnEarth, crs: pyproj.CRS, at: tuple[float, float]) -> _Read:
    """The position, in the unit that puts it where the reference system is used."""
    plane = crs.sub_crs_list[0] if crs.is_compound else crs
    stated = place.map_unit_m or 1.0
    for name, metres in sorted(UNITS.items(), key=lambda item: abs(item[1] - stated) > 1e-9):
        found = _position(place, plane, (at[0] * metres, at[1] * metres))
        if found is not None:
            text = f"the eastings of {place.said_by} are read in {name}; in its own unit they lie far off"
            unit_findings = () if abs(metres - stated) < 1e-9 else (Finding("georeference_unit", text),)
            return _Read(found, unit_findings)
    return _refused(
        f"{place.said_by}: {at[0]:g}, {at[1]:g} lie beyond where {legible(place.crs or '')} is used"
    )


def _position(place: OnEarth, crs: pyproj.CRS, at: tuple[float, float]) -> Georeference | None:
    """The position of a point given in metres of the map; None where the reference system is not in use."""
    to_earth = _to_earth(crs)
    unit = crs.axis_info[0].unit_conversion_factor
    abscissa, ordinate = place.abscissa, place.ordinate
    turn = math.atan2(ordinate, abscissa) if abscissa is not None and ordinate is not None else 0.0
    ahead = (at[0] - STEP * math.sin(turn), at[1] + STEP * math.cos(turn))
    try:
        lon, lat = to_earth.transform(at[0] / unit, at[1] / unit, errcheck=True)
        lon_ahead, lat_ahead = to_earth.transform(ahead[0] / unit, ahead[1] / unit, errcheck=True)
    except ProjError:
        return None
    area = crs.area_of_use
    inside = area is None or (area.west <= lon <= area.east and area.south <= lat <= area.north)
    if not (inside and math.isfinite(lat) and math.isfinite(lon)):
        return None
    bearing = EARTH.inv(lon, lat, lon_ahead, lat_ahead)[0]
    return Georeference(lat, lon, place.height or 0.0, bearing % 360)


@cache
def _to_earth(crs: pyproj.CRS) -> pyproj.Transformer:
    """The way from a reference system to latitude and longitude: slow to find, the same on every storey."""
    return pyproj.Transformer.from_crs(crs, "EPSG:4326", always_xy=True)


def _by_site(place: OnEarth) -> _Read:
    """By IfcSite's latitude and longitude, and true north."""
    lat, lon = place.latitude, place.longitude
    if lat is None or lon is None:
        return _Read(None)
    for name, (known_lat, known_lon) in DEFAULTS.items():
        if abs(lat - known_lat) < NEAR_DEFAULT and abs(lon - known_lon) < NEAR_DEFAULT:
            return _refused(f"the site's latitude and longitude are a default ({name})")
    if abs(lat) > 90 or abs(lon) > 180:
        return _refused(f"the site's latitude {lat:g} and longitude {lon:g} are on no globe")
    heading, odd = _heading(place.true_north)
    return _from_site(place.site, (lat, lon), place.elevation or 0.0, heading, odd)


def _heading(true_north: tuple[float, float] | None) -> tuple[float, tuple[Finding, ...]]:
    """The bearing of +y, degrees clockwise from true north."""
    if true_north is None or not any(true_north):
        text = "the model says nothing of true north; its +y is taken for north"
        return 0.0, (Finding("georeference_north", text),)
    return (math.degrees(math.atan2(true_north[1], true_north[0])) - 90) % 360, ()


def _from_site(
    site: Placement | None,
    at: tuple[float, float],
    elevation: float,
    heading: float,
    odd: tuple[Finding, ...],
) -> _Read:
    """The position of the model's origin: latitude and longitude are those of the site's own."""
    x, y, z = (site[3], site[7], site[11]) if site else (0.0, 0.0, 0.0)
    away = math.hypot(x, y)
    if away > FARTHEST_SITE:
        return _refused(f"the site is placed {away / 1000:.0f} km from the model's origin")
    back = heading + math.degrees(math.atan2(-x, -y))
    lon, lat, _ = EARTH.fwd(at[1], at[0], back, away)
    return _Read(Georeference(lat, lon, elevation - z, heading), odd)
