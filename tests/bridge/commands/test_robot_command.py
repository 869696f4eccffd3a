"""`stopgo robot` takes an option where it means something, and refuses it elsewhere whatever its value."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.command_line import main

ROBOT = ["--name", "r1", "--state", "s"]
DRIVEN = [*ROBOT, "--controller", "mavlink:udpin:127.0.0.1:14550"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--state", "s"], "--name"),
        (["--name", "r1"], "--state"),
        ([*ROBOT, "--profile", "px4"], "--profile"),
        ([*ROBOT, "--origin", "47,8,400"], "--origin"),
        (
            [*ROBOT, "--controller", "vehicle"],
            "--controller vehicle: no such controller; known: sim, mavlink:URL, ros2[:FILE]",
        ),
        # Given is given, whatever the value: the default too.
        ([*ROBOT, "--trigger", "camera"], "--trigger has no meaning with a simulated robot"),
        ([*ROBOT, "--signing-key", "k"], "--signing-key has no meaning with a simulated robot"),
        ([*ROBOT, "--vehicle", "1"], "--vehicle has no meaning with a simulated robot"),
        ([*ROBOT, "--arm"], "--arm has no meaning with a simulated robot"),
        ([*DRIVEN, "--battery-life", "5"], "--battery-life has no meaning with an autopilot"),
        ([*DRIVEN, "--battery-life", "6"], "--battery-life has no meaning with an autopilot"),
        ([*DRIVEN, "--speed-up", "1"], "--speed-up has no meaning with an autopilot"),
        ([*DRIVEN, "--map", "0,0,0"], "--map has no meaning with an autopilot"),
        ([*DRIVEN, "--at", "0,0,0"], "--at has no meaning with an autopilot"),
        ([*DRIVEN, "--fault", "slip@1"], "--fault has no meaning with an autopilot"),
        (
            [*ROBOT, "--connect", "tcp/127.0.0.1:1", "--listen", "tcp/127.0.0.1:7447"],
            "--listen has no meaning with --connect",
        ),
    ],
)
def test_options_that_cannot_be_are_refused_in_one_line(
    options: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    code = main(["robot", *options])
    out = capsys.readouterr()
    assert (code, out.out) == (2, "")
    assert said in out.err
    assert len(out.err.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir()), "nothing is begun"


@pytest.mark.parametrize("seconds", ["inf", "nan", "1e300"])
@pytest.mark.parametrize("command", [["status"], ["push", "mission.json"]])
def test_a_wait_without_an_end_is_refused_in_one_line(
    command: list[str], seconds: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code = main([*command, "--robot", "r1", "--connect", "tcp/127.0.0.1:1", "--timeout", seconds])
    assert code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "'--timeout'" in line
