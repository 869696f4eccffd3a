"""Nav2 waypoints through a YAML reader, MCAP through rosbags, VDA 5050 orders through a JSON Schema."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import jsonschema
import msgspec
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML

from stopgo.mission.document import Mission, OnFailure
from stopgo.mission.files.exports import FORMATS, exported, format_named
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.exports.waypoints import mapped, way
from stopgo.mission.frames.transform import Transform
from tests.mission.files.exports.vda5050_order import ORDERS
from tests.mission.files.exports.worlds import MAP, laboratory, on_a_map
from tests.mission.worlds import mission_of, square_tour, stop

FileOf = Callable[[bytes, str], str]


def test_turning_onto_the_map_and_back_is_nothing() -> None:
    assert Transform(x=1.0, y=2.0, heading=math.pi / 2).point((3.0, 0.0)) == pytest.approx((1.0, 5.0))
    assert MAP.back(MAP.point((12.5, -7.25))) == pytest.approx((12.5, -7.25))


def test_the_path_is_start_corners_stops_and_back() -> None:
    names = [(pose.leg, pose.stop.id if pose.stop else None) for pose in way(square_tour())]
    assert names == [("S1", None), ("S1", "S1"), ("S2", "S2"), ("return", None)]
    headings = [math.degrees(pose.heading) for pose in way(square_tour())]
    back = math.degrees(math.atan2(-3, -4))
    assert headings == pytest.approx([0.0, 0.0, 90.0, back])


def nav2(mission: Mission) -> dict[str, dict[str, dict[str, list[float]]]]:
    document = YAML(typ="safe").load(exported(mission, "nav2", Supplements()).decode())
    assert isinstance(document, dict)
    return document


def test_nav2_reads_a_pose_per_stop(mission: Mission) -> None:
    document = nav2(mission)
    assert list(document["waypoints"]) == [f"waypoint{number}" for number in range(len(mission.stops))]
    for waypoint, there in zip(document["waypoints"].values(), mapped(mission).stops, strict=True):
        x, y, z = waypoint["pose"]
        w, i, j, k = waypoint["orientation"]
        assert (x, y, z) == pytest.approx((there.x, there.y, 0.0), abs=1e-6)
        assert (i, j) == (0.0, 0.0)
        turn = math.remainder(2 * math.atan2(k, w) - there.heading, math.tau)
        assert turn == pytest.approx(0.0, abs=1e-8)
        assert all(isinstance(value, float) for value in (*waypoint["pose"], *waypoint["orientation"]))


def test_nav2_is_given_every_leg_and_the_return(mission: Mission) -> None:
    document, there = nav2(mission), mapped(mission)
    for waypoint, stop_ in zip(document["waypoints"].values(), there.stops, strict=True):
        assert np.allclose(waypoint["approach"], stop_.approach, rtol=0, atol=1e-6)
        assert waypoint["approach"][-1] == waypoint["pose"][:2]
    assert ("return" in document) == (there.return_ is not None)
    if there.return_ is not None:
        assert np.allclose(np.array(document["return"]), there.return_, rtol=0, atol=1e-6)


def test_the_route_server_reads_a_graph_on_which_every_leg_can_be_driven(mission: Mission) -> None:
    """What its loader takes: unique numbers, edges between known nodes, metadata of plain values."""
    there = mapped(mission)
    features = json.loads(exported(mission, "nav2-route", Supplements()))["features"]
    nodes = {item["properties"]["id"]: item for item in features if item["geometry"]["type"] == "Point"}
    edges = [item for item in features if item["geometry"]["type"] == "MultiLineString"]
    numbers = [item["properties"]["id"] for item in features]
    assert len(set(numbers)) == len(features)
    place = {number: tuple(node["geometry"]["coordinates"]) for number, node in nodes.items()}
    driven = set()
    for edge in edges:
        ends = (edge["properties"]["startid"], edge["properties"]["endid"])
        assert [place[end] for end in ends] == [tuple(end) for end in edge["geometry"]["coordinates"][0]]
        driven.add((place[ends[0]], place[ends[1]]))
    for stop_ in there.stops:
        leg = [(round(x, 6), round(y, 6)) for x, y in stop_.approach]
        assert {pair for pair in pairwise(leg) if pair[0] != pair[1]} <= driven
    scans = [scan for node in nodes.values() for scan in node["properties"].get("operations", {}).values()]
    scans.sort(key=lambda scan: scan["metadata"]["number"])
    assert [scan["metadata"]["stop"] for scan in scans] == [stop_.id for stop_ in there.stops]
    assert {scan["trigger"] for scan in scans} == {"NODE"}


def test_nav2_says_in_which_frame_it_is() -> None:
    assert b"# Frame: the robot's map;" in exported(on_a_map(), "nav2", Supplements())
    assert b"# Frame: the site 'room', not transformed to a map" in exported(
        laboratory(), "nav2", Supplements()
    )
    (way_, *_) = FORMATS["nav2"].notes(on_a_map(), Supplements())
    assert "plans its own path" in way_
    assert len(FORMATS["nav2"].notes(laboratory(), Supplements())) == 2


def test_rosbags_reads_path_and_stops(mission: Mission, file: FileOf) -> None:
    written = datetime(2026, 11, 21, 12, tzinfo=UTC)
    bag = Path(file(exported(mission, "mcap", Supplements(written=written)), "site.mcap"))
    there = mapped(mission)
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        read = {c.topic: (c, time, reader.deserialize(raw, c.msgtype)) for c, time, raw in reader.messages()}
    assert {topic: c.msgtype for topic, (c, _, _) in read.items()} == {
        "/stopgo/path": "nav_msgs/msg/Path",
        "/stopgo/stops": "geometry_msgs/msg/PoseArray",
    }
    assert {time for _, time, _ in read.values()} == {int(written.timestamp()) * 10**9}
    path, stops = read["/stopgo/path"][2], read["/stopgo/stops"][2]
    frame = "map" if mission.frame.to_map else mission.frame.name
    assert {path.header.frame_id, stops.header.frame_id, *(p.header.frame_id for p in path.poses)} == {frame}
    assert [(p.pose.position.x, p.pose.position.y) for p in path.poses] == [p.xy for p in way(there)]
    assert [(p.position.x, p.position.y) for p in stops.poses] == [(s.x, s.y) for s in there.stops]
    for pose, stop_ in zip(stops.poses, there.stops, strict=True):
        turn = 2 * math.atan2(pose.orientation.z, pose.orientation.w) - stop_.heading
        assert math.remainder(turn, math.tau) == pytest.approx(0.0, abs=1e-12)
    qos = read["/stopgo/path"][0].ext.offered_qos_profiles[0]
    assert qos.durability.name == "TRANSIENT_LOCAL"


@pytest.fixture(params=ORDERS)
def edition(request: pytest.FixtureRequest) -> str:
    assert isinstance(request.param, str)
    return request.param


def order_of(mission: Mission, edition: str = "vda5050") -> dict[str, list[dict[str, object]]]:
    document = json.loads(exported(mission, edition, Supplements()))
    jsonschema.Draft202012Validator(ORDERS[edition]).validate(document)
    assert isinstance(document, dict)
    return document


def test_an_order_is_a_chain_of_nodes_and_edges(mission: Mission, edition: str) -> None:
    order = order_of(mission, edition)
    nodes, edges = order["nodes"], order["edges"]
    assert [node["sequenceId"] for node in nodes] == list(range(0, 2 * len(nodes), 2))
    assert [edge["sequenceId"] for edge in edges] == list(range(1, 2 * len(nodes) - 1, 2))
    assert len({node["nodeId"] for node in nodes}) == len(nodes)
    speed = {"vda5050": "maximumSpeed", "vda5050-2.1": "maxSpeed"}[edition]
    assert {edge[speed] for edge in edges} == {mission.robot.speed}
    if edition == "vda5050-2.1":
        ends = [(edge["startNodeId"], edge["endNodeId"]) for edge in edges]
        assert ends == [(one["nodeId"], other["nodeId"]) for one, other in pairwise(nodes)]
    assert all(part["released"] for part in (*nodes, *edges))


def test_an_order_scans_at_every_stop_and_nowhere_else(mission: Mission, edition: str) -> None:
    nodes = order_of(mission, edition)["nodes"]
    scans = [(node["nodeId"], node["actions"]) for node in nodes if node["actions"]]
    assert [name for name, _ in scans] == [stop.id for stop in mission.stops]
    for stop_, (_, (action,)) in zip(mission.stops, scans, strict=True):
        told = {item["key"]: item["value"] for item in action["actionParameters"]}
        assert (action["actionType"], action["blockingType"]) == ("scan", "HARD")
        assert told["duration"] == stop_.scan.duration_s
        assert told["settle"] == stop_.settle_s


def test_an_order_asks_for_headings_only_where_they_matter() -> None:
    narrow = msgspec.structs.replace(laboratory().scanner, fov_deg=90.0)
    for mission, free in (
        (laboratory(), True),
        (msgspec.structs.replace(laboratory(), scanner=narrow), False),
    ):
        stops = [node["nodePosition"] for node in order_of(mission)["nodes"] if node["actions"]]
        assert all(("allowedDeviationTheta" in place) is free for place in stops)
        assert all(place["allowedDeviationXY"] == {"a": 0.05, "b": 0.05, "theta": 0} for place in stops)
    stops = [
        node["nodePosition"] for node in order_of(laboratory(), "vda5050-2.1")["nodes"] if node["actions"]
    ]
    assert all(place["allowedDeviationXY"] == 0.05 for place in stops)


@pytest.mark.parametrize(
    ("policy", "retriable"),
    [("retry", True), ("ask", True), ("skip", False), ("abort", False), ("home", False)],
)
def test_a_scan_may_be_tried_again_where_the_mission_lets_it(policy: OnFailure, retriable: bool) -> None:
    stops = tuple(msgspec.structs.replace(stop, on_failure=policy) for stop in laboratory().stops)
    nodes = order_of(msgspec.structs.replace(laboratory(), stops=stops))["nodes"]
    assert {action["retriable"] for node in nodes for action in node["actions"]} == {retriable}


def test_the_file_says_which_version_it_is_of(tmp_path: Path) -> None:
    for name, edition in (("a.vda5050.json", "vda5050"), ("a.vda5050-2.1.json", "vda5050-2.1")):
        assert format_named(None, tmp_path / name) == edition


def test_a_corner_never_takes_the_name_of_a_stop() -> None:
    mission = mission_of(stop("via-0", (0, 0), (1, 0), (1, 1)), stop("via-1", (1, 1), (2, 1)))
    names = [node["nodeId"] for node in order_of(mission)["nodes"]]
    assert names == ["via-0_", "via-1_", "via-0", "via-1"]
