"""An upload succeeds when the vehicle reads the mission back, and else says what is on it instead."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from stopgo.bridge.mavlink.transfer import upload as uploads
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.transfer.upload import Uploaded, clear, upload
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.messages import item_message, item_of
from stopgo.bridge.mavlink.vehicle_link.origin import check_origin
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, reached
from stopgo.bridge.mavlink.vehicle_link.wire import Who
from stopgo.mission.errors import NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.items import Item
from stopgo.mission.mavlink.telemetry import Message
from tests.bridge.mavlink.lists import SITE, held, stops
from tests.bridge.mavlink.lossy import Lossy, Roughness
from tests.bridge.mavlink.scripted import Scripted

pytestmark = pytest.mark.usefixtures("own_time")

OLD, NEW = stops(3), stops(20, east=7)
HELD_NEW = Uploaded(items=40, already=False)


def items_on(vehicle: Scripted) -> list[Item]:
    return [item_of(message) for message in vehicle.held]


def pushed(vehicle: Scripted, sent: Any = NEW, *, timeout_s: float = 1.0, **options: Any) -> Uploaded:
    with reached(vehicle.url, vehicle=1, timeout_s=timeout_s) as peer:
        return upload(peer, sent, **options)


def test_a_mission_is_seen_on_the_vehicle() -> None:
    with Scripted(held(OLD)) as vehicle:
        assert pushed(vehicle) == HELD_NEW
        assert items_on(vehicle) == items_on_list(held(NEW))


def items_on_list(messages: list[Message]) -> list[Item]:
    return [item_of(message) for message in messages]


def test_what_it_holds_already_is_not_sent() -> None:
    with Scripted(held(NEW)) as vehicle:
        assert pushed(vehicle) == Uploaded(items=40, already=True)
        assert vehicle.heard["MISSION_COUNT"] == 0


def test_progress_ends_with_what_was_read_back() -> None:
    told: list[tuple[int, int]] = []
    with Scripted() as vehicle:
        pushed(vehicle, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (80, 80)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


class Asks(Scripted):
    """Asks with MISSION_REQUEST, and once again for an item that it has."""

    def request(self, seq: int, to: Who) -> None:
        for number in (seq - 3, seq):
            if number >= 0:
                self.send(dialect.MAVLink_mission_request_message(to.system, to.component, number, 0))


def test_every_request_is_answered_with_an_int_item() -> None:
    with Asks() as vehicle:
        assert pushed(vehicle) == HELD_NEW
        assert vehicle.heard["MISSION_ITEM"] == 0


# Items that are refused.


class Refuses(Scripted):
    """Takes all items but number 5."""

    result = dialect.MAV_MISSION_INVALID_PARAM1

    def on_mission_item_int(self, message: Message, to: Who) -> None:
        if self.receiving is not None and message.seq == self.awaited == 5:
            self.receiving = None
            self.ack(self.result, to)
        else:
            super().on_mission_item_int(message, to)


@pytest.mark.parametrize(
    ("result", "field"),
    [
        (dialect.MAV_MISSION_INVALID_PARAM1, r": param1 2\.5 \(INVALID_PARAM1\)"),
        (dialect.MAV_MISSION_UNSUPPORTED, r": command 93 \(UNSUPPORTED\)"),
        (dialect.MAV_MISSION_UNSUPPORTED_FRAME, r": frame 2 \(UNSUPPORTED_FRAME\)"),
        (dialect.MAV_MISSION_INVALID, r" \(INVALID\)"),
    ],
)
def test_a_refused_item_is_named_with_its_stop_and_field(result: int, field: str) -> None:
    said = r"refused item 5, NAV_DELAY \(93\), scan of stop S3" + field
    with Refuses(held(OLD)) as vehicle:
        vehicle.result = result
        with pytest.raises(
            NegativeResult, match=said + r"; it still holds the mission it had before \(6 items\)"
        ):
            pushed(vehicle)
        assert items_on(vehicle) == items_on_list(held(OLD))


class Full(Scripted):
    def on_mission_count(self, message: Message, to: Who) -> None:
        self.ack(dialect.MAV_MISSION_NO_SPACE, to)


def test_too_many_items_are_reported_as_such() -> None:
    with Full() as vehicle, pytest.raises(NegativeResult, match=r"refused 40 items .* plan fewer stops"):
        pushed(vehicle)


class Busy(Scripted):
    """Another station uploads."""

    def on_mission_count(self, message: Message, to: Who) -> None:
        self.ack(dialect.MAV_MISSION_DENIED, to)


def test_a_second_station_is_informed_that_nothing_was_stored() -> None:
    said = r"takes no mission now \(DENIED\).*nothing of this mission was stored"
    with Busy(held(OLD)) as vehicle, pytest.raises(NegativeResult, match=said):
        pushed(vehicle)


class Forgets(Scripted):
    """Keeps delays as whole seconds."""

    def on_mission_item_int(self, message: Message, to: Who) -> None:
        if self.receiving is not None and len(self.receiving) == 40:
            message.param1 = float(int(message.param1))
        super().on_mission_item_int(message, to)


def test_what_is_kept_otherwise_is_no_success() -> None:
    said = r"read back otherwise: item 1 \(scan of S1\): param1 sent 2\.5, .* is 2;.*and 17 more; it again"
    with Forgets(held(OLD)) as vehicle:
        with pytest.raises(NegativeResult, match=said):
            pushed(vehicle, timeout_s=2.0)
        assert len(vehicle.held) == 6


# Answers that get lost, come twice, or are not for this transfer.


class LosesLast(Scripted):
    """Does not say ACCEPTED; what it says to the last item when that comes again is `again`."""

    again: int | None = None

    def ack(self, result: int, to: Who, mission_type: int = 0) -> None:
        if result != dialect.MAV_MISSION_ACCEPTED:
            super().ack(result, to, mission_type)

    def on_mission_item_int(self, message: Message, to: Who) -> None:
        if self.receiving is None and self.again is not None:
            self.send(dialect.MAVLink_mission_ack_message(to.system, to.component, self.again, 0))
        super().on_mission_item_int(message, to)


@pytest.mark.parametrize("again", [None, dialect.MAV_MISSION_ERROR, dialect.MAV_MISSION_ACCEPTED])
def test_a_lost_last_ack_is_made_good_by_the_read_back(again: int | None) -> None:
    with LosesLast(held(OLD)) as vehicle:
        vehicle.again = again
        assert pushed(vehicle) == HELD_NEW


class Chatters(Scripted):
    """Says INVALID_SEQUENCE to what it did not ask for, and acknowledges what nobody here has sent."""

    def on_mission_item_int(self, message: Message, to: Who) -> None:
        self.ack(dialect.MAV_MISSION_ERROR, to, mission_type=dialect.MAV_MISSION_TYPE_FENCE)
        self.ack(dialect.MAV_MISSION_INVALID, Who(to.system, to.component + 1))
        if message.seq < 20:
            self.ack(dialect.MAV_MISSION_ACCEPTED, to)
        if self.receiving is not None and message.seq != self.awaited:
            self.ack(dialect.MAV_MISSION_INVALID_SEQUENCE, to)
        super().on_mission_item_int(message, to)


@pytest.mark.parametrize("seed", range(3))
def test_foreign_early_and_doubled_answers_do_not_end_a_transfer(seed: int) -> None:
    rough = Roughness(delay_s=0.005, loss=0.05, doubled=0.3, overtaken=0.3)
    with Chatters() as vehicle, Lossy(vehicle.url.number, rough, seed=seed) as line:
        with reached(line.url, vehicle=1) as peer:
            assert upload(peer, NEW) == HELD_NEW
        assert items_on(vehicle) == items_on_list(held(NEW))


class AcceptsTooEarly(Scripted):
    """Misses an item of every transfer, and accepts the list when an item arrives ahead of another."""

    missed = False

    def on_mission_item_int(self, message: Message, to: Who) -> None:
        if self.receiving is not None and message.seq > self.awaited:
            self.ack(dialect.MAV_MISSION_ACCEPTED, to)
        elif message.seq == 36 and not self.missed:
            self.missed = True
        else:
            super().on_mission_item_int(message, to)

    def on_mission_count(self, message: Message, to: Who) -> None:
        self.missed = False
        super().on_mission_count(message, to)


def test_a_list_that_was_accepted_before_it_had_arrived_is_sent_item_by_item() -> None:
    with AcceptsTooEarly(held(OLD)) as vehicle:
        assert pushed(vehicle) == HELD_NEW
        assert items_on(vehicle) == items_on_list(held(NEW))


# Vehicles that go away.


class Breaks(Scripted):
    """Does something else when item 5 comes for the first time."""

    broken = False

    def on_mission_item_int(self, message: Message, to: Who) -> None:
        if message.seq == 5 and not self.broken:
            self.broken = True
            self.break_down()
        else:
            super().on_mission_item_int(message, to)

    def break_down(self) -> None:
        self.silent = True


def test_of_a_vehicle_that_falls_silent_nothing_is_known() -> None:
    said = r"no data after \d of 40 items had arrived .* holds now is unknown .*do not start it"
    with Breaks(held(OLD)) as vehicle, pytest.raises(OutcomeUnknown, match=said):
        pushed(vehicle, timeout_s=0.5)


class Reboots(Breaks):
    def break_down(self) -> None:
        self.boot_ms, self.receiving = 0, None


def test_a_reboot_is_noticed_and_what_it_left_is_reported() -> None:
    said = r"was restarted when \d of 40 items had arrived; it still holds the mission it had"
    with Reboots(held(OLD)) as vehicle, pytest.raises(NegativeResult, match=said):
        pushed(vehicle, timeout_s=5.0)


class GivesUp(Breaks):
    def break_down(self) -> None:
        self.receiving = None
        self.ack(dialect.MAV_MISSION_OPERATION_CANCELLED, Who(254, 190))


def test_a_transfer_that_the_vehicle_ends_is_begun_again() -> None:
    with GivesUp() as vehicle:
        assert pushed(vehicle) == HELD_NEW


def test_a_vehicle_that_reports_nothing_was_not_touched() -> None:
    class Deaf(Scripted):
        def take(self, message: Message) -> None:
            self.heard[message.get_type()] += 1

    with Deaf() as vehicle:
        with pytest.raises(RobotUnreachable, match=r"did not send its mission .*signed messages"):
            pushed(vehicle, timeout_s=0.5)
        assert vehicle.heard["MISSION_COUNT"] == 0


class AnnouncesMore(Scripted):
    def on_mission_request_list(self, message: Message, to: Who) -> None:
        self.send(dialect.MAVLink_mission_count_message(to.system, to.component, len(self.held) + 2, 0))

    def on_mission_request_int(self, message: Message, to: Who) -> None:
        if message.seq < len(self.held):
            super().on_mission_request_int(message, to)


def test_a_vehicle_that_sends_fewer_items_than_it_announced_is_quoted() -> None:
    said = "sent 6 of the 8 items that it announced, and no more$"
    with AnnouncesMore(held(OLD)) as vehicle, pytest.raises(RobotUnreachable, match=said):
        pushed(vehicle, timeout_s=0.5)


# A vehicle that replaces its mission item by item.


class Rover(Scripted):
    """Stores each item at once, and writes its own home over item 0."""

    autopilot = dialect.MAV_AUTOPILOT_ARDUPILOTMEGA

    def on_mission_count(self, message: Message, to: Who) -> None:
        del self.held[message.count :]
        super().on_mission_count(message, to)

    def on_mission_item_int(self, message: Message, to: Who) -> None:
        if self.receiving is not None and message.seq == self.awaited:
            kept = autopilot_named("ardupilot").kept(item_of(message))
            kept = replace(kept, x=470_000_001) if message.seq == 0 else kept
            message = item_message(kept, message.seq, self.who)
            self.held[message.seq : message.seq + 1] = [message]
        super().on_mission_item_int(message, to)


ROVER_OLD, ROVER_NEW = stops(3, "ardupilot"), stops(20, "ardupilot", east=7)


def test_home_is_sent_first_and_not_compared() -> None:
    with Rover(held(ROVER_OLD)) as vehicle:
        assert pushed(vehicle, ROVER_NEW) == HELD_NEW
        assert len(vehicle.held) == 41


class RefusingRover(Refuses, Rover):
    """Has taken item 5 of its old mission."""

    def on_mission_item_int(self, message: Message, to: Who) -> None:
        old = self.receiving is not None and len(self.receiving) == 7
        (Rover if old else Refuses).on_mission_item_int(self, message, to)


def rover_refusing(before: list[Message]) -> RefusingRover:
    vehicle = RefusingRover(before)
    vehicle.result = dialect.MAV_MISSION_UNSUPPORTED
    return vehicle


def test_half_an_upload_is_replaced_by_the_old_mission() -> None:
    said = r"refused item 5, NAV_WAYPOINT .* S3.*; it again holds the mission it had before \(6 items\)"
    with rover_refusing(held(ROVER_OLD)) as vehicle:
        with pytest.raises(NegativeResult, match=said):
            pushed(vehicle, ROVER_NEW)
        assert items_on(vehicle)[1:] == items_on_list(held(ROVER_OLD))[1:]


def test_half_an_upload_to_an_empty_vehicle_is_taken_off() -> None:
    with rover_refusing([]) as vehicle:
        with pytest.raises(NegativeResult, match=r"it holds no mission"):
            pushed(vehicle, ROVER_NEW)
        assert vehicle.held == []


# Ctrl-C.


@pytest.mark.parametrize(("kind", "before"), [(Rover, ROVER_OLD), (Scripted, OLD)])
def test_ctrl_c_leaves_the_mission_before_and_says_so(kind: type[Scripted], before: Any) -> None:
    def interrupt(done: int, total: int) -> None:
        if done == 10:
            raise KeyboardInterrupt

    told: list[str] = []
    sent = stops(20, before.autopilot, east=7)
    with kind(held(before)) as vehicle:
        with pytest.raises(KeyboardInterrupt):
            pushed(vehicle, sent, progress=interrupt, report=told.append, timeout_s=5.0)
        assert dialect.MAV_MISSION_OPERATION_CANCELLED in vehicle.acks
        assert items_on(vehicle)[1:] == items_on_list(held(before))[1:]
    assert len(told) == 1 and "holds the mission it had before (6 items)" in told[0]


def test_a_second_ctrl_c_leaves_at_once_and_says_that_it_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    told: list[str] = []
    monkeypatch.setattr(uploads, "recovered_content", interrupt)
    with Scripted(held(OLD)) as vehicle, pytest.raises(KeyboardInterrupt):
        pushed(vehicle, progress=interrupt, report=told.append)
    (line,) = told
    assert "what it holds now is unknown" in line and "do not start it before" in line


def test_ctrl_c_while_the_old_mission_is_read_says_that_nothing_was_sent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    told: list[str] = []
    monkeypatch.setattr(uploads, "download", interrupt)
    with Scripted(held(OLD)) as vehicle, pytest.raises(KeyboardInterrupt):
        pushed(vehicle, report=told.append)
    assert told == ["nothing was sent of the mission; the vehicle holds what it held"]


# What may not be touched.


def running(vehicle: Scripted) -> Scripted:
    vehicle.base_mode, vehicle.custom_mode = dialect.MAV_MODE_FLAG_SAFETY_ARMED, 10
    return vehicle


def test_the_mission_that_is_driven_is_left_alone() -> None:
    with running(Rover(held(ROVER_OLD))) as vehicle:
        with pytest.raises(
            NegativeResult, match=r"armed and follows its mission.*--while-running.*nothing was sent"
        ):
            pushed(vehicle, ROVER_NEW)
        assert vehicle.heard["MISSION_REQUEST_LIST"] == 0
        with reached(vehicle.url, vehicle=1) as peer, pytest.raises(NegativeResult, match="armed"):
            clear(peer)
        assert pushed(vehicle, ROVER_NEW, while_running=True) == HELD_NEW


def test_clearing_is_seen() -> None:
    with Rover(held(ROVER_OLD)) as vehicle, reached(vehicle.url, vehicle=1) as peer:
        assert (clear(peer), clear(peer)) == (6, 0)
        assert download(peer) == ()


class ClearsAll(Scripted):
    """Does not know that no items are a mission."""

    def on_mission_count(self, message: Message, to: Who) -> None:
        self.ack(dialect.MAV_MISSION_ERROR, to)

    def on_mission_clear_all(self, message: Message, to: Who) -> None:
        self.held = []
        self.ack(dialect.MAV_MISSION_ACCEPTED, to)


class NeverClears(ClearsAll):
    def on_mission_clear_all(self, message: Message, to: Who) -> None:
        self.ack(dialect.MAV_MISSION_ACCEPTED, to)


def test_clearing_goes_by_clear_all_where_it_must_and_is_not_believed_unseen() -> None:
    with ClearsAll(held(OLD)) as vehicle, reached(vehicle.url, vehicle=1) as peer:
        assert clear(peer) == 6
    told = pytest.raises(OutcomeUnknown, match="does not show that")
    with NeverClears(held(OLD)) as vehicle, reached(vehicle.url, vehicle=1) as peer, told:
        clear(peer)


# The origin.


@pytest.fixture
def peer() -> Any:
    with Scripted() as vehicle, reached(vehicle.url, vehicle=1) as peer:
        yield vehicle, peer


def test_an_origin_within_five_centimetres_is_the_same(peer: tuple[Scripted, Peer]) -> None:
    vehicle, it = peer
    vehicle.origin = (470_000_004, 80_000_000, 0)  # 0.044 m north
    check_origin(it, SITE)
    vehicle.origin = (470_000_007, 80_000_000, 0)
    with pytest.raises(
        NegativeResult, match=r"is 0\.08 m from the mission's 47\.0000000, 8\.0000000.*once per boot"
    ):
        check_origin(it, SITE, set_it=True)


def test_an_origin_is_set_where_there_is_none(peer: tuple[Scripted, Peer]) -> None:
    vehicle, it = peer
    vehicle.origin = None
    with pytest.raises(NegativeResult, match=r"no origin.*--set-origin.*nothing was sent"):
        check_origin(it, SITE)
    assert check_origin(it, SITE, set_it=True).lat == 47.0
