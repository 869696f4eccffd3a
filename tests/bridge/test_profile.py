"""Presets: an option counts most, then the environment, the folder's file, the user's file."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.commands.connection import with_presets
from stopgo.bridge.commands.doctor import robot_checks
from stopgo.bridge.profile import NAMES, read_profile
from stopgo.command_line import main
from stopgo.mission.errors import InputError
from tests.bridge.world import Field, corridor

NOTHING = {
    "robot": None,
    "mavlink": None,
    "connect": "tcp/127.0.0.1:7447",
    "site": None,
    "keys": None,
    "who": None,
}


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder, and a user's folder for settings, both empty."""
    for name in NAMES:
        monkeypatch.delenv(f"STOPGO_{name.upper()}", raising=False)
    (tmp_path / "user" / "stopgo").mkdir(parents=True)
    (tmp_path / "work").mkdir()
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "user"))
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path


def test_the_nearer_source_counts_for_each_name(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (place / "user" / "stopgo" / "stopgo.toml").write_text('robot = "r1"\nsite = "yard"\nkeys = "mine"\n')
    (place / "work" / "stopgo.toml").write_text('robot = "r2"\nconnect = "tcp/10.0.0.2:7447"\n')
    monkeypatch.setenv("STOPGO_ROBOT", "r3")
    profile = read_profile()
    assert {name: preset.value for name, preset in profile.items()} == {
        "robot": "r3",
        "connect": "tcp/10.0.0.2:7447",
        "site": "yard",
        "keys": str(place / "user" / "stopgo" / "mine"),
    }
    assert profile["robot"].source == "environment STOPGO_ROBOT"
    assert profile["connect"].source == "stopgo.toml"
    told = with_presets(frozenset({"--connect"}), dict(NOTHING))
    assert told["robot"] == "r3"
    assert told["connect"] == NOTHING["connect"]  # as it was typed
    assert told["keys"] == place / "user" / "stopgo" / "mine"
    (place / "work" / "stopgo.toml").unlink()
    monkeypatch.delenv("STOPGO_ROBOT")
    assert read_profile()["robot"].value == "r1"


def test_an_option_takes_the_place_of_robot_and_vehicle_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STOPGO_MAVLINK", "udpin:127.0.0.1:14550")
    assert with_presets(frozenset({"--robot"}), {**NOTHING, "robot": "r1"})["mavlink"] is None
    Path("stopgo.toml").write_text('robot = "r2"\n')
    told = with_presets(frozenset(), dict(NOTHING))
    assert (told["robot"], told["mavlink"]) == (None, "udpin:127.0.0.1:14550")
    monkeypatch.setenv("STOPGO_ROBOT", "r3")
    with pytest.raises(InputError, match="robot and mavlink are both preset"):
        with_presets(frozenset(), dict(NOTHING))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ('colour = "red"', "unknown key colour; known: robot, mavlink"),
        ("robot = 3", 'robot = 3: write a text in quotes, such as robot = "r1"'),
        ('robot = ""', "robot = ''"),
        ("robot", "not a TOML file"),
        ("[robot]", "robot = {}"),
    ],
)
def test_a_bad_file_is_reported_in_one_line(
    content: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("stopgo.toml").write_text(content)
    assert main(["pause"]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"stopgo: stopgo.toml: {said}")
    assert told.count("\n") == 1
    assert main(["doctor"]) == 1
    assert "WRONG  profile  stopgo.toml: " in capsys.readouterr().out


@pytest.mark.parametrize("verb", ["pause", "abort"])
def test_a_bad_file_stops_no_order_to_stop_a_robot_that_is_given(
    verb: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("stopgo.toml").write_text('colour = "red"')
    (place / "user" / "stopgo" / "stopgo.toml").write_text('site = "yard"\n')
    assert main([verb, "--robot", "r7", "--connect", "tcp/127.0.0.1:1", "--timeout", "0.1"]) == 2
    told = capsys.readouterr().err
    assert "stopgo.toml: unknown key colour" in told
    assert "its presets do not apply to this command" in told
    assert "robot r7 not found" in told
    assert "key expression yard/" in told  # the file that is valid applies
    assert main(["start", "--robot", "r7", "--connect", "tcp/127.0.0.1:1", "--timeout", "0.1"]) == 2
    assert "not found" not in capsys.readouterr().err  # what starts a robot needs all presets


def test_a_bad_file_stops_no_order_to_stop_the_robot_that_the_environment_names(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("stopgo.toml").write_text('robot = "r8')
    monkeypatch.setenv("STOPGO_ROBOT", "r7")
    monkeypatch.setenv("STOPGO_CONNECT", "tcp/127.0.0.1:1")
    assert main(["abort", "--timeout", "0.1"]) == 2
    told = capsys.readouterr().err
    assert "stopgo.toml: not a TOML file" in told
    assert "robot r7 not found" in told
    assert main(["start", "--timeout", "0.1"]) == 2
    assert "not found" not in capsys.readouterr().err


def test_a_bad_file_that_may_name_another_robot_is_not_passed_over(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The nearer file takes precedence over the user's: it alone may be the bad one."""
    near, users = Path("stopgo.toml"), place / "user" / "stopgo" / "stopgo.toml"
    names, bad = 'robot = "r7"\nconnect = "tcp/127.0.0.1:1"\n', 'robot = "r8'
    for near_text, users_text, is_found in ((names, bad, True), (bad, names, False)):
        near.write_text(near_text)
        users.write_text(users_text)
        assert main(["abort", "--timeout", "0.1"]) == 2
        assert ("robot r7 not found" in capsys.readouterr().err) == is_found


def test_a_folder_of_settings_that_may_not_be_entered_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuses(path: Path) -> bool:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "exists", refuses)
    with pytest.raises(InputError, match=r"stopgo\.toml: cannot be read \(Permission denied\)"):
        read_profile()


def test_a_command_needs_no_options(capsys: pytest.CaptureFixture[str]) -> None:
    Path("stopgo.toml").write_text('robot = "r7"\nconnect = "tcp/127.0.0.1:1"\n')
    assert main(["pause", "--timeout", "0.1"]) == 2
    assert "tcp/127.0.0.1:1: robot r7 not found" in capsys.readouterr().err


def test_doctor_reports_everything_and_ends_with_1_if_something_is_wrong(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["doctor"]) == 0
    monkeypatch.setenv("STOPGO_ROBOT", "r1")
    Path("stopgo.toml").write_text('connect = "tcp/127.0.0.1:1"\nkeys = "none"\n')
    capsys.readouterr()
    assert main(["doctor", "--timeout", "0.1", "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    wrong = {check["name"]: check["told"] for check in told["checks"] if not check["ok"]}
    assert not told["ok"]
    assert set(wrong) == {"keys", "port", "robot"}
    said = [check["told"] for check in told["checks"] if check["name"] == "profile"]
    assert "robot = r1, from environment STOPGO_ROBOT" in said
    assert "connect = tcp/127.0.0.1:1, from stopgo.toml" in said


@pytest.mark.parametrize(
    ("preset", "said"),
    [
        ('connect = "tcp/127.0.0.1:99999"', "99999 is no port"),
        ('connect = "http://127.0.0.1:80"', "not an endpoint"),
        ('connect = "tls/127.0.0.1:7447"', "tls needs --keys DIR"),
        ('connect = "tcp/127.0.0.1:1"', "nothing answers at tcp/127.0.0.1:1"),
        ('mavlink = "udp:1"', "not a MAVLink URL"),
        ('robot = "r1"\nmavlink = "udpout:127.0.0.1:14550"', "robot and mavlink are both preset"),
    ],
)
def test_doctor_finds_wrong_what_every_command_would_refuse(
    preset: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("stopgo.toml").write_text(preset)
    assert main(["doctor"]) == 1
    wrong = [line for line in capsys.readouterr().out.splitlines() if line.startswith("WRONG")]
    assert [said in line for line in wrong] == [True]


def test_doctor_asks_no_vehicle_and_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    Path("stopgo.toml").write_text('mavlink = "udpout:127.0.0.1:14550"')
    assert main(["doctor"]) == 0
    assert "udpout:127.0.0.1:14550 is a MAVLink URL; the vehicle was not queried" in capsys.readouterr().out


def test_doctor_compares_the_clocks() -> None:
    info = Field().station().info()
    right = {check.name: check for check in robot_checks(info, info.clock_ns)}
    assert all(check.ok for check in right.values())
    late = {check.name: check for check in robot_checks(info, info.clock_ns + 3_000_000_000)}
    assert (late["clock"].ok, late["clock"].result) == (False, "the robot's clock is -3.0 s from this one")
    assert "NTP" in late["clock"].action


def test_doctor_does_not_claim_that_a_wrong_clock_makes_commands_fail() -> None:
    field = Field()
    station = field.station()
    station.push(corridor())
    field.clock.jump(-3e7)
    late = {check.name: check for check in robot_checks(station.info(), 1_700_000_000_000_000_000)}
    assert not late["clock"].ok
    assert "refused" not in late["clock"].action
    assert station.command("start").outcome == "ok"


def test_doctor_reports_what_a_robot_can_and_what_it_lacks() -> None:
    info = Field().station().info()

    def can(*capabilities: str) -> str:
        told = msgspec.structs.replace(info, capabilities=capabilities)
        return next(check.result for check in robot_checks(told, info.clock_ns) if check.name == "can")

    assert can().startswith("nothing beyond version 1; lacks record: if the link is lost")
    assert can("record", "levitation") == "levitation, record"


def test_status_can_ask_all_though_one_is_preset(capsys: pytest.CaptureFixture[str]) -> None:
    Path("stopgo.toml").write_text('robot = "r7"\nconnect = "tcp/127.0.0.1:1"\n')
    assert main(["status", "--all", "--robot", "r1"]) == 2
    assert "--robot has no meaning with --all" in capsys.readouterr().err


def test_a_user_without_a_home_has_the_folders_file(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CONFIG_HOME")
    monkeypatch.delenv("APPDATA", raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    Path("stopgo.toml").write_text('robot = "r2"\n')
    assert read_profile()["robot"].value == "r2"
