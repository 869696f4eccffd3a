"""A list changed by another station stops the vehicle, and is reported with its items."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.auto.list_guard import uploader_of
from stopgo.bridge.mavlink.transfer.upload import upload
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, found
from stopgo.bridge.mavlink.vehicle_link.wire import Who, Wire, wire
from stopgo.mission.document import Mission, Scan
from stopgo.mission.mavlink.items import ItemList
from stopgo.mission.mavlink.telemetry import Message, local_speed, mission_id_of
from stopgo.mission.mavlink.translate import translate
from tests.bridge.mavlink.auto.site import KINDS, PATIENCE_S, Site, real_tour, until
from tests.faults.sizes import some
from tests.mission.mavlink.following.worlds import told

pytestmark = pytest.mark.usefixtures("own_time")

PROFILES = ["ardupilot", "px4"]
OTHER = Who(255, 190)
AUTO = {"ardupilot": (10, 0), "px4": (4, 4)}
LONG = Scan(profile="default", duration_s=20.0, timeout_s=40.0)


@contextmanager
def other_station(site: Site) -> Iterator[Peer]:
    with wire(site.url, me=OTHER) as opened, found(opened, 1) as peer:
        yield peer


def hastier(site: Site, mission: Mission | None = None) -> ItemList:
    """A list of as many items, whose scans are cut short."""
    brief = Scan(profile="default", duration_s=0.2, timeout_s=20.0)
    other = translate(mission or real_tour(scan=brief), KINDS[site.profile])
    assert len(other.placed) == len(site.sent.placed)
    return other


def is_held(events: object, run: object) -> bool:
    return getattr(run, "state", "") == "HELD"


def stands(peer: Peer) -> bool:
    message = peer.ask(dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
    return not peer.in_auto and local_speed(message) < 0.03


def comes_to_a_stand(peer: Peer) -> bool:
    """True once the vehicle stands; asked seldom, because each question keeps the vehicle busy."""
    deadline = time.monotonic() + PATIENCE_S
    while not (there := stands(peer)) and time.monotonic() < deadline:
        time.sleep(0.02)
    return there


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
def test_a_list_of_the_same_length_that_is_exchanged_in_mid_run_stops_the_vehicle(
    profile: str, tmp_path: Path
) -> None:
    site = Site(tmp_path, profile)
    with site.up(), site.reached() as station, other_station(site) as peer:
        station.command("start")
        until(site, lambda events, run: "Scanned S1" in told(events))
        upload(peer, hastier(site), while_running=True)
        until(site, is_held)
        assert comes_to_a_stand(peer)
        assert "wait of S" in site.run.reason or "scan of S" in site.run.reason
        assert "has changed the vehicle's mission" in site.run.reason
    assert told(site.events).count("Scanned S2") == 0


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_a_scan_does_not_count_before_its_items_are_known_to_be_ours(profile: str, tmp_path: Path) -> None:
    site = Site(tmp_path, profile, mission=real_tour(scan=LONG))
    with site.up(), site.reached() as station, other_station(site) as peer:
        station.command("start")
        until(site, lambda events, run: "Settled S1" in told(events))
        upload(peer, hastier(site), while_running=True)
        until(site, is_held)
    assert "Scanned S1" not in told(site.events) and site.run.done == ()


def test_the_station_that_uploads_is_named_if_its_messages_arrive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a link that all share, as a radio."""
    monkeypatch.setattr(Wire, "_route", lambda self, system, component: None)
    site = Site(tmp_path, "ardupilot")
    with site.up(), site.reached() as station, other_station(site) as peer:
        station.command("start")
        until(site, lambda events, run: "Arrived S1" in told(events))
        upload(peer, hastier(site), while_running=True)
        until(site, is_held)
        station.command("abort")
    assert any(
        "system 255, component 190 has changed" in getattr(event, "reason", "") for event in site.events
    )


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
def test_a_changed_list_never_resumes_the_run_and_the_vehicle_is_stopped_each_time(
    profile: str, tmp_path: Path
) -> None:
    site = Site(tmp_path, profile)
    with site.up(), site.reached() as station, other_station(site) as peer:
        station.command("start")
        until(site, lambda events, run: "Arrived S1" in told(events))
        station.command("pause")
        upload(peer, hastier(site), while_running=True)
        until(site, is_held)  # without any change of mode
        for _ in range(3):  # some before the station has heard that the vehicle holds
            assert peer.command(dialect.MAV_CMD_DO_SET_MODE, 1, *AUTO[profile]).accepted
            assert comes_to_a_stand(peer)
            assert site.run.state == "HELD"
    assert told(site.events).count("Held") == 1 and "Resumed" not in told(site.events)


def test_a_list_that_is_mended_lets_the_run_go_on(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), site.reached() as station, other_station(site) as peer:
        station.command("start")
        until(site, lambda events, run: "Scanned S1" in told(events))
        upload(peer, hastier(site), while_running=True)
        until(site, is_held)
        upload(peer, site.sent, while_running=True)
        assert station.command("retry").state == "RUNNING"
        until(site, lambda events, run: run.over)
    assert site.run.state == "FINISHED" and site.run.done == ("S1", "S2", "S3")


def test_an_upload_is_recognised_from_either_side() -> None:
    vehicle, me = Who(1, 1), Who(254, 30)

    def by(message: Message, who: Who) -> Who | None:
        coder = dialect.MAVLink(None, who.system, who.component)
        (parsed,) = dialect.MAVLink(None).parse_buffer(bytearray(message.pack(coder)))
        return uploader_of(parsed, vehicle, me)

    count, fence = (dialect.MAVLink_mission_count_message(1, 1, 5, kind) for kind in (0, 1))
    request = dialect.MAVLink_mission_request_int_message
    assert by(count, OTHER) == OTHER and by(fence, OTHER) is None and by(count, me) is None
    assert by(request(255, 190, 0, 0), vehicle) == OTHER
    assert by(request(254, 30, 0, 0), vehicle) is None  # our own upload
    assert by(request(1, 1, 0, 0), OTHER) is None  # another station reads the list
    assert by(dialect.MAVLink_mission_count_message(255, 190, 5, 0), vehicle) is None


def test_a_mission_id_is_read_where_the_autopilot_has_one(tmp_path: Path) -> None:
    ids: dict[str, int] = {}
    for profile in PROFILES:
        site = Site(tmp_path / profile, profile)
        with site.up(), other_station(site) as peer:
            ids[profile] = mission_id_of(peer.ask(dialect.MAVLINK_MSG_ID_MISSION_CURRENT))
    assert ids["ardupilot"] == 0 and ids["px4"] != 0
