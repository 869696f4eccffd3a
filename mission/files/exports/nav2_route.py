"""Graph of Nav2's Route Server (GeoJSON): nodes are start, corners and stops, edges the straights between.

Coordinates are metres on the robot's map, as the Route Server's own graphs. A stop's node has an operation
`scan`, which the server's configuration binds to a plug-in.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import msgspec

from stopgo.mission.document import Mission, Point, Stop
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.exports.nav2_yaml import unmapped
from stopgo.mission.files.exports.waypoints import frame_name, mapped
from stopgo.mission.frames.transform import SAME

OPERATION = "scan"
DIGITS = 6


def write(mission: Mission, supplements: Supplements) -> bytes:
    """Return the graph, one feature a line; edges lead both ways, as a robot sent home drives back."""
    there = mapped(mission)
    places = _places(there)
    nodes = [_node(number, place, there) for place, number in places.items()]
    edges = list(_edges(there, places))
    features = ",\n".join(msgspec.json.encode(item).decode() for item in (*nodes, *edges))
    name = msgspec.json.encode(mission.name).decode()
    return f'{{"type":"FeatureCollection","name":{name},"features":[\n{features}\n]}}\n'.encode()


def read_back(data: bytes, mission: Mission, supplements: Supplements) -> list[Point]:
    """Return the places of the nodes that scan, in the order of the mission, in the site's frame."""
    to_map = mission.frame.to_map or SAME
    found: dict[int, Point] = {}
    for item in msgspec.json.decode(data)["features"]:
        for operation in item["properties"].get("operations", {}).values():
            x, y = item["geometry"]["coordinates"]
            found[operation["metadata"]["number"]] = to_map.back((x, y))
    return [found[number] for number in sorted(found)]


def notes(mission: Mission, supplements: Supplements) -> tuple[str, ...]:
    """Return the notes on what the graph does not say."""
    order = (
        "the Route Server finds a path between two nodes; the order of the stops is their metadata's number"
    )
    return (order, *unmapped(mission))


def _legs(mission: Mission) -> list[tuple[Point, ...]]:
    return [*(stop.approach for stop in mission.stops), mission.return_ or ()]


def _place(point: Point) -> Point:
    return (round(point[0], DIGITS) + 0.0, round(point[1], DIGITS) + 0.0)


def _places(mission: Mission) -> dict[Point, int]:
    """Number every place of the route; legs that meet share theirs."""
    points = [point for leg in _legs(mission) for point in leg]
    start = (mission.start.x, mission.start.y)
    distinct = dict.fromkeys(map(_place, (start, *points, *((stop.x, stop.y) for stop in mission.stops))))
    return {place: number for number, place in enumerate(distinct)}


def _node(number: int, place: Point, mission: Mission) -> dict[str, Any]:
    """Return a place with the scans that are taken there; two stops may share it."""
    properties: dict[str, Any] = {"id": number, "frame": frame_name(mission)}
    here = [(at, stop) for at, stop in enumerate(mission.stops, 1) if _place((stop.x, stop.y)) == place]
    if here:
        properties["operations"] = {stop.id: _scan(stop, at) for at, stop in here}
    return _feature("Point", place, properties)


def _scan(stop: Stop, number: int) -> dict[str, Any]:
    scan = {
        "number": number, "stop": stop.id, "heading": stop.heading, "tolerance_m": stop.tolerance_m,
        "settle_s": stop.settle_s, "profile": stop.scan.profile, "duration_s": stop.scan.duration_s,
        "timeout_s": stop.scan.timeout_s,
    }  # fmt: skip
    return {"type": OPERATION, "trigger": "NODE", "metadata": scan}


def _edges(mission: Mission, places: dict[Point, int]) -> Iterator[dict[str, Any]]:
    """Yield an edge each way for every straight, once."""
    straights = [pair for leg in _legs(mission) for pair in pairwise(map(_place, leg))]
    both = [pair for a, b in straights if a != b for pair in ((a, b), (b, a))]
    for number, (a, b) in enumerate(dict.fromkeys(both), len(places)):
        properties = {
            "id": number, "startid": places[a], "endid": places[b], "cost": round(math.dist(a, b), DIGITS),
            "overridable": True,
        }  # fmt: skip
        yield _feature("MultiLineString", [[a, b]], properties)


def _feature(kind: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}
