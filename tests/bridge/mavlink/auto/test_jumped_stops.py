"""A stop that somebody jumps over was skipped by somebody: it is never done, wherever the jump begins."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.simulated import vehicle_scanner
from stopgo.bridge.mavlink.vehicle_link.messages import set_current
from stopgo.bridge.mavlink.vehicle_link.peer import reached as found_peer
from stopgo.mission.document import Scan
from stopgo.mission.run.events import Scanned, Skipped
from tests.bridge.mavlink.auto.site import Site, real_tour, until, watched
from tests.mission.mavlink.following.worlds import told

pytestmark = pytest.mark.usefixtures("own_time")

LONG = Scan(profile="default", duration_s=20.0, timeout_s=40.0)


@pytest.mark.parametrize("profile", ["ardupilot", "px4"])
@pytest.mark.parametrize("seen", ["Scanned S1", "Arrived S2", "Settled S2"])
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
    assert "somebody" in skip.reason and "stopgo start --again" in skip.reason


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
    files = {event.stop: event.file for event in site.events if isinstance(event, Scanned)}
    assert set(files) <= {"S1", "S3"} and not files.get("S3", "").endswith("-2.e57")
    assert site.run.skipped == ("S2",) and site.run.state == "FINISHED"


@pytest.mark.parametrize("profile", ["ardupilot", "px4"])
def test_a_jump_back_to_a_stop_that_is_done_is_held_and_the_run_goes_on_where_it_was(
    profile: str, tmp_path: Path
) -> None:
    site = Site(tmp_path, profile, speed_up=1.0)
    with site.up(), watched(site), found_peer(site.url, vehicle=1) as peer:
        site.order("start")
        until(site, lambda events, run: "Scanned S1" in told(events))
        peer.send(set_current(peer.who, site_sequence(site, "S1")))
        until(site, lambda events, run: run.state == "HELD")
        assert "operator has set the vehicle's current item back" in site.run.reason
        assert "(to S1, which is behind)" in site.run.reason
        assert site.order("retry").state == "RUNNING"
    assert site.run.done == ("S1", "S2", "S3") and not site.run.skipped
    assert told(site.events).count("Scanned S1") == 1


def site_sequence(site: Site, stop: str) -> int:
    """Number on the vehicle of the first item of the leg to a stop."""
    with site.book() as book:
        listed = book.listed
        assert listed is not None
        return listed.sequence(next(items.first for items in listed.stops if items.stop == stop))
