"""A run of a real ArduPilot Rover, from its own log: what it calls reached, and where it stood."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.mavlink.auto import list_guard
from stopgo.bridge.mavlink.auto.auto_follower import AutoFollower
from stopgo.bridge.mavlink.auto.logbook import Logbook, remember
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.robot.journal_file import memory_journal
from stopgo.mission.document import Mission
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots.ardupilot import ARDUPILOT
from stopgo.mission.mavlink.following.observer import Observer
from stopgo.mission.mavlink.items import Command, Item, ItemList
from stopgo.mission.mavlink.read_back import home_item
from stopgo.mission.mavlink.recognise import recognise
from stopgo.mission.run.events import AnyEvent, Arrived, Failed
from stopgo.mission.run.states import started
from tests.mission.mavlink.following.worlds import told
from tests.mission.mavlink.rover_log import OF_ROVER_LOG, logged
from tests.mission.worlds import mission_of, stop

pytestmark = OF_ROVER_LOG
ORIGIN = SiteOrigin(lat=47.3977, lon=8.5456, alt=488.0, heading_deg=0.0)
CORNERS = ((3.0, 0.0), (3.0, 3.0), (6.0, 3.0), (6.0, 0.0), (9.0, 0.0))
COMPARED_EVERY_US = 200_000
NAV = (Command.NAV_WAYPOINT, Command.NAV_DELAY)


class NoHands:
    """A log takes no commands."""

    def ask_for_picture(self) -> None: ...

    def ask_for_telemetry(self) -> None: ...

    def send_hold(self) -> None: ...


@pytest.fixture(scope="module")
def log() -> list[Any]:
    return logged("CMD", "MISE", "XKF1", "MSG")


def mission(tolerance_m: float) -> Mission:
    """The tour that was driven, its stops as the triggers number them."""
    places = ((0.0, 0.0), *CORNERS)
    stops = (stop(f"S{i}", places[i], places[i + 1]) for i in range(5))
    plain = mission_of(*(msgspec.structs.replace(s, tolerance_m=tolerance_m, retries=0) for s in stops))
    return msgspec.structs.replace(plain, georeference=ORIGIN)


def items_of(log: list[Any]) -> list[Item]:
    items: dict[int, Item] = {}
    for entry in log:
        if entry.get_type() == "CMD" and entry.CNum > 0:
            params = (entry.Prm1, entry.Prm2, entry.Prm3, entry.Prm4)
            lat, lon = (round(angle * 1e7) for angle in (entry.Lat, entry.Lng))
            items[entry.CNum] = Item(entry.CId, entry.Frame, params, x=lat, y=lon, z=entry.Alt)
    return [items[number] for number in sorted(items)]


def as_messages(entry: Any) -> Iterator[Any]:
    """Reports of the Rover to stations at that moment."""
    ms = entry.TimeUS // 1000
    if entry.get_type() == "MISE" and entry.CId in NAV:
        yield dialect.MAVLink_mission_current_message(entry.CNum, 15, dialect.MISSION_STATE_ACTIVE, 1)
    if entry.get_type() == "MSG" and entry.Message == "Mission Complete":
        yield dialect.MAVLink_mission_current_message(15, 15, dialect.MISSION_STATE_COMPLETE, 1)
    if entry.get_type() == "XKF1" and entry.C == 0:
        yield dialect.MAVLink_attitude_message(ms, 0, 0, math.radians(entry.Yaw), 0, 0, 0)
        yield dialect.MAVLink_local_position_ned_message(ms, entry.PN, entry.PE, 0, entry.VN, entry.VE, 0)


def followed(log: list[Any], tour: Mission) -> tuple[AnyEvent, ...]:
    """The events of the run, as a station would have reported them."""
    clock = SimulatedClock()
    book = Logbook(memory_journal(), "mavlink-1", clock)
    placed = recognise(items_of(log), mission=tour)
    remember(book, tour, ItemList("ardupilot", ORIGIN, placed))
    book.move(lambda run: (started(run, run_id="r", now_ns=clock.now_ns(), by="log"),))
    observer = Observer(ARDUPILOT)
    follower = AutoFollower(book, None, observer, NoHands())  # type: ignore[arg-type]
    follower.looking = True
    armed_in_auto = dialect.MAVLink_heartbeat_message(10, 3, 128 | 1, 10, 4, 3)
    origin = dialect.MAVLink_gps_global_origin_message(473_977_000, 85_456_000, 488_000)
    for message in (armed_in_auto, origin):
        observer.take(message, book.listed, clock.now_ns())
    began_us = log[0].TimeUS
    read_back = (home_item(ORIGIN), *items_of(log))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(list_guard, "download", lambda peer: read_back)
        compared_us = began_us - COMPARED_EVERY_US
        for entry in log:
            clock.wait((entry.TimeUS - began_us) / 1e6 - (clock.now_ns() - SimulatedClock().now_ns()) / 1e9)
            if entry.TimeUS - compared_us >= COMPARED_EVERY_US:
                follower.compare()
                compared_us = entry.TimeUS
            for message in as_messages(entry):
                follower.look(observer.take(message, book.listed, clock.now_ns()))
        clock.wait(3.0)  # it is waited for a word of the last scan
        follower.compare()
        follower.look("HEARTBEAT")
    return book.journal.events()


def stood(log: list[Any]) -> list[float]:
    """Metres from each corner when the next item began, straight from the log."""
    away, place = [], (0.0, 0.0)
    for entry in log:
        if entry.get_type() == "XKF1" and entry.C == 0:
            place = (entry.PE, entry.PN)
        if entry.get_type() == "MISE" and entry.CId == Command.DO_SEND_SCRIPT_MESSAGE:
            away.append(math.dist(place, CORNERS[len(away)]))
    return away


def test_what_the_rover_calls_reached_is_measured(log: list[Any]) -> None:
    events = followed(log, mission(tolerance_m=0.5))
    words = [f"{word} S{i}" for i in range(5) for word in ("Arrived", "Settled", "Unconfirmed")]
    assert told(events) == ["Started", *words, "Finished"]
    measured = [event.deviation_m for event in events if isinstance(event, Arrived)]
    assert measured == pytest.approx(stood(log), abs=0.005)
    assert max(measured) > 0.05


def test_five_centimetres_are_not_kept_by_it(log: list[Any]) -> None:
    events = followed(log, mission(tolerance_m=0.05))
    failed = [event for event in events if isinstance(event, Failed)]
    first = next(i for i, away in enumerate(stood(log)) if away > 0.05)
    assert failed[0].stop == f"S{first}" and failed[0].reason.startswith(f"{1000 * stood(log)[first]:.0f}"[0])
