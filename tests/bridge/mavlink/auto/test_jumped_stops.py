"""A stop that somebody jumps over was skipped by somebody: it is never done, wherever the jump begins."""

from __future__ import annotations

import math
import time
from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.mavlink.simulated import vehicle_scanner
from stopgo.bridge.mavlink.simulated.profiles import profile_named
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.messages import position_setpoint, set_current
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.peer import reached as found_peer
from stopgo.mission.document import Scan, with_digest
from stopgo.mission.errors import NegativeResult
from stopgo.mission.mavlink.telemetry import local_speed
from stopgo.mission.run.events import Scanned, Skipped
from tests.bridge.mavlink.auto.site import Site, real_tour, until, watched
from tests.faults.sizes import some
from tests.mission.mavlink.following.worlds import told

pytestmark = pytest.mark.usefixtures("own_time")

LONG = Scan(profile="default", duration_s=20.0, timeout_s=40.0)


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
@pytest.mark.parametrize("seen", some(["Scanned S1", "Arrived S2", "Settled S2"], every=2))
def test_a_stop_that_is_jumped_over_is_skipped_by_somebody(profile: str, seen: str, tmp_path: Path) -> None:
    """On the way to it, while it settles, and while it scans."""
    site = Site(tmp_path, profile, mission=real_tour(scan=LONG))
    with site.up(), watched(site), found_peer(site.url, vehicle=1) as peer:
        site.order("start")
        until(site, lambda events, run: seen in told(events))
        peer.send(set_current(peer.who, site_sequence(site, "S3")))
        until(site, lambda events, run: "Skipped S2" in told(events))
        site.order("abort")
    assert site.run.skipped == ("S2",) and site.run.done == ("S1",)
    (skip,) = [event for event in site.events if isinstance(event, Skipped)]
    assert "jumped over by somebody (not known who)" in skip.reason and "offered again" in skip.reason


def test_several_stops_that_are_jumped_over_at_once_are_all_skipped(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), watched(site), found_peer(site.url, vehicle=1) as peer:
        site.order("start")
        until(site, lambda events, run: run.stop_state == "NAVIGATING")
        peer.send(set_current(peer.who, site_sequence(site, "S3")))
        until(site, lambda events, run: run.at == 2)
        site.order("abort")
    assert site.run.skipped == ("S1", "S2") and site.run.done == ()


def test_a_scan_that_goes_on_while_the_vehicle_is_jumped_to_the_next_stop_counts_for_neither(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its scanner notices no motion, and ends where the next stop is."""
    monkeypatch.setattr(vehicle_scanner, "MOVED_M", math.inf)
    monkeypatch.setattr(vehicle_scanner, "TURNED_RAD", math.inf)
    site = Site(tmp_path, "ardupilot", mission=real_tour(scan=LONG), speed_up=1.0)
    with site.up(), watched(site), found_peer(site.url, vehicle=1) as peer:
        site.order("start")
        until(site, lambda events, run: run.at == 1 and run.stop_state == "SCANNING")
        peer.send(set_current(peer.who, site_sequence(site, "S3")))
        until(site, lambda events, run: run.offered)
        site.order("skip")
    files = {event.stop: event.file for event in site.events if isinstance(event, Scanned)}
    assert set(files) <= {"S1", "S3"} and not files.get("S3", "").endswith("-2.e57")
    assert site.run.skipped == ("S2",) and site.run.state == "FINISHED"


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
def test_a_jump_back_to_a_stop_that_is_done_is_held_and_the_run_goes_on_where_it_was(
    profile: str, tmp_path: Path
) -> None:
    site = Site(tmp_path, profile, speed_up=1.0)
    with site.up(), watched(site), found_peer(site.url, vehicle=1) as peer:
        site.order("start")
        until(site, lambda events, run: "Scanned S1" in told(events))
        peer.send(set_current(peer.who, site_sequence(site, "S1")))
        until(site, lambda events, run: run.state == "HELD")
        assert "somebody (not known who) has set the vehicle's current item back" in site.run.reason
        assert "(to S1, which is behind)" in site.run.reason
        assert site.order("retry").state == "RUNNING"
    assert site.run.done == ("S1", "S2", "S3") and not site.run.skipped
    assert told(site.events).count("Scanned S1") == 1


def offered(site: Site) -> str:
    """Wait until the run offers a stop that was jumped over; return its reason."""
    until(site, lambda events, run: run.offered)
    assert site.run.state == "HELD"
    return site.run.reason


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_jumped_stops_are_offered_at_the_end_and_one_command_drives_to_them(
    profile: str, tmp_path: Path
) -> None:
    """On the planned route, past the stops that are done."""
    back = ((1.0, 1.0), (0.0, 1.0), (0.0, 0.0))
    site = Site(tmp_path, profile, mission=with_digest(msgspec.structs.replace(real_tour(), return_=back)))
    with site.up(), watched(site), found_peer(site.url, vehicle=1) as peer:
        site.order("start")
        until(site, lambda events, run: "Scanned S1" in told(events))
        peer.send(set_current(peer.who, site_sequence(site, "S3")))
        reason = offered(site)
        assert f"S2 was jumped over, and is not scanned: stopgo retry --mavlink {site.url}" in reason
        assert "--state" in reason
        site.order("retry")
    events = site.events
    assert site.run.done == ("S1", "S3", "S2") and not site.run.skipped and site.run.state == "FINISHED"
    names = [event.stop for event in events if isinstance(event, Scanned)]
    assert names == ["S1", "S3", "S2"]


def test_a_stop_that_was_jumped_over_may_be_left_out(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), watched(site), found_peer(site.url, vehicle=1) as peer:
        site.order("start")
        until(site, lambda events, run: "Scanned S1" in told(events))
        peer.send(set_current(peer.who, site_sequence(site, "S3")))
        assert "drive it by hand to (1.00, 0.00), where the leg to S2 begins" in offered(site)
        site.order("skip")
    assert site.run.skipped == ("S2",) and site.run.done == ("S1", "S3") and site.run.state == "FINISHED"


def test_a_vehicle_that_is_set_back_on_its_return_home_is_held_and_goes_on_home(tmp_path: Path) -> None:
    back = ((1.0, 1.0), (0.0, 1.0), (0.0, 0.0))
    mission = with_digest(msgspec.structs.replace(real_tour(), return_=back))
    site = Site(tmp_path, "ardupilot", mission=mission, speed_up=1.0)
    with site.up(), watched(site), found_peer(site.url, vehicle=1) as peer:
        site.order("start")
        until(site, lambda events, run: run.state == "HOMING")
        time.sleep(2.0)
        peer.send(set_current(peer.who, site_sequence(site, "S2")))
        until(site, lambda events, run: run.state == "HELD")
        assert "(to S2, which is behind); retry drives on to the end" in site.run.reason
        assert site.order("retry").state == "HOMING"
    assert site.run.state == "FINISHED" and site.run.done == ("S1", "S2", "S3")


def driven_by_hand(peer: Peer, place: tuple[float, float], site: Site) -> None:
    """Drive the vehicle to a place, and put it on hold; in the guided mode, as its operator's hand."""
    modes = profile_named(site.profile).modes
    peer.order(dialect.MAV_CMD_DO_SET_MODE, *modes.guided.params)
    for _ in range(100):
        peer.send(position_setpoint(peer.who, place[::-1], down=0.0, now_ms=0))
        time.sleep(0.5)
        here = peer.ask(dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
        assert here is not None
        if math.dist((here.y, here.x), place) < 0.2 and local_speed(here) < 0.03:
            break
    peer.order(dialect.MAV_CMD_DO_SET_MODE, *modes.hold.params)


def test_a_vehicle_that_did_not_return_is_driven_by_hand_to_the_leg_of_the_stop_that_was_jumped_over(
    tmp_path: Path,
) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), watched(site), found_peer(site.url, vehicle=1) as peer:
        site.order("start")
        until(site, lambda events, run: "Arrived S1" in told(events))
        peer.send(set_current(peer.who, site_sequence(site, "S2")))
        offered(site)
        with pytest.raises(NegativeResult, match=r"off_route.*drive it by hand to"):
            site.order("retry")
        driven_by_hand(peer, (0.5, 0.0), site)
        site.order("retry")
    assert site.run.done == ("S2", "S3", "S1") and site.run.state == "FINISHED"


def site_sequence(site: Site, stop: str) -> int:
    """Number on the vehicle of the first item of the leg to a stop."""
    with site.book() as book:
        listed = book.listed
        assert listed is not None
        return listed.sequence(next(items.first for items in listed.stops if items.stop == stop))
