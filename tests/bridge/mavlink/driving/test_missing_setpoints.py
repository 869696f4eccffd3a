"""A vehicle that the gateway drives stands by itself once no setpoints come: the promise in plugins.md."""

from __future__ import annotations

import math
import re
import time
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.driving.setpoints import Setpoints
from stopgo.mission.mavlink.autopilots import autopilot_named
from tests.bridge.mavlink.driving.world import gateway, rover, site_mission
from tests.faults.sizes import some

pytestmark = pytest.mark.usefixtures("own_time")

STEP_S = 0.2
COASTS_S = 1.5
"""Time that a vehicle needs from 0.5 m/s to a standstill, with the delay of its reports."""
PLUGINS = Path(__file__).parents[4] / "docs" / "how-to" / "plugins.md"


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_a_vehicle_without_setpoints_stands_by_itself(
    profile: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The gateway's thread is frozen: nobody commands a standstill."""
    with rover(tmp_path, profile) as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission())
        station.command("start")
        begin = operator.place()
        for _ in range(200):
            if math.dist(begin, operator.place()) > 0.3:
                break
            time.sleep(STEP_S)
        frozen = operator.place()
        assert math.dist(begin, frozen) > 0.3
        for name in ("keep_course", "go_to", "turn_to", "halt"):
            monkeypatch.setattr(Setpoints, name, lambda *arguments: None)
        time.sleep(autopilot_named(profile).driving.gives_up_s + COASTS_S)
        stood = operator.place()
        time.sleep(5.0)
        assert math.dist(stood, operator.place()) < 0.02
        assert math.dist(frozen, stood) > 0.02


def test_the_documented_times_are_those_of_the_code() -> None:
    row = r"^\| gateway, (\w+) \| (\d) s after the last setpoint \(`(\w+)`\)"
    kinds = [(name, autopilot_named(name.lower()).driving) for name in ("ArduPilot", "PX4")]
    assert re.findall(row, PLUGINS.read_text(), re.MULTILINE) == [
        (name, f"{driving.gives_up_s:g}", driving.gives_up_parameter) for name, driving in kinds
    ]
