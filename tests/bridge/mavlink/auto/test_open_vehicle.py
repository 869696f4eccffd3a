"""A vehicle whose line stays open: found late, lost, stopped while it is silent, and given missions."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest

from stopgo.bridge.mavlink.auto.open_vehicle import OpenVehicle
from stopgo.bridge.mavlink.auto.vehicle_commands import Consent
from stopgo.bridge.mavlink.auto.vehicle_station import Options
from stopgo.bridge.mavlink.vehicle_link.wire import GROUND_STATION, Wire
from stopgo.mission.document import with_digest
from stopgo.mission.errors import NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.mavlink.telemetry import Message
from tests.bridge.mavlink.auto.site import Site
from tests.waiting import wait_until

pytestmark = pytest.mark.usefixtures("own_time")


@contextmanager
def opened(site: Site) -> Iterator[OpenVehicle]:
    """The site's vehicle on an open line, served by a thread as a long-running program does."""
    options = Options(vehicle=1, state=site.folder / "station", commander="anna", consent=Consent(arm=True))
    vehicle, stopped = OpenVehicle("rover", site.url, options, set_origin=True), threading.Event()
    thread = threading.Thread(target=lambda: vehicle.serve(stopped, lambda trouble: None), daemon=True)
    thread.start()
    try:
        yield vehicle
    finally:
        stopped.set()
        thread.join()


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[Message]:
    """All that the station sends, in order."""
    found: list[Message] = []
    send = Wire.send

    def noted(wire: Wire, message: Message, **how: Any) -> None:
        if wire.me.system == GROUND_STATION.system:
            found.append(message)
        send(wire, message, **how)

    monkeypatch.setattr(Wire, "send", noted)
    return found


def holds(sent: list[Message]) -> list[Message]:
    return [one for one in sent if one.get_type() == "COMMAND_LONG" and (one.command, one.param2) == (176, 4)]


def test_a_vehicle_is_commanded_stopped_and_followed_on_one_line(tmp_path: Path) -> None:
    site = Site(tmp_path)
    heard: list[str] = []
    with site.up(), opened(site) as vehicle:
        wait_until(lambda: not vehicle.trouble)
        assert vehicle.status().state == "READY"
        assert vehicle.command("start").state == "RUNNING"
        with vehicle.hearing(lambda: heard.append(vehicle.status().state)):
            assert vehicle.command("pause").state == "PAUSED"
        assert len(heard) == 1
        with pytest.raises(NegativeResult, match="drives its list forward only"):
            vehicle.command("home")
        with pytest.raises(NegativeResult, match="a push would end it"):
            vehicle.push(site.mission)
        assert vehicle.command("resume").state == "RUNNING"
        assert vehicle.command("abort").state == "ABORTED"


def test_a_mission_is_pushed_on_the_open_line(tmp_path: Path) -> None:
    site = Site(tmp_path)
    fewer = with_digest(msgspec.structs.replace(site.mission, stops=site.mission.stops[:2], revision=2))
    with site.up(), opened(site) as vehicle:
        wait_until(lambda: not vehicle.trouble)
        assert vehicle.push(site.mission).already
        assert not vehicle.push(fewer).already
        wait_until(lambda: vehicle.status().revision == 2)
        assert vehicle.mission(fewer.id, 2) == fewer


def test_hold_goes_to_a_vehicle_that_never_answered(tmp_path: Path, sent: list[Message]) -> None:
    """By the record of the push; the outcome is unknown, and nothing is claimed."""
    site = Site(tmp_path)
    with opened(site) as vehicle:
        wait_until(lambda: sent)
        sent.clear()
        with pytest.raises(OutcomeUnknown, match="HOLD was sent to vehicle 1, and a standstill is not"):
            vehicle.command("pause")
        assert len(holds(sent)) > 10
        with pytest.raises(RobotUnreachable, match="was not sent"):
            vehicle.command("start")
        with pytest.raises(RobotUnreachable, match="nothing was sent"):
            vehicle.push(site.mission)
        with site.up():
            wait_until(lambda: not vehicle.trouble)
            assert vehicle.command("pause").state == "READY"


def test_hold_goes_to_a_vehicle_that_has_fallen_silent(tmp_path: Path, sent: list[Message]) -> None:
    site = Site(tmp_path)
    with opened(site) as vehicle:
        with site.up():
            wait_until(lambda: not vehicle.trouble)
            vehicle.command("start")
        wait_until(lambda: vehicle.keep() is None)
        sent.clear()
        with pytest.raises(OutcomeUnknown, match="a standstill is not confirmed"):
            vehicle.command("pause")
        assert len(holds(sent)) > 10
