"""Missions arrive whole over lines that lose, double and overtake: `benchmarks.mavlink` in short."""

from __future__ import annotations

import pytest

from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_process import vehicle_on
from stopgo.bridge.mavlink.transfer.upload import Uploaded, upload
from stopgo.bridge.mavlink.vehicle_link.peer import reached
from stopgo.bridge.mavlink.vehicle_link.url import Url
from tests.bridge.mavlink.lists import stops
from tests.bridge.mavlink.lossy import Lossy, Roughness
from tests.ports import free_port

pytestmark = pytest.mark.usefixtures("own_time")

LOSSY = Roughness(delay_s=0.005, loss=0.1)
LOSSIER = Roughness(delay_s=0.005, loss=0.3)
ROUGH = Roughness(delay_s=0.005, loss=0.1, doubled=0.2, overtaken=0.2)


@pytest.mark.parametrize(
    ("profile", "autopilot", "rough", "count"),
    [
        ("ardupilot", "ardupilot", LOSSY, 50),
        ("ardupilot", "ardupilot", LOSSIER, 20),
        ("ardupilot", "ardupilot", ROUGH, 50),
        ("strict", "generic", LOSSY, 50),
        ("strict", "generic", LOSSIER, 20),
        ("px4", "px4", LOSSY, 10),
        ("px4", "px4", ROUGH, 10),
    ],
)
def test_a_mission_arrives_whole(profile: str, autopilot: str, rough: Roughness, count: int) -> None:
    port, sent = free_port(), stops(count, autopilot)
    with (
        vehicle_on(Url("udpin", "127.0.0.1", port), VehicleSetup(PROFILES[profile])),
        Lossy(port, rough, seed=7) as line,
        reached(line.url, vehicle=1) as peer,
    ):
        assert upload(peer, sent) == Uploaded(items=2 * count, already=False)
