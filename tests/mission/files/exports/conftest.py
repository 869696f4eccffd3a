"""Missions to export, and MAVSDK as somebody else's reader of their files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.mission_raw import MissionRaw
from pymavlink.dialects.v20 import common as mavlink

from stopgo.mission.document import Mission
from tests.mission.files.exports.worlds import MISSIONS


@pytest.fixture(params=MISSIONS)
def mission(request: pytest.FixtureRequest) -> Mission:
    """Each of the small worlds."""
    return MISSIONS[request.param]()


@pytest.fixture(scope="session")
def mavsdk() -> Iterator[MissionRaw]:
    """MAVSDK's raw missions, of a vehicle it knows by one heartbeat; nothing goes over any network."""
    writer = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    heartbeat = writer.heartbeat_encode(10, 3, 0, 0, 4, 3).pack(writer)
    kind = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    with Mavsdk(kind) as station:
        station.add_any_connection("raw://")
        station.pass_received_raw_bytes(heartbeat)
        vehicle = station.first_autopilot(30.0)
        assert vehicle is not None
        yield MissionRaw(vehicle)


@pytest.fixture
def file(tmp_path: Path) -> Callable[[bytes, str], str]:
    """Writes bytes to a file of a name and gives its path."""

    def written(data: bytes, name: str) -> str:
        (tmp_path / name).write_bytes(data)
        return str(tmp_path / name)

    return written
