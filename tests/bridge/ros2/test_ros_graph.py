"""Liveliness tokens of rmw_zenoh, and pairs that do not hear each other."""

from __future__ import annotations

from stopgo.bridge.ros2.ros_graph import actions_of, discords, entity_of

STRING = "std_msgs::msg::dds_::String_"


def token(
    kind: str,
    name: str = "%r1%chatter",
    type_: str = STRING,
    qos: str = "::,10:,:,:,,",
    of: str = "RIHS01_aa",
) -> str:
    return f"@ros2_lv/7/abc/0/4/{kind}/%/%r1/talker/{name}/{type_}/{of}/{qos}"


def found(*tokens: str) -> list[str]:
    return list(discords(one for one in map(entity_of, tokens) if one is not None))


def test_a_token_names_node_topic_type_and_hash() -> None:
    one = entity_of(token("MP"))
    assert one is not None
    assert (one.domain, one.kind, one.node, one.name) == (7, "publisher", "/r1/talker", "/r1/chatter")
    assert (one.type, one.key) == ("std_msgs/msg/String", f"7/r1/chatter/{STRING}/RIHS01_aa")
    assert (one.reliable, one.kept) == (True, False)


def test_a_node_without_namespace_and_keys_of_others() -> None:
    node = entity_of("@ros2_lv/0/abc/0/0/NN/%/%/talker")
    assert node is not None and node.node == "/talker"
    assert entity_of("sx/1/r1/alive") is None
    assert entity_of("@ros2_lv/0/abc/0/4/MP/%/%r1/talker/%chatter") is None
    assert entity_of(token("MP", type_="String")) is None


def test_what_does_not_fit_is_named() -> None:
    assert found(token("MP"), token("MS")) == []
    assert (
        "best effort is published, reliable is subscribed" in found(token("MP", qos="2::,"), token("MS"))[0]
    )
    assert "volatile is published, transient local" in found(token("MP"), token("MS", qos=":1:,"))[0]
    assert (
        "types std_msgs/msg/String and a/msg/B"
        in found(token("MP"), token("MS", type_="a::msg::dds_::B_"))[0]
    )
    other = found(token("MP"), token("MS", of="RIHS01_bb"))
    assert other[0].endswith("two versions of std_msgs/msg/String: RIHS01_aa and RIHS01_bb")


def test_an_action_is_known_by_its_goal_service() -> None:
    goal = token("SS", "%follow_path%_action%send_goal", "nav2_msgs::action::dds_::FollowPath_SendGoal_")
    one = entity_of(goal)
    assert one is not None
    assert actions_of([one]) == {"/follow_path": "nav2_msgs/action/FollowPath"}


def bridged(
    kind: str, key: str = "r1§odom", type_: str = "nav_msgs§msg§Odometry", qos: str = ":1:0:0,10"
) -> str:
    return f"@/12ab34cd56/@ros2_lv/{kind}/{key}/{type_}/{qos}"


def test_a_bridges_token_names_key_type_and_qos() -> None:
    one = entity_of(bridged("MP", qos=":0:1:0,1:typehash=RIHS01_aa;"))
    assert one is not None
    assert (one.domain, one.kind, one.name, one.key) == (None, "publisher", "/r1/odom", "r1/odom")
    assert (one.type, one.hash, one.reliable, one.kept) == ("nav_msgs/msg/Odometry", "RIHS01_aa", False, True)
    assert one.node == "zenoh-bridge-ros2dds 12ab34cd"
    action = entity_of("@/12ab/@ros2_lv/AS/r1§follow_path/nav2_msgs§action§FollowPath")
    assert action is not None
    assert actions_of([action]) == {"/r1/follow_path": "nav2_msgs/action/FollowPath"}


def test_what_is_no_bridges_token() -> None:
    for text in ("@/12ab/router", "@/12ab/@ros2_lv/XX/a/b", bridged("MP", type_="Odometry"), "@"):
        assert entity_of(text) is None
    bare = entity_of("@/12ab/@ros2_lv/MP/odom/nav_msgs§msg§Odometry")
    assert bare is not None and (bare.hash, bare.reliable, bare.kept) == ("", True, False)
