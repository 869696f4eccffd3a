"""Whoever changes mode, item or arming of a vehicle in AUTO is named as far as the line shows it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.simulated.profiles import profile_named
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.messages import set_current
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.wire import Wire
from stopgo.mission.run.events import Held, Paused, Resumed, Skipped
from tests.bridge.mavlink.auto.site import Site, until, watched
from tests.bridge.mavlink.auto.test_guarded_list import other_station
from tests.bridge.mavlink.auto.test_jumped_stops import site_sequence
from tests.bridge.mavlink.shared_line import all_hear_all
from tests.faults.sizes import some
from tests.mission.mavlink.following.worlds import told

pytestmark = pytest.mark.usefixtures("own_time")

STATION = "system 255, component 190"
UNKNOWN = "somebody (not known who)"


@pytest.fixture
def shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line on which all hear all, as a radio."""
    all_hear_all(monkeypatch)


@pytest.fixture
def answers_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """A router that gives all that the vehicle sends to all, but a station's commands to the vehicle only."""
    route = Wire._route

    def from_vehicle(wire: Wire, system: int, component: int) -> object:
        return None if wire.me.system == 1 else route(wire, system, component)

    monkeypatch.setattr(Wire, "_route", from_vehicle)


def manual(peer: Peer, site: Site) -> None:
    peer.command(dialect.MAV_CMD_DO_SET_MODE, *profile_named(site.profile).modes.numbers["manual"].params)


def manual_by_message(peer: Peer, site: Site) -> None:
    """SET_MODE, the older way."""
    modes = profile_named(site.profile).modes
    flags = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    peer.send(dialect.MAVLink_set_mode_message(1, flags, modes.custom(modes.numbers["manual"])))


def disarmed(peer: Peer, site: Site) -> None:
    peer.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)


def jumped_over(peer: Peer, site: Site) -> None:
    peer.send(set_current(peer.who, site_sequence(site, "S3")))


def set_back(peer: Peer, site: Site) -> None:
    peer.send(set_current(peer.who, site_sequence(site, "S1")))


Does = Callable[[Peer, Site], None]
TELLING = Paused | Held | Skipped


def reason_after(site: Site, does: Does) -> str:
    """The reason that is reported after somebody has done that to the running vehicle."""
    with site.up(), watched(site), other_station(site) as peer:
        site.order("start")
        until(site, lambda events, run: "Scanned S1" in told(events))
        does(peer, site)
        until(site, lambda events, run: any(isinstance(event, TELLING) for event in events))
        reason = next(event.reason for event in site.events if isinstance(event, TELLING))
        site.order("abort")
    return reason


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
@pytest.mark.parametrize("does", some([manual, manual_by_message, disarmed, jumped_over, set_back], every=2))
def test_a_station_whose_messages_arrive_is_named_for_whatever_it_changes(
    tmp_path: Path, shared: None, profile: str, does: Does
) -> None:
    reason = reason_after(Site(tmp_path, profile, speed_up=1.0), does)
    assert STATION in reason and UNKNOWN not in reason


@pytest.mark.parametrize("does", [manual, disarmed])
def test_a_station_is_named_by_the_vehicles_answers_alone(
    tmp_path: Path, answers_shared: None, does: Does
) -> None:
    assert STATION in reason_after(Site(tmp_path, "ardupilot", speed_up=1.0), does)


@pytest.mark.parametrize("does", some([manual, disarmed, jumped_over], every=2))
def test_a_station_on_another_line_is_not_known(tmp_path: Path, does: Does) -> None:
    assert UNKNOWN in reason_after(Site(tmp_path, "ardupilot", speed_up=1.0), does)


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
def test_a_remote_control_is_named_by_its_channels(tmp_path: Path, profile: str) -> None:
    site = Site(tmp_path, profile, faults=["switch@15=0"], speed_up=1.0)
    with site.up(), watched(site):
        site.order("start")
        until(site, lambda events, run: run.state == "PAUSED")
        reason = site.run.reason
        site.order("abort")
    assert "mode MANUAL, by the remote control (its channel 8: 1500 → 1100 µs)" in reason.replace(
        "Manual", "MANUAL"
    )


def test_a_station_that_overrides_the_remote_control_is_named_and_no_remote_control(
    tmp_path: Path, shared: None
) -> None:
    site = Site(tmp_path, "ardupilot", faults=["switch@9000=0"], speed_up=1.0)

    def overrides(peer: Peer, _: Site) -> None:
        peer.send(dialect.MAVLink_rc_channels_override_message(1, 1, *[65_535] * 7, 1100))

    assert STATION in reason_after(site, overrides)


def test_a_station_that_commanded_something_else_is_not_blamed(tmp_path: Path, shared: None) -> None:
    """It is heard to command HOLD, and the vehicle goes to MANUAL by its remote control."""
    site = Site(tmp_path, "ardupilot", faults=["switch@15=0"], speed_up=1.0)
    with site.up(), watched(site), other_station(site) as peer:
        site.order("start")
        until(site, lambda events, run: run.stop_state == "NAVIGATING")
        peer.command(dialect.MAV_CMD_DO_SET_MODE, *profile_named("ardupilot").modes.auto.params)
        until(site, lambda events, run: run.state == "PAUSED")
        reason = site.run.reason
        site.order("abort")
    assert "the remote control" in reason and STATION not in reason


def test_a_run_that_a_station_lets_go_on_is_resumed_by_it(tmp_path: Path, shared: None) -> None:
    site = Site(tmp_path, "ardupilot", speed_up=1.0)
    with site.up(), watched(site), other_station(site) as peer:
        site.order("start")
        until(site, lambda events, run: "Arrived S1" in told(events))
        site.order("pause")
        peer.command(dialect.MAV_CMD_DO_SET_MODE, *profile_named("ardupilot").modes.auto.params)
        until(site, lambda events, run: run.state == "RUNNING")
        site.order("abort")
    (resumed,) = [event for event in site.events if isinstance(event, Resumed)]
    assert resumed.commander == STATION
