"""`stopgo show` and `stopgo check` as a person runs them."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path

import ezdxf
import msgspec
import pytest

from stopgo.command_line import main
from stopgo.mission.console.table import duration, table
from stopgo.mission.document import Mission, Sees
from stopgo.mission.files.mission_json import write
from tests.mission.worlds import square_tour


@pytest.fixture
def floor(tmp_path: Path) -> Path:
    """A bare slab, 1 m larger all round than the tour."""
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 6
    corners = [(-1, -1), (5, -1), (5, 4), (-1, 4)]
    drawing.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": "FLOOR"})
    drawing.saveas(tmp_path / "room.dxf")
    return tmp_path / "room.dxf"


@pytest.fixture
def mission(floor: Path) -> Mission:
    digest = hashlib.sha256(floor.read_bytes()).hexdigest()
    origin = msgspec.structs.replace(square_tour().origin, floor_digest=digest)
    return msgspec.structs.replace(square_tour(), origin=origin)


@pytest.fixture
def path(tmp_path: Path, mission: Mission) -> str:
    write(mission, tmp_path / "mission.json")
    return str(tmp_path / "mission.json")


@pytest.fixture
def broken(tmp_path: Path, mission: Mission) -> str:
    """A readable mission that returns from nowhere at no speed."""
    robot = msgspec.structs.replace(mission.robot, speed=0.0)
    write(msgspec.structs.replace(mission, return_=(), robot=robot), tmp_path / "broken.json")
    return str(tmp_path / "broken.json")


def test_show_prints_a_row_per_stop(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", path]) == 0
    lines = capsys.readouterr().out.splitlines()
    (second,) = [line for line in lines if " S2 " in line]
    assert second.split() == ["2", "S2", "4.000", "3.000", "90.0", "3.00", "10", "10", "1:12"]
    assert "start    (0.000, 0.000) facing 0.0° (given)" in lines
    assert any("route 12.00 m and back to the start" in line for line in lines)


def test_show_as_json_is_one_object(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", path, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["stops"][1]["heading_deg"] == 90.0
    assert report["route"] == {"length_m": 12.0, "returns": True}
    assert report["schedule"]["scan_s"] == 120.0
    assert math.isclose(sum(report["schedule"].values()), 2 * report["schedule"]["total_s"])


def test_show_of_nonsense_says_what_is_wrong(broken: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", broken]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "$.robot.speed: is 0.0" in captured.err


def test_check_of_a_sound_mission_on_its_floor(
    mission: Mission, floor: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On the bare slab there is nothing to be seen, so nothing may be claimed."""
    path = tmp_path / "mission.json"
    write(mission, path)
    assert main(["check", str(path), "--floor", str(floor)]) == 1
    assert "$.stops: see nothing: room: no target on the floor" in capsys.readouterr().out
    bare = [msgspec.structs.replace(stop, sees=Sees(units=0, new_units=0)) for stop in mission.stops]
    write(msgspec.structs.replace(mission, stops=tuple(bare)), path)
    assert main(["check", str(path), "--floor", str(floor)]) == 0
    assert "valid; id 0123456789abcdef0123456789abcdef revision 1, 2 stops" in capsys.readouterr().out


def test_check_against_another_floor_is_bad_input(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", path, "--floor", path, "--json"]) == 2
    error = json.loads(capsys.readouterr().out)["error"]
    assert error["exit_code"] == 2
    assert f"{path}: is not the floor that" in error["message"]


def test_check_prints_a_line_per_problem(broken: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", broken]) == 1
    captured = capsys.readouterr()
    assert [line.partition(": ")[0] for line in captured.out.splitlines()] == ["$.robot.speed", "$.return"]
    assert captured.err == f"stopgo: {broken}: 2 problems\n"


@pytest.mark.parametrize("command", ["show", "check"])
@pytest.mark.parametrize("content", [None, b"", b"{", b'{"schema": "stopgo/mission", "version": 1}'])
def test_what_is_not_readable_is_2(
    command: str, content: bytes | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "m.json"
    if content is not None:
        file.write_bytes(content)
    assert main([command, str(file)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1
    assert "m.json" in captured.err


def test_a_floor_that_is_not_there_is_2(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", path, "--floor", "nowhere.dxf"]) == 2
    assert "nowhere.dxf: cannot be read" in capsys.readouterr().err


def test_words_stand_left_and_numbers_right() -> None:
    text = table(("no", "name"), [("1", "a"), ("10", "Büro 東")])
    assert text.splitlines() == ["no  name", "--  -------", " 1  a", "10  Büro 東"]


def test_a_file_cannot_colour_the_terminal(
    mission: Mission, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(msgspec.structs.replace(mission, name="\x1b[31mred\nline"), tmp_path / "mission.json")
    assert main(["show", str(tmp_path / "mission.json")]) == 0
    assert capsys.readouterr().out.startswith("mission  \ufffd[31mred\ufffdline, id ")


@pytest.mark.parametrize(
    ("seconds", "text"), [(0, "0:00"), (59.6, "1:00"), (725, "12:05"), (3723, "1:02:03")]
)
def test_durations_read_like_a_clock(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_a_table_is_folded_at_the_terminals_width_and_nowhere_else() -> None:
    header, rows = ("room", "number"), [("A room with a long [bold] name", "1")]
    assert table(header, rows).splitlines()[2] == "A room with a long [bold] name       1"
    folded = table(header, rows, width=20).splitlines()
    assert folded[:2] == ["room          number", "------------  ------"]
    assert " ".join(line[:12].strip() for line in folded[2:]) == rows[0][0]
    assert max(map(len, folded)) <= 20


def test_wide_letters_count_twice_and_control_characters_are_shown() -> None:
    assert table(("a", "b"), [("漢字", "x"), ("\x1b[31m", "y")]).splitlines() == [
        "a      b",
        "-----  -",
        "漢字   x",
        "\ufffd[31m  y",
    ]
