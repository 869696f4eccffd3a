"""Types of ROS 2 without ROS: hashes against published ones, fields, and definitions of a user's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.bridge.ros2.ros_definitions import action_types, message_type, service_types
from stopgo.bridge.ros2.ros_types import plain_fields
from stopgo.mission.errors import InputError

SCAN = "string id\nfloat64 seconds\nmy_msgs/Part[] parts\nchar[2] flags\n---\nbool ok\n"


def test_hashes_are_those_that_ros_publishes() -> None:
    """Written by rosidl of Kilted for the definitions of Nav2's branches jazzy and main (as in Lyrical)."""
    assert service_types("std_srvs/srv/Trigger")[0].hash.startswith("RIHS01_eeff2cd6")
    assert service_types("action_msgs/srv/CancelGoal")[0].hash.startswith("RIHS01_573d8b0a")
    assert message_type("nav_msgs/msg/Path").hash.startswith("RIHS01_1957a5bb")
    jazzy, lyrical = action_types("nav2_msgs/action/FollowPath")
    assert (jazzy.send_goal.said, lyrical.send_goal.said) == ("Jazzy, Kilted", "Lyrical")
    assert jazzy.send_goal.hash.startswith("RIHS01_5b662aee1159e1d7")
    assert lyrical.send_goal.hash.startswith("RIHS01_0c091793c90a6734")
    spun, kilted = action_types("nav2_msgs/action/Spin")
    assert spun.send_goal.hash.startswith("RIHS01_a863727716f5620b")
    assert kilted.send_goal.hash.startswith("RIHS01_63ad359dc095261a")
    assert jazzy.get_result.hash == lyrical.get_result.hash
    jazzy, lyrical = action_types("nav2_msgs/action/NavigateToPose")
    assert jazzy.send_goal.hash == lyrical.send_goal.hash, "they differ by what is not read here"
    assert lyrical.send_goal.hash.startswith("RIHS01_a4fcb3bee1bf32e2")
    assert lyrical.get_result.hash.startswith("RIHS01_c407920357d56677")
    assert lyrical.feedback.hash.startswith("RIHS01_2c1b4ec1a0e3a53c")


def test_versions_differ_by_their_fields() -> None:
    jazzy, kilted = action_types("nav2_msgs/action/Spin")
    assert set(kilted.goal.fields) - set(jazzy.goal.fields) == {"disable_collision_checks"}
    jazzy, lyrical = action_types("nav2_msgs/action/FollowPath")
    assert lyrical.goal.fields["path_handler_id"] == "string"
    assert jazzy.goal.fields["path"] == "nav_msgs/Path"


def test_a_message_without_fields_is_one_byte() -> None:
    request = service_types("std_srvs/srv/Trigger")[0].request
    assert request.fields == {}
    assert request.encode({}) == b"\x00\x01\x00\x00\x00"


def test_types_of_a_users_own_are_read_from_a_folder(tmp_path: Path) -> None:
    for folder, name, text in (
        ("srv", "Scan.srv", SCAN),
        ("msg", "Part.msg", "uint8 number 3\n"),
        ("action", "Scan.action", f"{SCAN}---\n"),
    ):
        path = tmp_path / "my_msgs" / folder / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
    (scan,) = service_types("my_msgs/srv/Scan", str(tmp_path))
    assert scan.request.fields == {
        "id": "string", "seconds": "double", "parts": "sequence<my_msgs/Part>", "flags": "uint8[2]",
    }  # fmt: skip
    data = scan.request.encode({"id": "a", "seconds": 2.0, "parts": [{"number": 1}, {"number": 2}]})
    read = scan.request.decode(data)
    assert (read.id, read.seconds, [part.number for part in read.parts]) == ("a", 2.0, [1, 2])
    assert plain_fields(scan.response.message({"ok": True})) == {"ok": True}
    assert action_types("my_msgs/action/Scan", str(tmp_path))[0].goal.fields["id"] == "string"


@pytest.mark.parametrize(
    ("text", "words"),
    [(None, "has no my_msgs/srv/Scan.srv"), ("bool ok", "has 1 parts between lines of ---, not 2")],
)
def test_a_definition_that_is_missing_or_wrong_is_named(tmp_path: Path, text: str | None, words: str) -> None:
    if text is not None:
        path = tmp_path / "my_msgs" / "srv" / "Scan.srv"
        path.parent.mkdir(parents=True)
        path.write_text(text)
    with pytest.raises(InputError, match=words):
        service_types("my_msgs/srv/Scan", str(tmp_path))


def test_without_a_folder_the_key_that_names_one_is_named() -> None:
    with pytest.raises(InputError, match=r"name its folder with scan\.definitions"):
        service_types("my_msgs/srv/Scan")
