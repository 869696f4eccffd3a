"""ros2.toml: defaults, and one line for each mistake."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from stopgo.bridge.ros2.ros_scanner import filled, found, result_of
from stopgo.bridge.ros2.ros_settings import RosSettings, ScanCall, read_ros_settings
from stopgo.mission.errors import InputError
from stopgo.mission.run.scans import ScanFailed, ScanResult
from tests.bridge.ros2.world import FakeCall


def test_a_file_changes_what_it_names_only(tmp_path: Path) -> None:
    path = tmp_path / "ros2.toml"
    path.write_text('[topics]\nodometry = "wheel/odom"\n[scan]\ntype = "blk_msgs/action/Scan"\n')
    read = read_ros_settings(path)
    assert (read.topics.odometry, read.scan.kind) == ("wheel/odom", "action")
    assert read.drive == RosSettings().drive


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[topics]\nodometry = 3", "topics.odometry = 3: Expected `str`, got `int`"),
        ('[topics]\nodometry = ""', "topics.odometry = ''"),
        ('[scan]\ntype = "Trigger"', "scan.type = 'Trigger'"),
        ("[limits]\njump_m = -1", "limits.jump_m = -1"),
        ("[topic]\nodometry = 'odom'", "unknown field `topic`"),
        ("[topics]\nspeed = 'odom'", "topics: Object contains unknown field `speed`"),
    ],
)
def test_a_mistake_is_one_line_with_what_was_found(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "ros2.toml"
    path.write_text(text)
    with pytest.raises(InputError) as told:
        read_ros_settings(path)
    assert words in str(told.value)
    assert "\n" not in str(told.value)


def test_the_files_of_the_guide_are_read(tmp_path: Path) -> None:
    guide = Path(__file__).parents[3] / "docs" / "how-to" / "nav2.md"
    files = re.findall(r"^```toml\n(.*?)^```", guide.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    for number, text in enumerate(files):
        path = tmp_path / f"{number}.toml"
        path.write_text(text)
        read_ros_settings(path)
    assert len(files) == 2


def test_a_request_gets_values_of_the_scan_with_their_types() -> None:
    values = {"label": "r-s1-1", "duration_s": 60.0}
    assert filled({"id": "{label}", "opts": {"t": "{duration_s}"}, "n": 2}, values) == {
        "id": "r-s1-1", "opts": {"t": 60.0}, "n": 2,
    }  # fmt: skip
    assert filled("scan {label}", values) == "scan r-s1-1"


def test_a_field_may_be_in_the_json_of_a_text() -> None:
    assert found({"message": '{"file": "a.e57", "n": {"points": 5}}'}, "message.n.points") == 5
    assert found({"message": "a.e57"}, "message.file") is None


def test_a_response_without_a_failure_field_counts_by_its_file(tmp_path: Path) -> None:
    (tmp_path / "a.e57").write_bytes(b"12345")
    settings = ScanCall(success="", file="path", points="n", folder=str(tmp_path))
    result = result_of(FakeCall(fields={"path": "/data/a.e57", "n": 7}), settings)
    assert isinstance(result, ScanResult)
    assert (result.size, result.points, result.sha256[:8]) == (5, 7, "5994471a")


def test_a_failed_call_is_a_failed_scan() -> None:
    failed = result_of(FakeCall(fields={"success": False, "message": "no laser"}), ScanCall())
    assert failed == ScanFailed(reason="the scanner reported a failure: no laser")
