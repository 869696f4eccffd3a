"""MAVSDK, a ground station that is not ours, uploads to the simulated vehicle, reads back and follows."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_faults import read_vehicle_faults
from stopgo.bridge.mavlink.simulated.vehicle_process import vehicle_on
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import wire
from stopgo.mission.mavlink.items import Item
from tests.bridge.mavlink.simulated.bench import HOME, ORIGIN, camera, delay, script, waypoint
from tests.ports import free_port

mavsdk = pytest.importorskip("mavsdk")

PATIENCE_S = 120.0
SPEED_UP = 50.0


@contextmanager
def station(port: int, *, way: str = "udpin") -> Iterator[Any]:
    """MAVSDK as a ground station that listens on a port (or sends to it), once it sees the vehicle there."""
    kind = mavsdk.ComponentType.GROUND_STATION
    sdk = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
    try:
        sdk.add_any_connection(f"{way}://127.0.0.1:{port}")
        system = sdk.first_autopilot(PATIENCE_S)
        assert system is not None, "MAVSDK sees no autopilot"
        yield system
    finally:
        sdk.destroy()


@contextmanager
def vehicle(profile: str, *faults: str) -> Iterator[int]:
    """A vehicle that sends to the port it gives."""
    port = free_port()
    made = read_vehicle_faults(faults)
    setup = VehicleSetup(PROFILES[profile], origin=ORIGIN, faults=made)
    with vehicle_on(Url("udpout", "127.0.0.1", port), setup, speed_up=SPEED_UP):
        yield port


def tour(profile: str) -> list[Item]:
    home = [HOME] if profile == "ardupilot" else []
    trigger = script(1, 5.0) if profile == "ardupilot" else camera(1)
    return [*home, waypoint(2.0, 0.0), delay(1.0), trigger, delay(5.0), waypoint(2.0, 3.0)]


def raw(items: list[Item]) -> list[Any]:
    from mavsdk.plugins.mission_raw.mission_raw import MissionItem

    return [
        MissionItem(
            number, item.frame, item.command, int(number == 0), 1, *item.params, item.x, item.y, item.z, 0
        )
        for number, item in enumerate(items)
    ]


def item_of(read: Any) -> Item:
    params = (read.param1, read.param2, read.param3, read.param4)
    return Item(
        read.command, read.frame, params, read.x, read.y, read.z, autocontinue=bool(read.autocontinue)
    )


@pytest.mark.parametrize("profile", list(PROFILES))
def test_mavsdk_uploads_reads_back_starts_and_follows_to_the_end(profile: str) -> None:
    from mavsdk.plugins.action.action import Action
    from mavsdk.plugins.mission_raw.mission_raw import MissionRaw

    items = tour(profile)
    first = 1 if profile == "ardupilot" else 0
    with vehicle(profile) as port, station(port) as system:
        missions, action = MissionRaw(system), Action(system)
        missions.upload_mission(raw(items))
        read = [item_of(item) for item in missions.download_mission()]
        kept = PROFILES[profile].kept
        assert read[first:] == [kept(item) for item in items[first:]]

        ended, seen = threading.Event(), []

        def progressed(progress: Any, *_: object) -> None:
            seen.append((progress.current, progress.total))
            if progress.current == progress.total:
                ended.set()

        missions.subscribe_mission_progress(progressed)
        action.arm()
        missions.start_mission()
        assert ended.wait(PATIENCE_S), seen
        assert seen[-1] == (len(items), len(items))
        assert [current for current, _ in seen] == sorted(current for current, _ in seen)


@pytest.mark.parametrize("profile", list(PROFILES))
def test_mavsdk_pauses_sets_the_item_and_clears(profile: str) -> None:
    from mavsdk.plugins.action.action import Action
    from mavsdk.plugins.mission_raw.mission_raw import MissionRaw

    home = 1 if profile == "ardupilot" else 0
    with vehicle(profile) as port, station(port) as system:
        missions, action = MissionRaw(system), Action(system)
        missions.upload_mission(raw([*[HOME] * home, delay(1e6), delay(1e6), delay(1e6)]))
        action.arm()
        missions.start_mission()
        missions.set_current_mission_item(2 + home)
        missions.pause_mission()
        assert missions.mission_progress().current == 2 + home
        missions.clear_mission()
        assert len(missions.download_mission()) == home  # MAVSDK leaves home on ArduPilot


def test_mavsdk_sends_and_reads_fence_and_rally_points() -> None:
    from mavsdk.plugins.mission_raw.mission_raw import MissionItem, MissionRaw

    place = (474_000_000, 85_000_000, 0.0)
    corners = [MissionItem(n, 5, 5001, 0, 1, 3.0, 0.0, 0.0, 0.0, *place, 1) for n in range(3)]
    rally = [MissionItem(0, 6, 5100, 1, 1, 0.0, 0.0, 0.0, 0.0, *place, 2)]
    with vehicle("strict") as port, station(port) as system:
        missions = MissionRaw(system)
        assert missions.download_geofence() == []
        missions.upload_geofence(corners)
        missions.upload_rally_points(rally)
        assert [len(missions.download_geofence()), len(missions.download_rallypoints())] == [3, 1]
        assert missions.download_mission() == []


@pytest.mark.parametrize("profile", ["strict", "px4"])
def test_mavsdk_is_informed_what_is_wrong_with_an_item(profile: str) -> None:
    from mavsdk.plugins.mission_raw.mission_raw import MissionRaw, MissionRawError, MissionRawResult

    with vehicle(profile) as port, station(port) as system:
        missions = MissionRaw(system)
        missions.upload_mission(raw(tour(profile)))
        with pytest.raises(MissionRawError) as refused:
            missions.upload_mission(raw([delay(1.0), Item(31_010, 2)]))
        assert refused.value.result == MissionRawResult.UNSUPPORTED
        assert len(missions.download_mission()) == len(tour(profile))


def test_mavsdk_and_another_station_use_one_vehicle() -> None:
    """While the other one uploads, MAVSDK is denied; afterwards it reads what the other one sent."""
    from mavsdk.plugins.mission_raw.mission_raw import MissionRaw, MissionRawError

    port = free_port()
    with (
        vehicle_on(Url("udpin", "127.0.0.1", port), VehicleSetup(PROFILES["strict"])),
        wire(Url("udpout", "127.0.0.1", port)) as other,
        station(port, way="udpout") as system,
        other.waiting("MISSION_REQUEST_INT", "MISSION_ACK") as waiting,
    ):
        missions = MissionRaw(system)
        other.send(dialect.MAVLink_mission_count_message(1, 1, 1, 0))
        assert waiting.get(PATIENCE_S).get_type() == "MISSION_REQUEST_INT"
        with pytest.raises(MissionRawError):
            missions.upload_mission(raw([delay(1.0)] * 3))
        item = delay(7.0)
        other.send(dialect.MAVLink_mission_count_message(1, 1, 1, 0))
        other.send(
            dialect.MAVLink_mission_item_int_message(
                1, 1, 0, 2, item.command, 0, 1, *item.params, 0, 0, 0.0, 0
            )
        )
        while (got := waiting.get(PATIENCE_S)).get_type() != "MISSION_ACK":
            pass
        assert got.type == dialect.MAV_MISSION_ACCEPTED
        assert [read.param1 for read in missions.download_mission()] == [7.0]
