"""A failsafe's cause that lasts: the gateway's vehicle goes on only once it is over."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFault, VehicleFaults
from stopgo.mission.errors import NegativeResult
from stopgo.mission.run.events import Held
from tests.bridge.mavlink.driving.world import (
    events_of,
    gateway,
    is_state,
    rover,
    scanned,
    site_mission,
    until,
)
from tests.faults.sizes import some

pytestmark = pytest.mark.usefixtures("own_time")


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_retry_is_refused_while_the_fence_is_breached_and_the_state_shows_it(
    tmp_path: Path, profile: str
) -> None:
    faults = VehicleFaults((VehicleFault("failsafe", 8, 3.0),))
    with (
        rover(tmp_path, profile, faults=faults) as (vehicle, operator),
        gateway(tmp_path, vehicle.url) as station,
    ):
        station.push(site_mission())
        station.command("start")
        until(station.reports(), is_state("HELD", "FINISHED"))
        assert "geofence" in next(event for event in events_of(station) if isinstance(event, Held)).reason
        with pytest.raises(NegativeResult, match=r"not_ready: its geofence is breached.*back inside"):
            station.command("retry")
        time.sleep(3.0)
        assert (station.status().battery_ok, station.status().fence_ok) == (True, False)
        time.sleep(25.0)
        operator.hold()
        assert station.command("retry").state == "RUNNING"
        until(station.reports(), is_state("FINISHED"))
        assert station.status().fence_ok is True
        assert scanned(station) == ["s1", "s2"]
