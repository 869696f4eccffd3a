"""The README's tour works as it is written, and shows what the commands print."""

from __future__ import annotations

import json

from bridge.spawn import free_port
from mission.files import mission_json
from recordings.read import check
from tests.journeys.readme import blocks, commands, robot, run, with_output, workplace


def test_the_tour_runs_from_plan_to_field_recording() -> None:
    found, endpoint = blocks(), f"tcp/127.0.0.1:{free_port()}"
    with workplace() as folder:
        for name in ("plan", "show"):
            assert with_output(found[name], folder, endpoint) == found[name], f"refresh the README's {name}"
        mission = mission_json.read(folder / "plan" / "mission.json")
        with robot(commands(found["robot"])[0], folder, endpoint):
            for command in commands(found["run"]):
                done = run(command, folder, endpoint)
                assert done.returncode == 0, (command, done.stderr)
            told = run("stopgo status --robot r1 --connect tcp/127.0.0.1:7447 --json", folder, endpoint)
        status = json.loads(told.stdout)
        assert status["state"] == "FINISHED"
        assert status["done"] == [stop.id for stop in mission.stops]
        assert check(folder / "field.rrd").recording_id == mission.id
        assert check(folder / "plan" / "plan.rrd").recording_id == mission.id
