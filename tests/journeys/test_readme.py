"""The README's tour works as it is written, and shows what the commands print."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from stopgo.mission.files import mission_json
from stopgo.recordings.rrd.read import check
from tests.journeys.readme import PRINTED, blocks, commands, robot, run, with_output, workplace
from tests.ports import free_port


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    """Folder in which the README's commands have planned, shown and exported, and printed what it says."""
    found = blocks()
    with workplace() as made:
        for name in PRINTED:
            assert with_output(found[name], made, "") == found[name], f"refresh the README's {name}"
        yield made


def test_a_robot_that_was_unplugged_finishes_its_run(folder: Path) -> None:
    found, endpoint = blocks(), f"tcp/127.0.0.1:{free_port()}"
    first, push, start, unplug, second, *rest = commands(found["unplug"])
    assert unplug.startswith("kill -9")
    with robot(first, folder, endpoint) as process:
        assert run(push, folder, endpoint).returncode == 0
        assert run(start, folder, endpoint).returncode == 0
        assert int((folder / "robot-r2" / "lock").read_text()) == process.pid
        process.kill()
        process.wait()
    with robot(second, folder, endpoint):
        status, *others = [run(command, folder, endpoint) for command in rest]
    assert "PAUSED" in status.stdout
    assert [done.returncode for done in others] == [0, 0], [done.stderr for done in others]
    scanned = re.findall(r"Scanned +(s\d+)", others[1].stdout)
    assert len(scanned) == len(set(scanned))


def test_the_tour_runs_from_plan_to_field_recording(folder: Path) -> None:
    found, endpoint = blocks(), f"tcp/127.0.0.1:{free_port()}"
    mission = mission_json.read(folder / "plan" / "mission.json")
    with robot(commands(found["robot"])[0], folder, endpoint):
        for command in commands(found["run"]):
            done = run(command, folder, endpoint)
            assert done.returncode == 0, (command, done.stderr)
        told = run("stopgo status --robot r1 --connect tcp/127.0.0.1:7447 --json", folder, endpoint)
    status = json.loads(told.stdout)
    assert status["state"] == "FINISHED"
    assert status["done"] == [stop.id for stop in mission.stops]
    field = check(folder / "field.rrd")
    assert field.recording_id == f"{mission.id}-{status['run_id']}"
    assert field.properties["run"]["run_id"] == status["run_id"]
    assert check(folder / "plan" / "plan.rrd").recording_id == mission.id
