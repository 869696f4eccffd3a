"""`stopgo conform` against whole processes: what it prints, and what its exit code means."""

from __future__ import annotations

import json
from contextlib import nullcontext
from io import StringIO
from pathlib import Path

import pytest
import typer

from stopgo.bridge.commands.conform_commands import ask_for_restart, report
from stopgo.bridge.commands.spawn import robot_process
from stopgo.bridge.conform.requirements import ConformVerdict, NotTried, TriedOutcome
from stopgo.command_line import main
from stopgo.mission.files.mission_json import write
from tests.bridge.guarded import keys_of_site
from tests.bridge.world import corridor
from tests.called import stopgo
from tests.ports import free_port


def test_a_robot_with_keys_meets_what_can_be_tried_at_rest(tmp_path: Path) -> None:
    site = keys_of_site(tmp_path / "site")
    listen = f"tls/127.0.0.1:{free_port()}"
    with robot_process("r1", tmp_path / "s", listen=listen, extra=["--keys", str(site / "r1")]) as endpoint:
        reach = ("--robot", "r1", "--connect", endpoint, "--keys", str(site / "alice"))
        done = stopgo(
            "conform", "robot", *reach, "--other-keys", str(site / "bob"), "--timeout", "60", "--json"
        )
        told = json.loads(done.stdout)
        assert done.returncode == 3, [one for one in told["requirements"] if one["outcome"] == "failed"]
        assert told["counts"]["failed"] == 0
        assert done.stderr.splitlines() == [
            "r1: will not drive, requirements that need it are not tested; add --drive",
            "r1: not a pass, durability was not tested: a boot has an id; mission, lease, events outlive it;"
            " answers outlive a restart; commands of the boot before do not; add --restart COMMAND",
        ]
        untried = {one["reason"] for one in told["requirements"] if one["outcome"] == "not tried"}
        assert untried == {
            "the robot would drive: --drive",
            "the robot takes any scan profile (Info.profiles is null)",
            "needs a restart of the robot: --restart COMMAND, or a person at a terminal",
        }


def test_a_robot_on_a_run_is_not_tried(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(corridor(), tmp_path / "mission.json")
    with robot_process("r1", tmp_path / "s") as endpoint:
        reach = ("--robot", "r1", "--connect", endpoint)
        assert main(["push", str(tmp_path / "mission.json"), *reach]) == 0
        assert main(["start", *reach]) == 0
        capsys.readouterr()
        assert main(["conform", "robot", *reach, "--drive"]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err == (
            "stopgo: r1 is RUNNING: a robot on a run is not tested; end the run first"
            " (stopgo abort --robot r1)\n"
        )
        assert main(["pause", *reach]) == 0


@pytest.mark.parametrize(("typed", "tested"), [("\n", True), ("n\n", False), ("no\n", False)])
def test_without_a_command_the_person_is_asked_to_restart(
    typed: str, tested: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", StringIO(typed))
    with nullcontext() if tested else pytest.raises(NotTried, match="the robot was not restarted"):
        ask_for_restart("r1")
    assert "cut its power or kill its program" in capsys.readouterr().err


@pytest.mark.parametrize(("outcome", "code"), [("passed", 0), ("not tried", 3), ("failed", 1)])
def test_what_is_needed_and_not_tested_is_no_pass(outcome: TriedOutcome, code: int) -> None:
    verdicts = [
        ConformVerdict("Keys", "it answers", "passed"),
        ConformVerdict("Events", "it remembers", outcome, needed=True),
    ]
    ended = 0
    try:
        report("r1", "robot", verdicts, as_json=False)
    except typer.Exit as end:
        ended = end.exit_code
    assert ended == code
