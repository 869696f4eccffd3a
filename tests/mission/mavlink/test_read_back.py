"""Items that vehicles keep, and reports of differences."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stopgo.mission.mavlink.autopilots import AUTOPILOTS
from stopgo.mission.mavlink.autopilots.ardupilot import keeps as ardupilot_keeps
from stopgo.mission.mavlink.autopilots.px4 import keeps as px4_keeps
from stopgo.mission.mavlink.items import NAN, Command, Item, MavFrame
from stopgo.mission.mavlink.read_back import differences, upload_of
from stopgo.mission.mavlink.translate import translate
from tests.mission.mavlink.worlds import NAMES, corner_tour, first_scan, narrow_view, read_back
from tests.mission.worlds import square_tour


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mission", [square_tour(), corner_tour()], ids=["square", "corner"])
def test_a_vehicle_that_keeps_its_word_has_no_differences(name, mission):
    sent = translate(mission, name)
    assert differences(sent, read_back(sent)) == ()


def test_the_handshake_is_kept_as_predicted():
    sent = translate(square_tour(), scan_wait="script_time")
    assert differences(sent, read_back(sent)) == ()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("field", ["command", "frame", "params", "x", "y", "z", "autocontinue"])
def test_a_changed_field_is_found_and_named(name, field):
    sent = translate(square_tour(), name)
    read = read_back(sent)
    at = AUTOPILOTS[name].sequence(1)
    read[at] = one_changed(read[at], field)
    lines = differences(sent, read)
    assert lines
    assert all(line.startswith(f"item {at} (stop of S1): ") for line in lines)
    assert field.removesuffix("s") in lines[0]


def one_changed(item: Item, field: str) -> Item:
    """The item with another value in one field, or in all its params."""
    was = getattr(item, field)
    if isinstance(was, tuple):
        return replace(item, params=tuple(value + 1 for value in was))
    return replace(item, **{field: not was if isinstance(was, bool) else was + 1})


@pytest.mark.parametrize("name", NAMES)
def test_a_lost_item_is_reported_by_count(name):
    sent = translate(square_tour(), name)
    assert differences(sent, read_back(sent)[:-1]) == ("the vehicle holds 9 items, 10 were sent",)


def test_the_line_reports_sent_predicted_and_read():
    sent = translate(square_tour())
    read = read_back(sent)
    read[2] = replace(read[2], x=515_000_007)
    assert differences(sent, read) == (
        "item 2 (stop of S1): x sent 515000000, expected back 515000000, is 515000007",
    )


def test_the_frame_of_an_item_without_a_place_means_nothing():
    """ArduPilot 4.7-dev gives it back as MISSION, 4.8-dev as GLOBAL."""
    sent = translate(square_tour())
    newer = [
        replace(item, frame=MavFrame.GLOBAL) if item.frame == MavFrame.MISSION else item
        for item in read_back(sent)
    ]
    assert newer != read_back(sent)
    assert differences(sent, newer) == ()
    relative = [replace(item, frame=MavFrame.GLOBAL_RELATIVE_ALT) for item in newer]
    assert "frame sent 2, expected back 2, is 3" in differences(sent, relative)[0]


def test_another_kind_of_vehicle_keeps_other_things():
    sent = translate(narrow_view(), "generic")
    kept = [AUTOPILOTS["px4"].kept(item) for item in sent.items]
    assert differences(sent, kept, AUTOPILOTS["px4"]) == ()
    dropped = [ardupilot_keeps(item) for item in sent.items]
    assert "param2 sent 0.05, expected back 0.05" in differences(sent, dropped, AUTOPILOTS["px4"])[1]


def test_a_second_in_a_day_is_a_difference():
    sent = translate(first_scan(square_tour(), duration_s=86_400.0, timeout_s=90_000.0))
    read = read_back(sent)
    read[5] = replace(read[5], params=(86_401.0, -1.0, -1.0, -1.0))
    assert len(differences(sent, read)) == 1


def test_home_is_put_in_front_for_ardupilot_only():
    assert len(upload_of(translate(square_tour()))) == 11
    assert upload_of(translate(square_tour()))[0].x == 515_000_000
    assert len(upload_of(translate(square_tour(), "px4"))) == 10


def waypoint(*params: float, frame: int = MavFrame.GLOBAL_RELATIVE_ALT_INT, z: float = 0.0) -> Item:
    """A waypoint somewhere."""
    one, two, three, four = params
    return Item(Command.NAV_WAYPOINT, frame, (one, two, three, four), x=473_977_000, y=85_456_000, z=z)


@pytest.mark.parametrize(
    ("sent", "kept"), [(2.9, 2.0), (100_000.0, 34_464.0), (0.0, 0.0), (65_535.0, 65_535.0)]
)
def test_ardupilot_holds_whole_seconds_in_sixteen_bits(sent, kept):
    assert ardupilot_keeps(waypoint(sent, 0.5, 0.0, 90.0)).params == (kept, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(("sent", "kept"), [(0, 0), (2, 0), (3, 3), (5, 0), (6, 3), (10, 10), (11, 10)])
def test_ardupilot_maps_frames(sent, kept):
    assert ardupilot_keeps(waypoint(0, 0, 0, 0, frame=sent)).frame == kept


@pytest.mark.parametrize(
    ("sent", "kept"), [(1.239, 1.23), (-1.239, -1.23), (0.0, 0.0), (488.0, 488.0), (3.4e37, 3.4e37)]
)
def test_ardupilot_keeps_whole_centimetres(sent, kept):
    assert ardupilot_keeps(waypoint(0, 0, 0, 0, z=sent)).z == pytest.approx(kept, rel=1e-6)


def test_ardupilot_keeps_script_messages_and_times_in_their_types():
    message = Item(Command.DO_SEND_SCRIPT_MESSAGE, MavFrame.MISSION, (100.7, 0.1, 1e7, -3.5), x=5, z=1.0)
    assert ardupilot_keeps(message).params == (100.0, pytest.approx(0.1, rel=1e-7), 1e7, -3.5)
    assert (ardupilot_keeps(message).x, ardupilot_keeps(message).z) == (0, 0.0)
    wait = Item(Command.NAV_SCRIPT_TIME, MavFrame.MISSION, (1.0, 300.0, 0.1, 0.0), x=40_000)
    assert ardupilot_keeps(wait).params == (1.0, 44.0, 0.0999755859375, 0.0)
    assert ardupilot_keeps(wait).x == 40_000 - 65_536


@pytest.mark.parametrize(
    ("command", "sent", "kept"),
    [
        (Command.DO_CHANGE_SPEED, (257.0, 0.5, -1.0, 9.0), (1.0, 0.5, -1.0, 0.0)),
        (Command.NAV_DELAY, (2.5, -1.9, 130.0, 7.0), (2.5, -1.0, -126.0, 7.0)),
        (Command.IMAGE_START_CAPTURE, (1.5, 2.5, 3.5, 65_537.0), (1.0, 2.0, 3.0, 1.0)),
        (Command.DO_SET_SERVO, (9.0, 1500.5, 1.0, 1.0), (9.0, 1500.0, 0.0, 0.0)),
        (Command.DO_SET_RELAY, (1.0, 1.0, 1.0, 1.0), (1.0, 1.0, 0.0, 0.0)),
    ],
)
def test_ardupilot_keeps_commands_in_their_types(command, sent, kept):
    assert ardupilot_keeps(Item(command, MavFrame.MISSION, sent)).params == kept


def test_ardupilot_always_goes_on():
    assert ardupilot_keeps(replace(waypoint(0, 0, 0, 0), autocontinue=False)).autocontinue


@pytest.mark.parametrize(("sent", "kept"), [(90.0, 90.0), (-90.0, 270.0), (360.0, 0.0), (NAN, NAN)])
def test_px4_keeps_yaw_within_a_turn(sent, kept):
    assert px4_keeps(waypoint(2.5, 0.05, 7.0, sent)).params == (
        2.5,
        pytest.approx(0.05, rel=1e-7),
        0.0,
        pytest.approx(kept, nan_ok=True),
    )


@given(
    name=st.sampled_from(NAMES),
    command=st.sampled_from([16, 93, 178, 181, 183, 217, 2000, 42702, 20, 206]),
    frame=st.sampled_from([0, 2, 3, 5, 6, 10, 11]),
    params=st.tuples(*[st.floats(width=32, allow_infinity=False)] * 4),
    x=st.integers(-(2**31), 2**31 - 1),
    z=st.floats(-1000, 1000),
)
def test_what_was_kept_is_kept_again(name, command, frame, params, x, z):
    keep = AUTOPILOTS[name].kept
    once = keep(Item(command, frame, params, x=x, z=z))
    twice = keep(once)
    assert (twice.command, twice.frame, twice.x, twice.y) == (once.command, once.frame, once.x, once.y)
    assert abs(twice.z - once.z) <= 0.0101  # the vehicle too truncates 1.23 to 1.22 when it is sent again
    for one, other in zip(once.params, twice.params, strict=True):
        assert one == other or (math.isnan(one) and math.isnan(other))
