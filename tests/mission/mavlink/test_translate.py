"""Missions as items: what every autopilot is promised, and what each gets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE, Geodetic, from_geodetic
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots import AUTOPILOTS
from stopgo.mission.mavlink.items import Command, Item, MavFrame
from stopgo.mission.mavlink.translate import translate
from tests.mission.mavlink.worlds import (
    NAMES,
    changed,
    corner_tour,
    first_scan,
    first_stop,
    narrow_view,
)
from tests.mission.worlds import mission_of, square_tour, stop

WAITS = (Command.NAV_DELAY, Command.NAV_SCRIPT_TIME)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mission", [square_tour(), corner_tour()], ids=["square", "corner"])
def test_every_stop_is_driven_to_settled_at_triggered_and_waited_for(name, mission):
    items = translate(mission, name)
    for wanted in mission.stops:
        own = [placed for placed in items.placed if placed.stop == wanted.id and placed.role != "corner"]
        assert [placed.role for placed in own] == ["stop", "settle", "trigger", "scan"]
        assert own[1].item.params[0] == wanted.settle_s
        assert own[3].item.params[0] == wanted.scan.duration_s


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mission", [square_tour(), corner_tour()], ids=["square", "corner"])
def test_a_trigger_fires_only_between_two_waits(name, mission):
    items = translate(mission, name).items
    for index, item in enumerate(items):
        if item.command in (Command.DO_SEND_SCRIPT_MESSAGE, Command.IMAGE_START_CAPTURE):
            assert items[index - 1].command in WAITS
            assert items[index + 1].command in WAITS


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("settle", ["delay", "hold"])
def test_driven_by_the_rules_every_scan_begins_settled_and_ends_in_place(name, settle):
    for fired in scans_of(translate(corner_tour(), name, settle=settle).items):
        assert fired.stood_s >= 2.0
        assert fired.stands_s == 60.0


@dataclass
class Fired:
    """A trigger: seconds the robot had stood when it fired, and stands from then on."""

    stood_s: float
    stands_s: float = 0.0


def scans_of(items: Sequence[Item]) -> list[Fired]:
    """Scans of a vehicle that runs commands other than NAV as the next NAV command starts."""
    fired: list[Fired] = []
    waiting, stood = 0, 0.0
    for item in items:
        if item.command in (Command.DO_SEND_SCRIPT_MESSAGE, Command.IMAGE_START_CAPTURE):
            waiting += 1
            continue
        if item.command not in (*WAITS, Command.NAV_WAYPOINT):
            continue
        moves = item.command == Command.NAV_WAYPOINT
        fired += [Fired(-1.0 if moves else stood) for _ in range(waiting)]
        waiting, stood = 0, item.params[0] if moves else stood + item.params[0]
        if fired and not moves:
            fired[-1].stands_s += item.params[0]
    return fired


@pytest.mark.parametrize("name", NAMES)
def test_only_commands_that_the_autopilot_takes_are_sent(name):
    items = translate(corner_tour(), name).items
    assert {item.command for item in items} <= AUTOPILOTS[name].commands
    for item in items:
        place = item.command == Command.NAV_WAYPOINT
        assert item.frame == (MavFrame.GLOBAL_RELATIVE_ALT_INT if place else MavFrame.MISSION)


@pytest.mark.parametrize("name", NAMES)
def test_only_the_real_corner_is_a_waypoint(name):
    roles = [placed.role for placed in translate(corner_tour(), name).placed]
    assert roles == ["speed", "corner", "stop", "settle", "trigger", "scan", "return", "return"]


@pytest.mark.parametrize("name", NAMES)
def test_a_finer_limit_keeps_the_bend(name):
    bent = changed(corner_tour(), return_=((4.0, 3.0), (4.0, 1.5), (4.03, 0.0)))
    for limit, corners, back in ((0.02, 1, 1), (0.006, 2, 2)):
        roles = [placed.role for placed in translate(bent, name, max_lateral_m=limit).placed]
        assert (roles.count("corner"), roles.count("return")) == (corners, back)


@pytest.mark.parametrize("name", NAMES)
def test_a_repeated_point_is_sent_once(name):
    mission = mission_of(
        stop("S1", (0.0, 0.0), (4.0, 0.0), (4.0, 0.0), (4.0, 3.0)), back=((4.0, 3.0), (4.0, 3.0))
    )
    places = [item for item in translate(mission, name).items if item.command == Command.NAV_WAYPOINT]
    assert len(places) == 2


@pytest.mark.parametrize("name", NAMES)
def test_two_stops_in_one_place_are_both_driven_to(name):
    mission = mission_of(stop("S1", (0.0, 0.0), (4.0, 0.0)), stop("S2", (4.0, 0.0)), back=((4.0, 0.0),))
    roles = [placed.role for placed in translate(mission, name).placed]
    assert roles.count("stop") == 2
    assert roles.count("return") == 0


@pytest.mark.parametrize("name", NAMES)
def test_where_nothing_is_to_settle_no_wait_stands_before_the_trigger(name):
    roles = [placed.role for placed in translate(first_stop(square_tour(), settle_s=0.0), name).placed]
    assert roles[:5] == ["speed", "stop", "trigger", "scan", "stop"]


def test_four_metres_east_by_ardupilots_scale():
    item = translate(square_tour()).items[1]
    step = 0.011131884502145034
    assert item.x == 515_000_000
    assert item.y == 75_000_000 + round(4 / (step * math.cos(math.radians(51.5))))


def test_ardupilot_gets_the_command_to_stop_at_every_waypoint_and_nothing_that_it_drops():
    for item in translate(corner_tour()).items:
        if item.command == Command.NAV_WAYPOINT:
            assert item.params == (1.0, 0.0, 0.0, 0.0)


def test_px4_gets_the_tolerance_and_the_bearing():
    east, north = (placed.item for placed in translate(square_tour(), "px4").placed if placed.role == "stop")
    assert east.params == (0.0, 0.05, 0.0, 90.0)
    assert north.params == (0.0, 0.05, 0.0, 0.0)


@pytest.mark.parametrize("name", ["px4", "generic"])
def test_a_corner_has_a_radius_for_who_would_take_ten_metres(name):
    placed = translate(corner_tour(), name).placed
    corners = [one.item for one in placed if one.role in ("corner", "return")]
    assert len(corners) == 3
    for item in corners:
        assert item.params == (0.0, 0.05, 0.0, pytest.approx(math.nan, nan_ok=True))


def test_the_stops_number_goes_with_the_trigger():
    mission = mission_of(
        stop("S7", (0.0, 0.0), (1.0, 0.0)), stop("S12", (1.0, 0.0), (2.0, 0.0)), begin=(0.0, 0.0)
    )
    by_script = [p.item.params for p in translate(mission).placed if p.role == "trigger"]
    by_camera = [p.item.params for p in translate(mission, "px4").placed if p.role == "trigger"]
    assert by_script == [(100.0, 7.0, 60.0, 120.0), (100.0, 12.0, 60.0, 120.0)]
    assert by_camera == [(0.0, 0.0, 1.0, 7.0), (0.0, 0.0, 1.0, 12.0)]


def test_the_script_handshake_replaces_the_last_wait():
    items = translate(square_tour(), scan_wait="script_time")
    scans = [placed.item for placed in items.placed if placed.role == "scan"]
    assert [(item.command, item.params[:2], item.x) for item in scans] == [
        (Command.NAV_SCRIPT_TIME, (1.0, 120.0), 1),
        (Command.NAV_SCRIPT_TIME, (1.0, 120.0), 2),
    ]


@pytest.mark.parametrize(("timeout", "sent"), [(0.0, 1.0), (0.2, 1.0), (90.5, 91.0), (255.0, 255.0)])
def test_a_handshake_never_waits_shorter_or_for_ever(timeout, sent):
    mission = first_scan(square_tour(), duration_s=0.0, timeout_s=timeout)
    items = translate(mission, scan_wait="script_time").placed
    assert next(placed.item for placed in items if placed.role == "scan").params[1] == sent


def test_a_bearing_is_sent_to_a_hundredth_of_a_degree():
    mission = first_stop(square_tour(), heading=math.radians(33.337))
    assert translate(mission, "px4").items[1].params[3] == 56.66


def test_settling_by_hold_saves_an_item_per_stop():
    by_delay, by_hold = (translate(square_tour(), settle=how) for how in ("delay", "hold"))
    assert len(by_delay.items) - len(by_hold.items) == 2
    assert [placed.item.params[0] for placed in by_hold.placed if placed.role == "stop"] == [2.0, 2.0]


@pytest.mark.parametrize("name", NAMES)
def test_without_a_scan_time_a_wait_still_follows_the_trigger(name):
    items = translate(first_scan(square_tour(), duration_s=0.0), name).placed
    scan = next(placed.item for placed in items if placed.role == "scan")
    assert 0 < scan.params[0] <= 0.001


@pytest.mark.parametrize("name", NAMES)
def test_what_the_autopilot_cannot_do_is_noted(name):
    notes = translate(square_tour(), name).notes
    assert any("stops S1 to S2 (2): on_failure ask" in note for note in notes)
    assert any("tolerance_m" in note for note in notes)
    assert any("battery_min 0.15" in note for note in notes)


def test_what_nobody_asks_for_is_not_noted():
    mission = first_stop(square_tour(), on_failure="retry", retries=0)
    notes = translate(changed(mission, stops=mission.stops[:1], return_=None)).notes
    assert not any("S1" in note for note in notes)
    retried = first_stop(square_tour(), on_failure="retry", retries=2)
    assert translate(retried).notes[0].startswith("stop S1: a failed scan is tried again only by the station")
    assert "no item starts a scan: the station does" in translate(square_tour(), trigger="none").notes
    free = changed(mission, policy=changed(mission.policy, own_way=True))
    assert translate(free).notes[-1] == "own_way is not sent: the vehicle drives the legs"


@pytest.mark.parametrize("name", NAMES)
def test_without_a_georeference_nothing_is_written(name):
    with pytest.raises(InputError, match=r"no georeference.*--origin"):
        translate(changed(square_tour(), georeference=None), name)


@pytest.mark.parametrize(("name", "why"), [("ardupilot", "drops it"), ("px4", "turns no rover to it")])
def test_who_does_not_turn_to_a_heading_refuses_a_scanner_that_needs_it(name, why):
    with pytest.raises(NegativeResult, match=rf"stop S1: heading 0\.0°.*fov_deg is 90.*{why}.*--fov 360"):
        translate(narrow_view(), name)


def test_who_turns_to_a_heading_gets_it_with_a_note():
    assert any(note.startswith("headings are sent") for note in translate(narrow_view(), "generic").notes)


@pytest.mark.parametrize(("name", "within"), [("ardupilot", "WP_RADIUS"), ("px4", "NAV_ACC_RAD, 10 m")])
def test_what_counts_as_reached_is_noted_by_parameter(name, within):
    assert any(within in note for note in translate(square_tour(), name).notes)


@pytest.mark.parametrize(
    ("mission", "told"),
    [
        (first_stop(square_tour(), settle_s=math.nan), r"stops\[0\]\.settle_s: is nan"),
        (first_stop(square_tour(), x=math.inf), r"stops\[0\]: \(inf, 0\)"),
        (first_scan(square_tour(), duration_s=math.inf), r"duration_s: is inf"),
        (
            changed(square_tour(), georeference=SiteOrigin(lat=math.nan, lon=0.0, alt=0.0, heading_deg=0.0)),
            r"georeference\.lat is nan",
        ),
        (
            changed(square_tour(), georeference=SiteOrigin(lat=89.5, lon=0.0, alt=0.0, heading_deg=0.0)),
            r"georeference\.lat is 89\.5.*--origin",
        ),
        (
            changed(square_tour(), georeference=SiteOrigin(lat=9.5, lon=181.0, alt=0.0, heading_deg=0.0)),
            r"lon 181\.0 is not a position on Earth",
        ),
        (
            changed(square_tour(), georeference=SiteOrigin(lat=9.5, lon=8.0, alt=1e6, heading_deg=0.0)),
            r"georeference: alt is 1e\+06; it must be within ±10000 m",
        ),
    ],
)
def test_what_is_no_number_or_no_place_is_refused_by_name(mission, told):
    for name in NAMES:
        with pytest.raises(InputError, match=told):
            translate(mission, name)


@pytest.mark.parametrize("name", NAMES)
def test_a_wait_that_the_vehicle_cannot_count_is_refused(name):
    with pytest.raises(NegativeResult, match=r"stop S1: settle_s is 5e\+06.*4294967 s"):
        translate(first_stop(square_tour(), settle_s=5e6), name)


def test_a_handshake_longer_than_its_field_is_refused():
    with pytest.raises(NegativeResult, match=r"stop S1: scan\.timeout_s is 256.*255 s"):
        translate(first_scan(square_tour(), timeout_s=256.0), scan_wait="script_time")


def test_a_handshake_has_no_room_for_numbers_above_an_int16():
    mission = mission_of(stop("S32768", (0.0, 0.0), (1.0, 0.0)))
    with pytest.raises(NegativeResult, match=r"stop S32768: number 32768 is above the 32767"):
        translate(first_scan(mission, timeout_s=100.0), scan_wait="script_time")


def test_a_hold_that_would_run_as_none_is_refused():
    with pytest.raises(NegativeResult, match=r"stop S1: settle_s is 32768, a hold"):
        translate(first_stop(square_tour(), settle_s=32_768.0), settle="hold")


def test_a_fractional_hold_is_refused_and_a_fractional_delay_is_exact():
    mission = first_stop(square_tour(), settle_s=2.5)
    with pytest.raises(NegativeResult, match=r"stop S1: settle_s is 2\.5, a hold is whole seconds"):
        translate(mission, settle="hold")
    assert translate(mission).items[2].params[0] == 2.5


@pytest.mark.parametrize(
    ("name", "mission", "told"),
    [
        (
            "ardupilot",
            first_scan(square_tour(), timeout_s=1e39),
            r"stop S1: param4 of DO_SEND_SCRIPT",
        ),
        ("px4", first_stop(square_tour(), tolerance_m=1e39), r"stop S1: param2 of NAV_WAYPOINT"),
    ],
)
def test_what_a_float32_does_not_hold_is_refused(name, mission, told):
    with pytest.raises(InputError, match=told):
        translate(mission, name)


@pytest.mark.parametrize(("name", "most"), [("ardupilot", 163), ("px4", 124)])
def test_four_items_per_stop_fill_a_vehicle(name, most):
    """Home, the speed and 163 × 4 are 654 of 655; the speed and 124 × 4 are 497 of 500."""
    legs = [((float(x), 0.0), (float(x + 1), 0.0)) for x in range(most + 1)]
    stops = [stop(f"S{number}", *leg) for number, leg in enumerate(legs, 1)]
    translate(mission_of(*stops[:-1]), name)
    with pytest.raises(NegativeResult, match=rf"{most + 1} stops make .* items, {name} holds"):
        translate(mission_of(*stops), name)


def test_more_items_than_the_vehicle_holds_are_refused():
    assert len(translate(square_tour(), max_items=11).items) == 10  # and home
    with pytest.raises(NegativeResult, match=r"2 stops make 11 items, .* holds 10; --settle-item hold"):
        translate(square_tour(), max_items=10)


@pytest.mark.parametrize(("most", "said"), [(9, "9, which is enough; or"), (8, "9, which is not enough")])
def test_too_many_items_say_whether_settling_by_hold_is_enough(most, said):
    with pytest.raises(NegativeResult, match=said):
        translate(square_tour(), max_items=most)
    if most == 9:
        assert len(translate(square_tour(), settle="hold", max_items=most).items) == 8  # and home
    else:
        with pytest.raises(NegativeResult, match="make 9 items, ardupilot holds 8; plan fewer"):
            translate(square_tour(), settle="hold", max_items=most)


@pytest.mark.parametrize(
    ("how", "told"),
    [
        ({"autopilot": "betaflight"}, "betaflight"),
        ({"autopilot": "px4", "trigger": "script"}, "px4 has no trigger 'script'"),
        ({"autopilot": "px4", "scan_wait": "script_time"}, "px4 has no NAV_SCRIPT_TIME"),
        ({"max_lateral_m": math.nan}, "max_lateral_m is nan"),
    ],
)
def test_what_cannot_be_chosen_is_said(how, told):
    with pytest.raises(InputError, match=told):
        translate(square_tour(), **how)


@given(
    name=st.sampled_from(NAMES),
    lat=st.floats(-85, 85),
    lon=st.floats(-180, 180),
    heading=st.floats(-360, 360),
    x=st.floats(-3500, 3500),
    y=st.floats(-3500, 3500),
)
def test_a_stop_within_5_km_is_sent_to_8_mm(name, lat, lon, heading, x, y):
    origin = SiteOrigin(lat=lat, lon=lon, alt=0.0, heading_deg=heading)
    mission = changed(mission_of(stop("S1", (0.0, 0.0), (x, y))), georeference=origin)
    item = next(placed.item for placed in translate(mission, name).placed if placed.role == "stop")
    sent = Geodetic(lat=item.x / STEPS_PER_DEGREE, lon=item.y / STEPS_PER_DEGREE)
    assert math.dist(from_geodetic(origin, sent, AUTOPILOTS[name].rule), (x, y)) <= 0.008
