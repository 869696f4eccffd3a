"""HOLD is the first frame of `pause` and `abort`, in every state, and again until the vehicle stands."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import CompletedProcess
from types import SimpleNamespace
from typing import Any, cast

import pytest

from stopgo.bridge.mavlink.auto import first_hold
from stopgo.bridge.mavlink.auto.first_hold import FirstHold
from stopgo.bridge.mavlink.auto.logbook import Logbook, Ordered
from stopgo.bridge.mavlink.simulated.vehicle_store import Store
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.messages import position_setpoint
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.peer import reached as found_peer
from stopgo.bridge.mavlink.vehicle_link.wire import GROUND_STATION, Who, Wire
from stopgo.mission.mavlink.autopilots.kind import Mode
from stopgo.mission.mavlink.telemetry import Message, local_speed
from stopgo.mission.run.events import Paused
from tests.bridge.mavlink.auto.site import Site, until, watched
from tests.bridge.mavlink.scripted import Scripted
from tests.called import stopgo
from tests.faults.sizes import some
from tests.mission.mavlink.following.worlds import told
from tests.waiting import wait_until

pytestmark = pytest.mark.usefixtures("own_time")

GUIDED, HOLD = (15, 0), (4, 0)


def ordered(site: Site, verb: str, *options: str) -> CompletedProcess[str]:
    """The command as an operator types it."""
    return stopgo(verb, "--mavlink", str(site.url), "--vehicle", "1", "--state", str(site.folder / "station"),
                  *options)  # fmt: skip


@pytest.fixture
def frames(monkeypatch: pytest.MonkeyPatch) -> list[Message]:
    """All that a station sends, in order."""
    sent: list[Message] = []
    send = Wire.send

    def noted(wire: Wire, message: Message, **how: Any) -> None:
        if wire.me.system == GROUND_STATION.system:
            sent.append(message)
        send(wire, message, **how)

    monkeypatch.setattr(Wire, "send", noted)
    return sent


def is_hold(message: Message) -> bool:
    is_mode = message.get_type() == "COMMAND_LONG" and message.command == dialect.MAV_CMD_DO_SET_MODE
    return is_mode and (message.param2, message.param3) in ((4, 0), (4, 3))


@contextmanager
def driven_by_another(site: Site) -> Iterator[Peer]:
    """Another station drives the vehicle north by a set point, in GUIDED."""
    with found_peer(site.url, vehicle=1) as peer:
        assert peer.command(dialect.MAV_CMD_DO_SET_MODE, 1, *GUIDED).accepted
        peer.send(position_setpoint(Who(1, 1), (40.0, 0.0), down=0.0, now_ms=0))
        with peer.waiting("LOCAL_POSITION_NED") as waiting:
            while local_speed(waiting.get(30.0)) < 0.2:
                pass
        yield peer


def speed_of(peer: Peer) -> float:
    message = peer.ask(dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
    return local_speed(message)


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
@pytest.mark.parametrize("verb", ["pause", "abort"])
def test_hold_is_the_first_frame_on_the_line(
    verb: str, profile: str, tmp_path: Path, frames: list[Message]
) -> None:
    site = Site(tmp_path, profile)
    with site.up():
        site.order("start")
        frames.clear()
        said = ordered(site, verb)
        assert said.returncode == 0, said.stderr
        before = next(number for number, frame in enumerate(frames) if is_hold(frame))
        assert before == 0
        assert "stationary" in said.stderr
    assert site.run.state == ("PAUSED" if verb == "pause" else "ABORTED")


def test_a_stop_needs_no_record_of_the_vehicle(tmp_path: Path, frames: list[Message]) -> None:
    """Its heartbeat shows the number of its mode: nothing but a request for that is sent before."""
    site = Site(tmp_path)
    with site.up():
        site.order("start")
        frames.clear()
        said = stopgo("pause", "--mavlink", str(site.url), "--state", str(tmp_path / "other"))
        assert said.returncode == 0, said.stderr
        first = next(number for number, frame in enumerate(frames) if is_hold(frame))
        commands = {frame.command for frame in frames[:first] if frame.get_type() == "COMMAND_LONG"}
        assert commands == {dialect.MAV_CMD_REQUEST_MESSAGE}
        with found_peer(site.url, vehicle=1) as peer:
            assert not peer.in_auto and speed_of(peer) < 0.03


@pytest.mark.parametrize("verb", ["pause", "abort"])
def test_a_paused_vehicle_that_another_hand_drives_is_stopped_again(verb: str, tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up():
        site.order("start")
        site.order("pause")
        with driven_by_another(site) as peer:
            assert site.run.state == "PAUSED"
            said = ordered(site, verb, "--json")
            assert said.returncode == 0, said.stderr
            assert speed_of(peer) < 0.03
            assert peer.heartbeat.custom_mode == HOLD[0]
        assert site.run.state == ("PAUSED" if verb == "pause" else "ABORTED")


@pytest.mark.parametrize("verb", ["pause", "abort"])
def test_a_stop_is_refused_in_no_state(verb: str, tmp_path: Path) -> None:
    """Ready, over, and without a mission: the vehicle is driven by another hand each time."""
    site = Site(tmp_path, "ardupilot")
    with site.up():
        with found_peer(site.url, vehicle=1) as peer:
            assert peer.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1).accepted
        with driven_by_another(site):
            assert ordered(site, verb).returncode == 0
        assert site.run.state == "READY"
        site.order("start", from_here=True)
        site.order("abort")
        with driven_by_another(site):
            assert ordered(site, verb).returncode == 0
        assert site.run.state == "ABORTED"
        Store(tmp_path / "vehicle").update(mission=())
        with driven_by_another(site) as peer:
            assert ordered(site, verb).returncode == 0
            assert speed_of(peer) < 0.03


def test_a_damaged_logbook_does_not_delay_a_stop(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up():
        site.order("start")
        (tmp_path / "station" / "journal.sqlite").write_bytes(b"not a journal")
        said = ordered(site, "pause")
        assert said.returncode == 3 and "journal.sqlite" in said.stderr and "HOLD was sent" in said.stderr
        with found_peer(site.url, vehicle=1) as peer:
            assert not peer.in_auto and speed_of(peer) < 0.03


def test_a_watch_takes_a_stop_for_its_commanders(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), watched(site):
        site.order("start")
        until(site, lambda events, run: "Scanned S1" in told(events))
        assert ordered(site, "pause", "--as", "anna").returncode == 0
        site.order("resume", take_over=True)
    reasons = [event.reason for event in site.events if isinstance(event, Paused)]
    assert reasons == ["pause by anna"]
    assert site.run.state == "FINISHED"


class Deaf(Scripted):
    """Accepts every command, and reports GUIDED and 0.4 m/s all the same."""

    autopilot = dialect.MAV_AUTOPILOT_ARDUPILOTMEGA
    result = dialect.MAV_RESULT_ACCEPTED

    def beat(self) -> None:
        self.base_mode, self.custom_mode = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, GUIDED[0]
        super().beat()
        self.send(dialect.MAVLink_local_position_ned_message(self.boot_ms, 0, 0, 0, 0.4, 0, 0))

    def on_command_long(self, message: Message, to: Who) -> None:
        self.answer(message.command, self.result, to)


class Unwilling(Deaf):
    result = dialect.MAV_RESULT_FAILED


class Beating:
    """A clock, and heartbeats of vehicle 1 four times a second, for three seconds."""

    def __init__(self, hold: FirstHold) -> None:
        self.hold = hold
        self.now_s = 0.0

    def monotonic(self) -> float:
        return self.now_s

    def get(self, timeout_s: float) -> Message:
        self.now_s += 0.25
        if self.now_s >= 3.0:
            self.hold.close()
        heartbeat = dialect.MAVLink_heartbeat_message(10, 3, 129, 10, 4, 3)
        heartbeat._header.srcSystem = heartbeat._header.srcComponent = 1
        return heartbeat


def test_frequent_heartbeats_do_not_hold_up_the_next_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[Message] = []
    ways: list[dict[str, Any]] = []
    line = SimpleNamespace(send=lambda message, **how: (sent.append(message), ways.append(how)))
    hold = FirstHold(cast(Any, line), None)
    beating = Beating(hold)
    monkeypatch.setattr(first_hold, "time", beating)
    hold.begin([(1, Mode(4))])
    hold.repeat(cast(Any, beating))
    assert all(map(is_hold, sent))
    assert all(how == {"everywhere": True} for how in ways)  # another vehicle may have the same id
    assert len(sent) == 8  # the first, one at the first heartbeat, and one with every second heartbeat


def test_a_vehicle_that_drives_on_is_reported_and_its_stop_is_unknown(tmp_path: Path) -> None:
    with Deaf() as vehicle:
        said = stopgo("pause", "--mavlink", str(vehicle.url), "--state", str(tmp_path))
    assert said.returncode == 3
    assert "mode GUIDED, 0.40 m/s" in said.stderr and "look at the vehicle" in said.stderr
    assert vehicle.heard["COMMAND_LONG"] > 10


def test_a_refused_stop_says_so(tmp_path: Path) -> None:
    with Unwilling() as vehicle:
        said = stopgo("abort", "--mavlink", str(vehicle.url), "--state", str(tmp_path))
    assert said.returncode == 1 and "FAILED to mode HOLD" in said.stderr


def test_a_silent_vehicle_leaves_a_stop_unknown(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    said = ordered(site, "pause", "--timeout", "1")
    assert said.returncode == 3 and "HOLD was sent to vehicle 1" in said.stderr
    assert "nothing was sent" not in said.stderr


def test_a_silent_vehicle_gets_hold_by_the_record_in_its_named_folder(
    tmp_path: Path, frames: list[Message]
) -> None:
    """A link may be blocked in one direction only; nothing was sent without --vehicle."""
    site = Site(tmp_path, "ardupilot")
    folder = str(site.folder / "station")
    said = stopgo("pause", "--mavlink", str(site.url), "--state", folder, "--timeout", "1")
    assert said.returncode == 3 and "HOLD was sent to vehicle 1" in said.stderr
    assert is_hold(frames[0])


def test_a_stop_where_nothing_was_ever_found_is_not_said_to_be_sent(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    said = stopgo("pause", "--mavlink", str(site.url), "--state", str(tmp_path / "other"), "--timeout", "1")
    assert said.returncode == 2 and "nothing was sent" in said.stderr


def test_the_note_of_a_stop_ends_with_it(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up():
        site.order("start")
        assert ordered(site, "abort").returncode == 0
    with site.book() as book:
        assert isinstance(book, Logbook) and book.journal.fact("ordered", Ordered) is None


def test_the_note_of_a_stop_of_unknown_outcome_ends_with_it(tmp_path: Path) -> None:
    """For 20 s more `status` printed the state before the stop, and every other command was refused."""
    site = Site(tmp_path, "ardupilot")
    with site.up():
        site.order("start")
    assert ordered(site, "abort", "--timeout", "1").returncode == 3
    with site.up(), site.reached(looks_only=True) as station:
        wait_until(lambda: station.status().state == "PAUSED")
    with site.up():
        assert site.order("resume", take_over=True).state == "RUNNING"
