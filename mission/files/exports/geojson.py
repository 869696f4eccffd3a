"""GeoJSON export of stops, legs and coverage (RFC 7946): WGS84, longitude before latitude."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import msgspec

from stopgo.mission.document import Mission, Point, Stop
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.frames.geodesy import Geodetic, bearing_deg, from_geodetic, to_geodetic
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.geometry import FloatArray, frozen, polyline_length

DIGITS = 9
"""Decimals of degrees: 0.1 mm."""

Feature = dict[str, Any]


def write(mission: Mission, supplements: Supplements) -> bytes:
    """One feature a line: a Point per stop, a LineString per leg, and what --coverage-file adds."""
    origin = mission.georeference
    assert origin is not None  # the format is georeferenced
    features = [*_stops(mission, origin), *_legs(mission, origin), *_coverage(supplements, origin)]
    head = f'{{"type":"FeatureCollection","name":{_json(mission.name)},"features":[\n'
    return (head + ",\n".join(map(_json, features)) + "\n]}\n").encode()


def read_back(data: bytes, mission: Mission, supplements: Supplements) -> list[Point]:
    """The Points of the stops, back in the site's metres."""
    origin = mission.georeference
    assert origin is not None
    features = msgspec.json.decode(data)["features"]
    stops = [item["geometry"] for item in features if item["properties"]["kind"] == "stop"]
    places = [geometry["coordinates"] for geometry in stops]
    return [from_geodetic(origin, Geodetic(lat=lat, lon=lon)) for lon, lat in places]


def _stops(mission: Mission, origin: SiteOrigin) -> Iterator[Feature]:
    for number, stop in enumerate(mission.stops, 1):
        place = _position(origin, (stop.x, stop.y))
        yield _feature({"type": "Point", "coordinates": place}, _told(number, stop, origin))


def _told(number: int, stop: Stop, origin: SiteOrigin) -> dict[str, Any]:
    return {
        **{"kind": "stop", "number": number, "id": stop.id, "x_m": stop.x, "y_m": stop.y},
        **{"heading_deg": round(math.degrees(stop.heading), 3)},
        **{"bearing_deg": round(bearing_deg(origin, stop.heading), 3), "doorway": stop.doorway},
        **{"tolerance_m": stop.tolerance_m, "settle_s": stop.settle_s, "profile": stop.scan.profile},
        **{"scan_s": stop.scan.duration_s, "units": stop.sees.units, "new_units": stop.sees.new_units},
    }


def _legs(mission: Mission, origin: SiteOrigin) -> Iterator[Feature]:
    legs = [("leg", stop.id, stop.approach) for stop in mission.stops]
    for kind, name, leg in (*legs, ("return", "return", mission.return_ or ())):
        length = polyline_length(frozen(leg).reshape(-1, 2))
        if length > 0:
            yield _feature(_line(leg, origin), {"kind": kind, "to": name, "length_m": round(length, 3)})


def _coverage(supplements: Supplements, origin: SiteOrigin) -> Iterator[Feature]:
    found = supplements.coverage
    if found is not None:
        yield from _by_element(found.seen, found.seen_of, "seen", origin)
        yield from _by_element(found.unseen, found.unseen_of, "not_seen", origin)


def _by_element(
    stretches: FloatArray, elements: Sequence[str], kind: str, origin: SiteOrigin
) -> Iterator[Feature]:
    """One feature of all stretches, or one for each element of the model that they are of."""
    if not any(elements):
        yield _many(stretches, {"kind": kind}, origin)
        return
    for element in sorted(set(elements)):
        mine = stretches[[of == element for of in elements]]
        yield _many(mine, {"kind": kind, "global_id": element or None}, origin)


def _many(stretches: FloatArray, told: dict[str, Any], origin: SiteOrigin) -> Feature:
    lines = [line for stretch in stretches.tolist() for line in _lines(stretch, origin)]
    return _feature({"type": "MultiLineString", "coordinates": lines}, told)


def _line(leg: Sequence[Point], origin: SiteOrigin) -> dict[str, Any]:
    lines = _lines(leg, origin)
    if len(lines) == 1:
        return {"type": "LineString", "coordinates": lines[0]}
    return {"type": "MultiLineString", "coordinates": lines}


def _lines(leg: Sequence[Point], origin: SiteOrigin) -> list[list[list[float]]]:
    """The polyline's positions, cut at the antimeridian (RFC 7946, 3.1.9)."""
    lines = [[_position(origin, leg[0])]]
    for here, there in pairwise([_position(origin, point) for point in leg]):
        if abs(there[0] - here[0]) > 180.0:
            side = math.copysign(180.0, here[0])
            beyond = there[0] + 2 * side
            lat = here[1] + (there[1] - here[1]) * (side - here[0]) / (beyond - here[0])
            lines[-1].append([side, round(lat, DIGITS)])
            lines.append([[-side, round(lat, DIGITS)]])
        lines[-1].append(there)
    return lines


def _position(origin: SiteOrigin, point: Sequence[float]) -> list[float]:
    place = to_geodetic(origin, (point[0], point[1]))
    return [round(place.lon, DIGITS), round(place.lat, DIGITS)]


def _feature(geometry: dict[str, Any], properties: dict[str, Any]) -> Feature:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _json(value: object) -> str:
    return msgspec.json.encode(value).decode()
