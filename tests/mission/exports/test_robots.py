"""Nav2 waypoints through a YAML reader, MCAP through rosbags, VDA 5050 orders through a JSON Schema."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import jsonschema
import msgspec
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML

from mission.document import Mission, Transform
from mission.files.exports import FORMATS, exported
from mission.files.exports.format import Supplements
from mission.files.exports.way import mapped, way
from mission.turning import turned, turned_back
from tests.mission.exports.vda5050_order import ORDER
from tests.mission.exports.worlds import MAP, laboratory, on_a_map
from tests.mission.worlds import mission_of, square_tour, stop

FileOf = Callable[[bytes, str], str]


def test_turning_onto_the_map_and_back_is_nothing() -> None:
    assert turned(Transform(x=1.0, y=2.0, heading=math.pi / 2), (3.0, 0.0)) == pytest.approx((1.0, 5.0))
    assert turned_back(MAP, turned(MAP, (12.5, -7.25))) == pytest.approx((12.5, -7.25))


def test_the_way_is_start_corners_stops_and_back() -> None:
    names = [(pose.leg, pose.stop.id if pose.stop else None) for pose in way(square_tour())]
    assert names == [("S1", None), ("S1", "S1"), ("S2", "S2"), ("return", None)]
    headings = [math.degrees(pose.heading) for pose in way(square_tour())]
    back = math.degrees(math.atan2(-3, -4))
    assert headings == pytest.approx([0.0, 0.0, 90.0, back])


def test_nav2_reads_a_pose_per_stop(mission: Mission) -> None:
    document = YAML(typ="safe").load(exported(mission, "nav2", Supplements()).decode())
    assert list(document["waypoints"]) == [f"waypoint{number}" for number in range(len(mission.stops))]
    for waypoint, there in zip(document["waypoints"].values(), mapped(mission).stops, strict=True):
        x, y, z = waypoint["pose"]
        w, i, j, k = waypoint["orientation"]
        assert (x, y, z) == pytest.approx((there.x, there.y, 0.0), abs=1e-6)
        assert (i, j) == (0.0, 0.0)
        turn = math.remainder(2 * math.atan2(k, w) - there.heading, math.tau)
        assert turn == pytest.approx(0.0, abs=1e-8)
        assert all(isinstance(value, float) for value in (*waypoint["pose"], *waypoint["orientation"]))


def test_nav2_says_in_which_frame_it_is() -> None:
    assert b"# Frame: the robot's map;" in exported(on_a_map(), "nav2", Supplements())
    assert b"# Frame: the site 'room', not turned" in exported(laboratory(), "nav2", Supplements())
    (way_, *_) = FORMATS["nav2"].notes(on_a_map(), Supplements())
    assert "Nav2 plans its own way" in way_
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


def order_of(mission: Mission) -> dict[str, list[dict[str, object]]]:
    document = json.loads(exported(mission, "vda5050", Supplements()))
    jsonschema.Draft202012Validator(ORDER).validate(document)
    return document


def test_an_order_is_a_chain_of_nodes_and_edges(mission: Mission) -> None:
    order = order_of(mission)
    nodes, edges = order["nodes"], order["edges"]
    assert [node["sequenceId"] for node in nodes] == list(range(0, 2 * len(nodes), 2))
    assert [edge["sequenceId"] for edge in edges] == list(range(1, 2 * len(nodes) - 1, 2))
    assert len({node["nodeId"] for node in nodes}) == len(nodes)
    for edge, begin, end in zip(edges, nodes, nodes[1:], strict=False):
        assert (edge["startNodeId"], edge["endNodeId"]) == (begin["nodeId"], end["nodeId"])
    assert all(part["released"] for part in (*nodes, *edges))


def test_an_order_scans_at_every_stop_and_nowhere_else(mission: Mission) -> None:
    scans = [(node["nodeId"], node["actions"]) for node in order_of(mission)["nodes"] if node["actions"]]
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
        assert all(place["allowedDeviationXY"] == 0.05 for place in stops)


def test_a_corner_never_takes_the_name_of_a_stop() -> None:
    mission = mission_of(stop("via-0", (0, 0), (1, 0), (1, 1)), stop("via-1", (1, 1), (2, 1)))
    names = [node["nodeId"] for node in order_of(mission)["nodes"]]
    assert names == ["via-0_", "via-1_", "via-0", "via-1"]
