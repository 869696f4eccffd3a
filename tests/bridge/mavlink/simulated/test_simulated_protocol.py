"""The vehicle's end of the mission protocol: what every profile does, and what each does in its own way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.mission.mavlink.items import Command, Item, MavFrame
from tests.bridge.mavlink.simulated.bench import (
    ACCEPTED,
    OTHER,
    STATION,
    Bench,
    camera,
    delay,
    item_message,
    many,
    waypoint,
)

d = dialect
Make = Callable[..., Bench]
TOUR = [waypoint(2.0, 0.0), delay(1.0), camera(1), delay(2.0), waypoint(2.0, 3.0)]


@pytest.fixture(params=list(PROFILES))
def make(request: pytest.FixtureRequest) -> Make:
    return lambda **more: Bench(request.param, **more)


def asked(bench: Bench) -> list[int]:
    return [message.seq for message in bench.said("MISSION_REQUEST", "MISSION_REQUEST_INT")]


# Every profile


def test_what_is_read_back_is_what_the_autopilot_keeps(make: Make) -> None:
    bench = make()
    assert bench.upload(TOUR) == ACCEPTED
    assert bench.held() == bench.kept(TOUR)
    assert asked(bench) == list(range(len(bench.listed(TOUR))))


def test_items_are_asked_for_as_the_profile_asks(make: Make) -> None:
    bench = make()
    bench.upload(TOUR)
    kinds = {m.get_type() for m in bench.said("MISSION_REQUEST", "MISSION_REQUEST_INT")}
    assert kinds == {"MISSION_REQUEST" if bench.first else "MISSION_REQUEST_INT"}


def test_a_lost_item_is_asked_for_again_until_the_vehicle_gives_up(make: Make) -> None:
    bench = make()
    habits = bench.vehicle.autopilot.behaviour
    bench.count(3)
    bench.pass_time(habits.give_up_s + 1, step_s=0.05)
    assert asked(bench) == [0] * (1 + math.floor(habits.give_up_s / habits.ask_again_s + 0.01))
    assert bench.results() == ([d.MAV_MISSION_OPERATION_CANCELLED] if habits.tells_giving_up else [])
    before = len(asked(bench))
    bench.pass_time(3.0)
    assert len(asked(bench)) == before


def test_no_items_is_a_list_too(make: Make) -> None:
    bench = make()
    bench.upload(TOUR)
    bench.count(0)
    assert bench.results()[-1] == ACCEPTED
    assert bench.held() == []


def test_clearing_clears_one_kind_or_all(make: Make) -> None:
    bench = make()
    rally = Item(5100, MavFrame.GLOBAL_RELATIVE_ALT_INT, x=474_000_000, y=85_000_000)
    assert (bench.upload(TOUR), bench.upload([rally], kind=2)) == (ACCEPTED, ACCEPTED)
    bench.say(d.MAVLink_mission_clear_all_message(1, 1, 0))
    assert (len(bench.download()), len(bench.download(kind=2))) == (0, 1)
    bench.say(d.MAVLink_mission_clear_all_message(1, 1, 255))
    assert (len(bench.download()), len(bench.download(kind=2))) == (0, 0)


def test_kinds_are_kept_apart(make: Make) -> None:
    bench = make()
    place = {"x": 474_000_000, "y": 85_000_000}
    corners = [Item(5001, MavFrame.GLOBAL, (3.0, 0.0, 0.0, 0.0), **place)] * 3
    assert bench.upload(corners, kind=1) == ACCEPTED
    assert [m.mission_type for m in bench.download(kind=1)] == [1, 1, 1]
    assert (bench.held(), bench.download(kind=2)) == ([], [])
    assert bench.upload(TOUR[:1], kind=1) == d.MAV_MISSION_UNSUPPORTED
    assert len(bench.download(kind=1)) == 3 or not bench.vehicle.autopilot.behaviour.atomic


def test_an_unknown_kind_is_refused(make: Make) -> None:
    bench = make()
    bench.count(3, kind=7)
    bench.say(d.MAVLink_mission_request_list_message(1, 1, 9))
    bench.say(d.MAVLink_mission_clear_all_message(1, 1, 9))
    assert bench.results() == [d.MAV_MISSION_UNSUPPORTED] * 3


def test_partial_lists_are_refused(make: Make) -> None:
    bench = make()
    bench.say(d.MAVLink_mission_write_partial_list_message(1, 1, 0, 1, 0))
    bench.say(d.MAVLink_mission_request_partial_list_message(1, 1, 0, 1, 0))
    assert bench.results() == [d.MAV_MISSION_UNSUPPORTED] * 2


def test_more_items_than_fit_are_refused_at_once(make: Make) -> None:
    bench = make()
    bench.upload(TOUR)
    most = bench.vehicle.autopilot.max_items
    if most < 65_535:
        bench.count(most + 1)
        assert bench.results()[-1] == d.MAV_MISSION_NO_SPACE
        assert bench.held() == bench.kept(TOUR)
    assert bench.upload(many(min(most, 1000) - bench.first)) == ACCEPTED


def test_the_old_message_in_degrees_is_taken_too(make: Make) -> None:
    bench = make()
    bench.count(1 + bench.first)
    for number in range(1 + bench.first):
        bench.say(d.MAVLink_mission_item_message(1, 1, number, 3, 16, 0, 1, 1.0, 0, 0, 0, 47.4, 8.5, 0.0, 0))
    assert bench.results() == [ACCEPTED]
    (item,) = bench.held()
    assert abs(item.x - 474_000_000) < 40 and abs(item.y - 85_000_000) < 10  # float32: half a metre


def test_an_item_is_given_in_degrees_to_a_station_that_asks_so(make: Make) -> None:
    bench = make()
    bench.upload([waypoint(0.0, 0.0)])
    bench.say(d.MAVLink_mission_request_list_message(1, 1, 0))
    for number in range(1 + bench.first):
        said = bench.say(d.MAVLink_mission_request_message(1, 1, number, 0))
    assert said[0].get_type() == "MISSION_ITEM"
    assert said[0].x == pytest.approx(47.4)


@pytest.mark.parametrize(
    ("item", "result"),
    [
        (Item(31010, MavFrame.MISSION), d.MAV_MISSION_UNSUPPORTED),
        (replace(TOUR[0], frame=d.MAV_FRAME_LOCAL_NED), d.MAV_MISSION_UNSUPPORTED_FRAME),
        (replace(TOUR[0], frame=d.MAV_FRAME_LOCAL_FLU), d.MAV_MISSION_UNSUPPORTED_FRAME),
        (replace(TOUR[0], x=910_000_000), d.MAV_MISSION_INVALID_PARAM5_X),
        (replace(TOUR[0], y=-1_810_000_000), d.MAV_MISSION_INVALID_PARAM6_Y),
        (replace(TOUR[0], z=math.nan), d.MAV_MISSION_INVALID_PARAM7),
        (replace(TOUR[0], params=(math.inf, 0.0, 0.0, 0.0)), d.MAV_MISSION_INVALID_PARAM1),
    ],
)
def test_an_item_that_cannot_be_is_refused_and_ends_the_upload(make: Make, item: Item, result: int) -> None:
    bench = make()
    bench.upload(TOUR)
    assert bench.upload([TOUR[0], item, TOUR[1]]) == d.MAV_MISSION_ERROR  # no upload: nobody asked for that
    assert bench.results()[-2] == result
    assert (bench.held() == bench.kept(TOUR)) == bench.vehicle.autopilot.behaviour.atomic


def test_not_a_number_is_refused_where_the_autopilot_looks(make: Make) -> None:
    bench = make()
    result = bench.upload([replace(TOUR[0], params=(math.nan, 0.0, 0.0, 0.0))])
    assert result == (ACCEPTED if bench.vehicle.autopilot.name == "px4" else d.MAV_MISSION_INVALID_PARAM1)


def test_a_second_station_is_sent_away_during_an_upload(make: Make) -> None:
    bench = make()
    bench.count(3)
    bench.count(3, who=OTHER)
    assert bench.results() == [bench.vehicle.autopilot.behaviour.other_station]
    assert bench.last("MISSION_ACK").target_system == OTHER.system
    bench.item(0, TOUR[0], who=OTHER)
    bench.item(0, TOUR[0])
    assert asked(bench)[-1] == 1
    before = len(bench.said("MISSION_COUNT"))
    bench.say(d.MAVLink_mission_request_list_message(1, 1, 0), OTHER)
    assert len(bench.said("MISSION_COUNT")) == before


def test_stations_after_one_another_both_upload(make: Make) -> None:
    bench = make()
    bench.upload(TOUR)
    listed = bench.listed(TOUR[:2])
    bench.count(len(listed), who=OTHER)
    for number, item in enumerate(listed):
        bench.item(number, item, who=OTHER)
    assert bench.results() == [ACCEPTED, ACCEPTED]
    assert bench.held() == bench.kept(TOUR[:2])


def test_an_item_of_another_kind_is_no_item_of_the_upload(make: Make) -> None:
    bench = make()
    bench.count(2)
    bench.item(0, TOUR[0], kind=1)
    assert bench.results() == [d.MAV_MISSION_ERROR]
    assert asked(bench) == [0]


def test_the_first_item_repeated_count_begins_again(make: Make) -> None:
    """A station that has heard no request sends its COUNT again: that must never be an error."""
    bench = make()
    bench.count(3)
    bench.count(3)
    assert asked(bench) == [0, 0]
    assert bench.results() == []


def test_items_outlive_the_vehicles_process(make: Make, tmp_path: Path) -> None:
    bench = make(state=tmp_path)
    items = [replace(TOUR[0], params=(1.0, 0.0, 0.0, math.nan)), *TOUR[1:]]
    bench.upload(items)
    again = make(state=tmp_path)
    assert str(again.held()) == str(bench.held())  # nan is not equal to itself
    assert len(again.held()) == len(items)


# Each in its own way


def test_an_aborted_upload_leaves_a_mix_on_ardupilot_and_the_old_mission_elsewhere(make: Make) -> None:
    bench = make()
    bench.upload(TOUR)
    new = bench.listed([delay(7.0), delay(8.0), delay(9.0)])
    bench.count(len(new))
    for number in range(1 + bench.first):
        bench.item(number, new[number])
    bench.pass_time(20.0)
    mixed = [delay(7.0), *TOUR[1:3]]
    assert bench.held() == bench.kept(TOUR if bench.vehicle.autopilot.behaviour.atomic else mixed)


def test_an_item_that_was_not_asked_for(make: Make) -> None:
    bench = make()
    listed = bench.listed(TOUR)
    bench.count(len(listed))
    bench.item(0, listed[0])
    before = len(bench.all)
    bench.item(0, listed[0])
    bench.item(3, listed[3])
    said = [(m.get_type(), getattr(m, "type", None) or m.seq) for m in bench.all[before:]]
    invalid = ("MISSION_ACK", d.MAV_MISSION_INVALID_SEQUENCE)
    expected = {
        "ardupilot": [invalid, invalid],
        "px4": [],
        "generic": [("MISSION_REQUEST_INT", 1), ("MISSION_REQUEST_INT", 1)],
    }
    assert said == expected[bench.vehicle.autopilot.name]
    for number, item in enumerate(listed[1:], start=1):
        bench.item(number, item)
    assert bench.results()[-1] == ACCEPTED


def test_the_last_item_again_after_its_ack_was_lost(make: Make) -> None:
    bench = make(faults=["lostack@1"])
    listed = bench.listed(TOUR)
    bench.count(len(listed))
    for number, item in enumerate(listed):
        bench.item(number, item)
    assert bench.results() == []
    bench.item(len(listed) - 1, listed[-1])
    assert bench.results() == [d.MAV_MISSION_ERROR if bench.first else ACCEPTED]
    assert bench.held() == bench.kept(TOUR)
    bench.item(0, listed[0])
    assert len(bench.results()) == (1 if bench.vehicle.autopilot.name == "generic" else 2)
    bench.item(60, listed[0])
    assert bench.results()[-1] == d.MAV_MISSION_ERROR


def test_cancelling_an_upload(make: Make) -> None:
    bench = make()
    bench.upload(TOUR)
    bench.count(9)
    bench.say(d.MAVLink_mission_ack_message(1, 1, d.MAV_MISSION_OPERATION_CANCELLED, 1))
    bench.say(d.MAVLink_mission_ack_message(1, 1, d.MAV_MISSION_OPERATION_CANCELLED, 0), OTHER)
    bench.say(d.MAVLink_mission_ack_message(1, 1, d.MAV_MISSION_OPERATION_CANCELLED, 0))
    before = len(asked(bench))
    bench.pass_time(1.25, step_s=0.25)
    assert (len(asked(bench)) == before) == bench.vehicle.autopilot.behaviour.cancels


def test_a_new_upload_in_the_middle_of_ones_own(make: Make) -> None:
    bench = make()
    listed = bench.listed(TOUR)
    bench.count(len(listed))
    bench.item(0, listed[0])
    bench.count(len(listed))
    if bench.vehicle.autopilot.behaviour.begins_again:
        assert asked(bench) == [0, 1, 0]
    else:
        assert bench.results() == [d.MAV_MISSION_ERROR]


def test_clearing_while_the_mission_runs(make: Make) -> None:
    bench = make()
    bench.upload([delay(100.0)])
    bench.start()
    bench.say(d.MAVLink_mission_clear_all_message(1, 1, 0))
    ardupilot = bench.vehicle.autopilot.name == "ardupilot"
    assert bench.results()[-1] == (d.MAV_MISSION_ERROR if ardupilot else ACCEPTED)
    bench.count(0)
    assert bench.results()[-1] == ACCEPTED
    assert bench.vehicle.auto.due_ns is None


@pytest.mark.parametrize("profile", ["strict", "ardupilot"])
def test_any_item_is_given_as_often_as_it_is_asked_for(profile: str) -> None:
    bench = Bench(profile)
    bench.upload(TOUR)
    for number in (3, 0, 3, 2, 2):
        said = bench.say(d.MAVLink_mission_request_int_message(1, 1, number, 0))
        assert [(m.get_type(), m.seq) for m in said] == [("MISSION_ITEM_INT", number)]
    bench.say(d.MAVLink_mission_request_int_message(1, 1, 99, 0))
    assert bench.results()[-1] in (d.MAV_MISSION_ERROR, d.MAV_MISSION_INVALID_SEQUENCE)


def test_px4_gives_items_in_order_each_once_more_and_is_busy_until_acknowledged() -> None:
    bench = Bench("px4")
    bench.upload(TOUR)
    request = d.MAVLink_mission_request_int_message
    assert bench.say(request(1, 1, 0, 0)) == []  # no list was asked for
    bench.say(d.MAVLink_mission_request_list_message(1, 1, 0))
    assert [bench.say(request(1, 1, number, 0))[0].seq for number in (0, 1, 1, 2)] == [0, 1, 1, 2]
    bench.count(2)
    assert bench.results()[-1] == d.MAV_MISSION_ERROR
    bench.say(request(1, 1, 0, 0))
    assert bench.results()[-1] == d.MAV_MISSION_ERROR
    assert bench.upload(TOUR) == ACCEPTED


def test_px4_takes_no_command_without_a_place_in_a_global_frame() -> None:
    bench = Bench("px4")
    assert (
        bench.upload([replace(delay(1.0), frame=MavFrame.GLOBAL_RELATIVE_ALT_INT)])
        == d.MAV_MISSION_UNSUPPORTED
    )
    assert bench.upload([Item(Command.DO_SET_SERVO, MavFrame.MISSION)]) == d.MAV_MISSION_UNSUPPORTED


def test_px4_lets_a_mission_go_on_when_it_is_sent_the_same_again() -> None:
    bench = Bench("px4")
    bench.upload([delay(5.0), delay(50.0)])
    bench.start()
    bench.pass_time(6.0)
    bench.upload([delay(5.0), delay(50.0)])
    assert bench.vehicle.auto.current == 1
    bench.upload([delay(5.0), delay(51.0)])
    assert bench.vehicle.auto.current == 0


def test_ardupilot_puts_its_own_home_in_front() -> None:
    bench = Bench("ardupilot")
    bench.upload(TOUR)
    home = bench.download()[0]
    assert (home.seq, home.x, home.y, home.z) == (0, 474_000_000, 85_000_000, 400.0)
    empty = Bench("ardupilot")
    assert empty.download() == []
    assert empty.say(d.MAVLink_mission_request_int_message(1, 1, 0, 0))[0].x == 474_000_000


@pytest.mark.parametrize("frame", [0, 2, 3, 5, 6, 10, 11])
def test_ardupilot_takes_every_global_frame(frame: int) -> None:
    bench = Bench("ardupilot")
    assert bench.upload([replace(TOUR[0], frame=frame)]) == ACCEPTED


# What goes wrong


def test_a_refused_item_ends_the_upload_once(make: Make) -> None:
    bench = make(faults=[f"nack@2={d.MAV_MISSION_INVALID_PARAM2}"])
    bench.upload(TOUR)
    assert d.MAV_MISSION_INVALID_PARAM2 in bench.results()
    assert bench.upload(TOUR) == ACCEPTED


def test_silence_from_an_item_on_and_back(make: Make) -> None:
    bench = make(faults=["silent@1=30"])
    listed = bench.listed(TOUR)
    bench.count(len(listed))
    bench.item(0, listed[0])
    said = len(bench.all)
    bench.item(1, listed[1])
    bench.pass_time(29.0)
    assert len(bench.all) == said
    bench.pass_time(12.0)
    assert bench.upload(TOUR) == ACCEPTED


def test_a_reboot_in_the_middle_of_an_upload(make: Make) -> None:
    bench = make(faults=["reboot-upload@3"])
    bench.upload(TOUR[:4])
    bench.pass_time(2.0)
    held = bench.held()
    assert held == bench.kept([] if bench.vehicle.autopilot.behaviour.atomic else TOUR[: 3 - bench.first])
    assert bench.upload(TOUR) == ACCEPTED
    assert bench.last("MISSION_ACK").target_system == STATION.system


def test_items_marked_as_current(make: Make) -> None:
    bench = make()
    listed = bench.listed([delay(1.0), delay(2.0), delay(3.0)])
    bench.count(len(listed))
    for number, item in enumerate(listed):
        bench.say(item_message(number, item, current=int(number == 1 + bench.first)))
    marked = 0 if bench.vehicle.autopilot.behaviour.restarts_item else 1
    assert bench.vehicle.auto.current == marked
