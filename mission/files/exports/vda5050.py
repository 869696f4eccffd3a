"""Order of VDA 5050, version 3.0 or 2.1, from a mission: the message of a fleet control to a vehicle.

Every pose of the route is a node, and every straight segment between two is an edge, so that a vehicle drives
exactly the mission's legs. A scan is an action at the stop's node.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import msgspec

from stopgo.mission.document import Mission, Point, Stop
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.exports.nav2_yaml import unmapped
from stopgo.mission.files.exports.waypoints import Waypoint, frame_name, mapped, way
from stopgo.mission.frames.transform import SAME


@dataclass(frozen=True)
class Edition:
    """Differences between two versions of VDA 5050 in an order."""

    version: str
    told: str
    """Ending of keys of texts for people: `nodeDescriptor`."""
    max_speed: str
    edge_names_its_nodes: bool
    deviation: Callable[[float], object]
    """`allowedDeviationXY` for a tolerance in metres."""
    retriable: bool
    """True if an action can be marked as repeatable."""


def _ellipse(tolerance: float) -> object:
    return {"a": tolerance, "b": tolerance, "theta": 0.0}


def _radius(tolerance: float) -> object:
    return tolerance


V3_0 = Edition("3.0.0", "Descriptor", "maximumSpeed", False, _ellipse, True)
V2_1 = Edition("2.1.0", "Description", "maxSpeed", True, _radius, False)
UNNAMED = "unknown"
"""Manufacturer and serial number: the sender knows the vehicle, the mission does not."""


def write(mission: Mission, supplements: Supplements, *, edition: Edition = V3_0) -> bytes:
    """Return the order; fleet control sets headerId, timestamp, manufacturer and serialNumber on sending."""
    poses = way(mapped(mission))
    nodes = [
        _node(waypoint, name, 2 * number, mission, edition)
        for number, (waypoint, name) in enumerate(zip(poses, _names(poses), strict=True))
    ]
    edges = [_edge(one, other, mission, edition) for one, other in pairwise(nodes)]
    order = {
        "headerId": 0,
        "timestamp": supplements.written.strftime("%Y-%m-%dT%H:%M:%S.000Z"),
        **{"version": edition.version, "manufacturer": UNNAMED, "serialNumber": UNNAMED},
        **{"orderId": f"{mission.id}-{mission.revision}", "orderUpdateId": 0},
        **{"nodes": nodes, "edges": edges},
    }
    return msgspec.json.format(msgspec.json.encode(order), indent=2) + b"\n"


def read_back(data: bytes, mission: Mission, supplements: Supplements) -> list[Point]:
    """Return the positions of the nodes that have an action, back in the site's frame."""
    nodes = msgspec.json.decode(data)["nodes"]
    places = [node["nodePosition"] for node in nodes if node["actions"]]
    to_map = mission.frame.to_map or SAME
    return [to_map.back((place["x"], place["y"])) for place in places]


def notes(mission: Mission, supplements: Supplements) -> tuple[str, ...]:
    """Return the note on keys that the sender has to fill in."""
    header = "manufacturer and serialNumber are 'unknown': fleet control names the vehicle when it sends"
    return (header, *unmapped(mission))


def _names(poses: Sequence[Waypoint]) -> list[str]:
    """A node id each: the stop's, else one that no stop has."""
    taken = {waypoint.stop.id for waypoint in poses if waypoint.stop is not None}
    names = []
    for number, waypoint in enumerate(poses):
        name = f"via-{number}" if waypoint.stop is None else waypoint.stop.id
        while waypoint.stop is None and name in taken:
            name += "_"
        names.append(name)
    return names


def _node(waypoint: Waypoint, name: str, sequence: int, mission: Mission, edition: Edition) -> dict[str, Any]:
    stop = waypoint.stop
    return {
        "nodeId": name,
        "sequenceId": sequence,
        f"node{edition.told}": "passed on the route" if stop is None else "scan stop",
        "released": True,
        "nodePosition": {
            **{"x": round(waypoint.x, 6), "y": round(waypoint.y, 6)},
            **({} if stop is None else _arrival(waypoint, stop, mission, edition)),
            "mapId": frame_name(mission),
        },
        "actions": [] if stop is None else [_scan(stop, edition)],
    }


def _arrival(waypoint: Waypoint, stop: Stop, mission: Mission, edition: Edition) -> dict[str, object]:
    """Return the tolerances of a vehicle at a stop; any heading for a scanner that sees all round."""
    arrival = {"theta": waypoint.heading, "allowedDeviationXY": edition.deviation(stop.tolerance_m)}
    if mission.scanner.fov_deg == 360.0:
        arrival["allowedDeviationTheta"] = math.pi
    return arrival


def _scan(stop: Stop, edition: Edition) -> dict[str, Any]:
    """A vehicle must know this action; HARD: neither driving nor another action meanwhile."""
    parameters = {
        **{"stop": stop.id, "profile": stop.scan.profile, "settle": stop.settle_s},
        **{"duration": stop.scan.duration_s, "timeout": stop.scan.timeout_s},
    }
    return {
        "actionType": "scan",
        "actionId": f"scan-{stop.id}",
        f"action{edition.told}": "settle, then scan; times in seconds",
        "blockingType": "HARD",
        "actionParameters": [{"key": key, "value": value} for key, value in parameters.items()],
        **({"retriable": stop.on_failure in ("retry", "ask")} if edition.retriable else {}),
    }


def _edge(one: dict[str, Any], other: dict[str, Any], mission: Mission, edition: Edition) -> dict[str, Any]:
    between = {"startNodeId": one["nodeId"], "endNodeId": other["nodeId"]}
    begin, end = (node["nodePosition"] for node in (one, other))
    return {
        "edgeId": f"edge-{one['sequenceId'] + 1}",
        "sequenceId": one["sequenceId"] + 1,
        "released": True,
        **(between if edition.edge_names_its_nodes else {}),
        edition.max_speed: mission.robot.speed,
        "length": round(math.dist((begin["x"], begin["y"]), (end["x"], end["y"])), 6),
        "actions": [],
    }
