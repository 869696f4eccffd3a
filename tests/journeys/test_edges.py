"""Every command, given what it cannot use: one line, the right exit code, and nothing left behind."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from stopgo.command_line import front_door, main
from stopgo.mission.files.mission_json import write
from tests.mission.worlds import square_tour

NOWHERE = "udpout:127.0.0.1:19"
NEED_NOTHING = ("demo", "status", "doctor", "site")
"""Commands that work without an argument; `site` serves its page until it is ended."""
READERS = {
    "show": ("show", "FILE"),
    "check": ("check", "FILE"),
    "check --floor": ("check", "mission.json", "--floor", "FILE"),
    "export": ("export", "FILE", "-o", "out.csv"),
    "export --floor": ("export", "mission.json", "--floor", "FILE", "-o", "out.dxf"),
    "export --coverage": ("export", "mission.json", "--coverage-file", "FILE", "-o", "out.dxf"),
    "import": ("import", "FILE", "-o", "out.json"),
    "import --from": ("import", "FILE", "--from", "plan", "-o", "out.json"),
    "import --parameters": ("import", "stops.csv", "-p", "FILE", "-o", "out.json"),
    "plan": ("plan", "FILE", "-o", "out"),
    "plan --parameters": ("plan", "floor.dxf", "-p", "FILE", "-o", "out"),
    "push": ("push", "FILE", "--robot", "r1"),
    "push --mavlink": ("push", "FILE", "--mavlink", NOWHERE),
    "push --keys": ("push", "mission.json", "--robot", "r1", "--keys", "FILE"),
    "status --keys": ("status", "--robot", "r1", "--keys", "FILE"),
    "review": ("review", "FILE"),
    "keys list": ("keys", "list", "FILE"),
    "keys rotate": ("keys", "rotate", "r1", "--in", "FILE"),
    "keys revoke": ("keys", "revoke", "r1", "--in", "FILE"),
    "keys router-rules": ("keys", "router-rules", "--in", "FILE"),
    "keys issue": ("keys", "issue", "robot", "r1", "--in", "FILE"),
}
"""Commands that read FILE."""
WRITERS = {
    "export": ("export", "mission.json", "--to", "csv", "-o", "OUT"),
    "import": ("import", "stops.csv", "-o", "OUT"),
    "watch": ("watch", "--robot", "r1", "--timeout", "0.1", "--rrd", "OUT"),
}
"""Commands that write OUT."""


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    write(square_tour(), "mission.json")
    (tmp_path / "stops.csv").write_text("x,y\n0,0\n1,0\n")
    (tmp_path / "folder").mkdir()
    (tmp_path / "empty").touch()
    (tmp_path / "noise").write_bytes(bytes(range(255, -1, -1)) * 20)
    yield tmp_path


@pytest.mark.parametrize(
    "file", ["folder", "empty", "noise", "missing", "noise/below", "\x1b[31mred", "/dev/null"]
)
@pytest.mark.parametrize("command", READERS)
def test_what_cannot_be_read_is_one_line(
    command: str, file: str, workplace: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(os.listdir(workplace))
    arguments = [file if word == "FILE" else word for word in READERS[command]]
    assert main(arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("stopgo: ")
    assert line.isprintable()
    assert sorted(os.listdir(workplace)) == before


@pytest.mark.parametrize(
    "file", ["folder", "missing/below", "stops.csv/below", "/dev/full", "/proc/out", "x" * 300]
)
@pytest.mark.parametrize("command", WRITERS)
def test_what_cannot_be_written_is_one_line(
    command: str, file: str, workplace: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(os.listdir(workplace))
    assert main([file if word == "OUT" else word for word in WRITERS[command]]) == 2
    *_, line = capsys.readouterr().err.splitlines()
    assert line.startswith("stopgo: ")
    assert sorted(os.listdir(workplace)) == before


def names() -> list[str]:
    return sorted(front_door().commands)


def test_the_front_door_of_one_command_offers_what_the_whole_one_does() -> None:
    def offered(command: Any) -> object:
        options = [(option.name, option.opts, option.required) for option in command.params]
        return options, {name: offered(verb) for name, verb in getattr(command, "commands", {}).items()}

    for name in names():
        assert list(front_door(name).commands) == [name]
        assert offered(front_door(name).commands[name]) == offered(front_door().commands[name])
    for word in ("", "--version", "plann"):
        assert sorted(front_door(word).commands) == names()


@pytest.mark.parametrize("command", [name for name in names() if name not in NEED_NOTHING])
def test_a_command_without_options_says_what_it_needs(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    (line,) = told.err.splitlines()
    assert len(line) < 120


@pytest.mark.parametrize(
    ("command", "verbs"),
    [("keys", "init, issue, list, rotate, revoke, router-rules"), ("tunnel", "robot, station")],
)
@pytest.mark.parametrize("verb", [(), ("nope",)])
def test_a_command_without_its_verb_names_them(
    command: str, verbs: str, verb: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, *verb]) == 2
    assert f"stopgo {command} has: {verbs} (see --help)\n" in capsys.readouterr().err


def test_a_byte_order_mark_is_read_over(workplace: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Some editors put one before everything they save."""
    document = (workplace / "mission.json").read_bytes()
    (workplace / "mission.json").write_bytes(b"\xef\xbb\xbf" + document)
    (workplace / "plan.toml").write_bytes(b"\xef\xbb\xbf[plan]\nd_sec = 0.8\n")
    assert main(["check", "mission.json"]) == 0
    assert main(["plan", "-p", "plan.toml", "--print-config"]) == 0
    assert "clearance = 0.8\n" in capsys.readouterr().out


def test_print_config_answers_in_json_as_in_toml(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--clearance", "0.8", "--print-config"]) == 0
    toml = tomllib.loads(capsys.readouterr().out)
    assert main(["plan", "--clearance", "0.8", "--print-config", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert {table: {k: v for k, v in of.items() if v is not None} for table, of in told.items()} == toml


def test_a_name_longer_than_any_is_reported_by_its_beginning(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "x" * 5000]) == 2
    line = capsys.readouterr().err
    assert line.startswith(f"stopgo: {'x' * 80}…")
    assert len(line) < 300


@pytest.mark.parametrize("altitude", ["1e+08", "-10001"])
def test_a_site_is_not_in_space(altitude: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--origin", f"47,8,{altitude},0", "--print-config"]) == 2
    line = f"stopgo: --origin 47,8,{altitude},0: altitude must be within ±10000 m\n"
    assert capsys.readouterr().err == line


@pytest.mark.parametrize("radius", ["-2", "0"])
def test_a_circle_to_avoid_has_a_radius(radius: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--avoid", f"1,1,{radius}", "--print-config"]) == 2
    assert capsys.readouterr().err == f"stopgo: --avoid 1,1,{radius}: the radius must be greater than 0\n"


@pytest.mark.parametrize("endpoint", ["tcp/127.0.0.1:99999", "tcp/127.0.0.1:0"])
@pytest.mark.parametrize(
    "command",
    [("robot", "--name", "r1", "--state", "state", "--listen"), ("status", "--robot", "r1", "--connect")],
)
def test_a_port_that_is_none_is_named(
    command: tuple[str, ...], endpoint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command, endpoint]) == 2
    port = endpoint.rpartition(":")[2]
    expected = f"stopgo: {command[-1]} {endpoint}: {port} is no port (1 to 65535)\n"
    assert capsys.readouterr().err == expected


@pytest.mark.parametrize("command", [("abort",), ("push", "mission.json"), ("watch",), ("status",)])
def test_an_order_is_for_one_robot(
    command: tuple[str, ...], workplace: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command, "--robot", "*"]) == 2
    assert capsys.readouterr().err.startswith("stopgo: robot name '*': use letters")


@pytest.mark.parametrize(
    "command",
    [("show", "none.json"), ("plan", "none.dxf"), ("pause",), ("check", "none.json"), ("plan", "--nonsense")],
)
def test_with_json_an_error_is_json_too(
    command: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    code = main([*command, "--json"])
    told = capsys.readouterr()
    error = json.loads(told.out)["error"]
    assert code == error["exit_code"] == 2
    assert told.err == f"stopgo: {error['message']}\n"
    assert main([*command]) == 2
    assert capsys.readouterr().out == ""


def test_another_floor_is_the_same_bad_input_to_every_command(
    workplace: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is compared with a floor that is not the mission's, whatever the file is."""
    (workplace / "other.dxf").write_text("another floor")
    mission, floor = "mission.json", ["--floor", "other.dxf"]
    assert main(["check", mission, *floor]) == 2
    line = capsys.readouterr().err
    assert "other.dxf: is not the floor that" in line and line.count("\n") == 1
    for command in (["prove", mission, *floor], ["export", mission, *floor, "-o", "x.dxf"]):
        assert main(command) == 2
        assert capsys.readouterr().err == line


@pytest.mark.parametrize(("typed", "offered"), [("stopgo pau", "pause"), ("stopgo plan --sel", "--selector")])
def test_a_shell_completes_commands_and_options(
    typed: str, offered: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("_STOPGO_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", typed)
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) - 1))
    with pytest.raises(SystemExit) as left:
        main([])
    assert left.value.code == 0
    assert capsys.readouterr().out.split() == [offered]
