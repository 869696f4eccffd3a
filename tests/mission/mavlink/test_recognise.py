"""Items read as a way past scan stops."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.items import Command, Item, MavFrame
from stopgo.mission.mavlink.recognise import recognise, stops_of
from stopgo.mission.mavlink.recognised_tour import RecognisedTour, recognised_tour
from stopgo.mission.mavlink.translate import translate
from tests.mission.mavlink.worlds import NAMES, corner_tour, read_back
from tests.mission.worlds import mission_of, square_tour, stop

ORIGIN = SiteOrigin(lat=51.5, lon=7.5, alt=100.0, heading_deg=0.0)


def waypoint(steps_east: int, hold: float = 0.0) -> Item:
    """A waypoint so many steps of 1e-7 degrees (7 mm) east of the origin."""
    return Item(
        Command.NAV_WAYPOINT,
        MavFrame.GLOBAL_RELATIVE_ALT,
        (hold, 0, 0, 0),
        x=515_000_000,
        y=75_000_000 + steps_east,
    )


def wait(seconds: float) -> Item:
    return Item(Command.NAV_DELAY, MavFrame.MISSION, (seconds, -1.0, -1.0, -1.0))


def trigger(number: float) -> Item:
    return Item(Command.DO_SEND_SCRIPT_MESSAGE, MavFrame.MISSION, (100.0, number, 0.0, 0.0))


def round_in(*items: Item, plain_stops: bool = False) -> RecognisedTour:
    return recognised_tour(recognise(items, plain_stops=plain_stops), ORIGIN)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mission", [square_tour(), corner_tour()], ids=["square", "corner"])
def test_what_was_sent_is_recognised_from_the_vehicle(name, mission):
    sent = translate(mission, name)
    home = 1 if name == "ardupilot" else 0
    seen = recognise(read_back(sent)[home:], mission=mission)
    assert [(one.role, one.stop) for one in seen] == [(one.role, one.stop) for one in sent.placed]


@pytest.mark.parametrize("name", NAMES)
def test_stops_times_and_corners_come_back(name):
    sent = translate(corner_tour(), name)
    home = 1 if name == "ardupilot" else 0
    found = recognised_tour(recognise(read_back(sent)[home:]), ORIGIN, name)
    (visit,) = found.visits
    assert math.dist(visit.at, (4.0, 3.0)) <= 0.008
    assert (visit.settle_s, visit.scan_s, visit.number) == (2.0, 60.0, 1)
    assert [math.dist(visit.through[0], (4.0, 0.0)) <= 0.008, len(visit.through)] == [True, 1]
    assert [math.dist(a, b) <= 0.008 for a, b in zip(found.back, [(4, 0), (0, 0)], strict=True)] == [
        True,
        True,
    ]
    assert found.speed == 1.0


@pytest.mark.parametrize(("name", "heading"), [("ardupilot", None), ("px4", 0.0), ("generic", 0.0)])
def test_a_heading_comes_back_from_who_keeps_it(name, heading):
    sent = translate(square_tour(), name)
    home = 1 if name == "ardupilot" else 0
    found = recognised_tour(recognise(read_back(sent)[home:]), ORIGIN, name)
    north = None if heading is None else math.pi / 2
    assert [visit.heading for visit in found.visits] == [pytest.approx(heading), pytest.approx(north)]


def test_a_wait_for_a_script_says_no_scan_time():
    sent = translate(square_tour(), scan_wait="script_time", trigger="none", settle="hold")
    (one, two) = recognised_tour(recognise(sent.items), ORIGIN).visits
    assert [(visit.settle_s, visit.scan_s, visit.number) for visit in (one, two)] == [
        (2.0, None, 1),
        (2.0, None, 2),
    ]


def test_items_are_given_to_the_missions_stops_by_number():
    mission = mission_of(
        stop("S7", (0.0, 0.0), (1.0, 0.0)), stop("S12", (1.0, 0.0), (1.0, 2.0), (2.0, 2.0)),
        back=((2.0, 2.0), (0.0, 0.0)),
    )  # fmt: skip
    sent = translate(mission)
    assert stops_of(sent.items, mission) == (None, *["S7"] * 4, *["S12"] * 5, None)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("trigger", ["auto", "none"])
@pytest.mark.parametrize("settle", ["delay", "hold"])
def test_every_manner_of_writing_is_recognised(name, trigger, settle):
    mission = corner_tour()
    sent = translate(mission, name, trigger=trigger, settle=settle)
    seen = recognise(sent.items, mission=mission)
    assert [(one.role, one.stop) for one in seen] == [(one.role, one.stop) for one in sent.placed]
    (visit,) = recognised_tour(seen, ORIGIN, name).visits
    assert (visit.settle_s, visit.scan_s) == (2.0, 60.0)


def test_without_triggers_the_missions_stops_are_reported_by_their_order():
    mission = mission_of(stop("S7", (0.0, 0.0), (1.0, 0.0)), stop("S12", (1.0, 0.0), (2.0, 0.0)))
    sent = translate(mission, trigger="none")
    assert stops_of(sent.items, mission) == (None, *["S7"] * 3, *["S12"] * 3)


def test_ids_without_numbers_are_carried_by_place():
    mission = mission_of(stop("lobby", (0.0, 0.0), (1.0, 0.0)), stop("hall", (1.0, 0.0), (2.0, 0.0)))
    sent = translate(mission)
    assert stops_of(sent.items, mission) == (None, *["lobby"] * 4, *["hall"] * 4)


def test_a_waypoint_that_holds_triggers_and_waits_is_a_stop():
    (visit,) = round_in(waypoint(100, hold=1.0), trigger(3), wait(30.0)).visits
    assert (visit.settle_s, visit.scan_s, visit.number) == (1.0, 30.0, 3)


def test_two_waits_are_settling_and_scanning_and_one_is_scanning():
    one, two = round_in(waypoint(0), wait(2.0), wait(60.0), waypoint(500, hold=3.0), wait(60.0)).visits
    assert (one.settle_s, one.scan_s) == (2.0, 60.0)
    assert (two.settle_s, two.scan_s) == (3.0, 60.0)


def test_a_waypoint_between_is_a_corner_and_one_after_leads_back():
    found = round_in(waypoint(100), waypoint(200), wait(60.0), waypoint(100, hold=1.0))
    assert (len(found.visits), len(found.visits[0].through), len(found.back)) == (1, 1, 1)


def test_where_nothing_waits_a_hold_is_the_scan():
    found = round_in(waypoint(100, hold=60.0), waypoint(200), waypoint(300, hold=60.0))
    assert [(visit.settle_s, visit.scan_s, len(visit.through)) for visit in found.visits] == [
        (0.0, 60.0, 0),
        (0.0, 60.0, 1),
    ]


def test_plain_waypoints_are_stops_only_when_so_said():
    with pytest.raises(InputError, match="the scan stops among the waypoints are unknown"):
        round_in(waypoint(100), waypoint(200))
    found = round_in(waypoint(100), waypoint(200), plain_stops=True)
    assert [visit.scan_s for visit in found.visits] == [None, None]


def test_a_trigger_that_nothing_waits_for_says_no_scan_time():
    (visit,) = round_in(waypoint(100), trigger(1)).visits
    assert visit.scan_s is None


def test_triggers_that_all_carry_the_same_number_carry_none():
    found = round_in(waypoint(0), trigger(0), wait(1.0), waypoint(500), trigger(0), wait(1.0))
    assert [visit.number for visit in found.visits] == [None, None]


def test_half_a_degree_is_fifty_kilometres_and_one_and_a_half_is_another_site():
    assert round_in(waypoint(5_000_000), wait(1.0)).visits[0].at[0] == pytest.approx(34_650, rel=1e-3)
    with pytest.raises(InputError, match=r"item 1: 51\.5.*104 km from the site's origin.*--origin"):
        round_in(waypoint(15_000_000), wait(1.0))
    with pytest.raises(InputError, match=r"item 0: "):
        recognised_tour(recognise([waypoint(15_000_000), wait(1.0)]), ORIGIN, first=0)


@pytest.mark.parametrize(
    ("items", "told"),
    [
        ([waypoint(0), Item(21, MavFrame.GLOBAL)], r"item 2: NAV_LAND \(21\) has no meaning"),
        ([waypoint(0), Item(31_010, MavFrame.MISSION)], r"item 2: command \(31010\) has no meaning"),
        ([replace(waypoint(0), frame=1)], r"item 1: NAV_WAYPOINT \(16\) is in frame 1; give latitude"),
        ([replace(waypoint(0), x=0, y=0)], r"item 1: NAV_WAYPOINT \(16\) is at 0, 0"),
        ([wait(1.0), waypoint(0)], r"item 1: waits or triggers come before the first waypoint"),
        ([waypoint(0), trigger(1), trigger(2), wait(1.0)], r"items 2 and 3 both trigger"),
        ([], r"the scan stops among the waypoints"),
    ],
)
def test_what_has_no_meaning_is_refused_by_number_and_name(items, told):
    with pytest.raises(InputError, match=told):
        recognise(items)
