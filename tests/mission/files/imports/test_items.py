"""Imports of waypoints, delays and triggers, and refusals."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.files.imports import qgc_plan, qgc_waypoints
from stopgo.mission.files.imports.track import ImportedRoute, ImportOptions
from stopgo.mission.frames.transform import SiteOrigin
from tests.mission.files.imports.worlds import CAPTURE, SPEED, Row, command, delay, plan, waypoint, waypoints

Write = Callable[..., bytes]
BOTH = pytest.mark.parametrize(("write", "read"), [(plan, qgc_plan.read), (waypoints, qgc_waypoints.read)])


def track(*rows: Row, firmware: int = 3, **root: object) -> ImportedRoute:
    return qgc_plan.read(plan(*rows, firmware=firmware, **root), "site.plan", ImportOptions())


@BOTH
def test_a_waypoint_with_a_trigger_is_a_stop_and_others_are_corners(write: Write, read: Callable) -> None:
    rows = (SPEED, waypoint(1), waypoint(2, hold=1), delay(2.5), CAPTURE, delay(60), waypoint(3))
    made = read(write(*rows), "site", ImportOptions())
    (visit,) = made.visits
    assert visit.xy == pytest.approx((0.0, 20.0), abs=0.05)
    assert [y for _, y in visit.via] == pytest.approx([10.0], abs=0.05)
    assert [y for _, y in made.back] == pytest.approx([30.0], abs=0.1)
    assert (visit.id, visit.settle_s, visit.scan_s, made.speed) == ("s01", 2.5, 60.0, 0.8)
    assert (made.origin.lat, made.origin.heading_deg) == (47.3769, 0.0)


@BOTH
def test_holds_are_scans_where_nothing_is_triggered(write: Write, read: Callable) -> None:
    made = read(write(waypoint(1), waypoint(2, hold=45), waypoint(3, hold=30)), "site", ImportOptions())
    assert [visit.scan_s for visit in made.visits] == [45.0, 30.0]
    assert [visit.settle_s for visit in made.visits] == [None, None]
    assert len(made.visits[0].via) == 1


@pytest.mark.parametrize(
    ("rows", "settle", "scan"),
    [
        ((waypoint(hold=3), CAPTURE, delay(60)), 3.0, 60.0),
        ((waypoint(hold=1), delay(2), CAPTURE, delay(60)), 2.0, 60.0),
        ((waypoint(), delay(60)), 0.0, 60.0),
        ((waypoint(hold=4), delay(60)), 4.0, 60.0),
        ((waypoint(), delay(2), delay(60)), 2.0, 60.0),
        ((waypoint(hold=4), CAPTURE), 4.0, None),
        ((waypoint(hold=4), command(203, 0, 0, 0, 0, 1)), 4.0, None),
        ((waypoint(hold=4), command(217, 100, 7, 55, 110)), 4.0, 55.0),
        ((waypoint(hold=4), command(217, 3, 7, 55, 110)), 4.0, None),
        ((waypoint(hold=4), command(42702, 1, 120)), 4.0, None),
    ],
)
def test_waits_before_the_trigger_settle_and_those_after_it_scan(
    rows: tuple[Row, ...], settle: float | None, scan: float | None
) -> None:
    (visit,) = track(*rows).visits
    assert (visit.settle_s, visit.scan_s) == (settle, scan)


def test_the_numbers_that_triggers_carry_name_the_stops() -> None:
    rows = [
        row for number in (4, 2) for row in (waypoint(number), command(217, 100, number, 60, 120), delay(60))
    ]
    assert [visit.id for visit in track(*rows).visits] == ["s04", "s02"]
    same = [row for north in (1, 2) for row in (waypoint(north), command(217, 100, 5, 60, 120))]
    assert [visit.id for visit in track(*same).visits] == ["s01", "s02"]


def test_a_heading_counts_for_who_keeps_it() -> None:
    rows = (waypoint(hold=5, yaw=90.0), CAPTURE)
    assert track(*rows, firmware=12).visits[0].heading == pytest.approx(0.0)
    assert track(*rows, firmware=3).visits[0].heading is None
    assert track(waypoint(hold=5), CAPTURE, firmware=12).visits[0].heading is None


def test_degrees_are_read_by_the_autopilots_rule() -> None:
    far = (waypoint(50, hold=5),)
    ys = [track(*far, firmware=firmware).visits[0].xy[1] for firmware in (3, 12, 0)]
    assert len({round(y, 3) for y in ys}) == 3
    given = ImportOptions(autopilot="px4")
    assert qgc_plan.read(plan(*far), "p", given).visits[0].xy[1] == pytest.approx(ys[1])
    assert qgc_waypoints.read(waypoints(*far), "w", ImportOptions()).visits[0].xy[1] == pytest.approx(ys[0])


def test_an_origin_given_turns_the_site() -> None:
    east = SiteOrigin(lat=47.3769, lon=8.5417, alt=408.0, heading_deg=90.0)
    (visit,) = qgc_plan.read(plan(waypoint(1, hold=5)), "p", ImportOptions(east)).visits
    assert visit.xy == pytest.approx((-10.0, 0.0), abs=0.05)


def test_what_a_plan_has_besides_items_is_reported() -> None:
    fence = {"circles": [], "polygons": [{"path": []}], "version": 2}
    rally = {"points": [[47.0, 8.0, 0]], "version": 2}
    notes = track(waypoint(hold=5), geoFence=fence, rallyPoints=rally).notes
    assert ["geofence" in notes[-2], "rally points" in notes[-1]] == [True, True]


REFUSED: dict[str, tuple[tuple[Row, ...], str]] = {
    "takeoff": ((command(22, 15), waypoint(hold=5)), r"item 1 \(NAV_TAKEOFF 22\) is nothing that a scanning"),
    "home": ((waypoint(hold=5), command(20)), r"item 2 \(NAV_RETURN_TO_LAUNCH 20\).*draw it as waypoints"),
    "jump": ((waypoint(hold=5), command(177, 1, 2)), r"item 2 \(DO_JUMP 177\)"),
    "unheard of": ((waypoint(hold=5), command(4711)), r"item 2 \(command 4711\)"),
    "speed on the way": (
        (waypoint(hold=5), SPEED),
        r"item 2 \(DO_CHANGE_SPEED 178\) changes the speed during",
    ),
    "speed of nothing": ((command(178, 1, -1), waypoint(hold=5)), r"item 1 .* sets speed -1"),
    "trigger at no place": ((CAPTURE, waypoint(hold=5)), "before the first waypoint"),
    "two triggers": ((waypoint(hold=5), CAPTURE, delay(3), CAPTURE), "a stop has one scan"),
    "many pictures": ((waypoint(), command(2000, 0, 2, 5)), r"item 2 .* takes 5 pictures"),
    "time of day": ((waypoint(), delay(-1, 12, 0, 0)), r"item 2 \(NAV_DELAY 93\) waits for a time of day"),
    "no delay": ((waypoint(), delay(math.inf)), "waits inf s|not JSON|neither number"),
    "pause at a corner": (
        (waypoint(1, hold=30), waypoint(2), CAPTURE),
        r"item 1 .* waits 30 s and scans",
    ),
    "nothing to scan": ((waypoint(1), waypoint(2)), "the scan stops among the waypoints are unknown"),
    "nothing": ((), "the scan stops among"),
    "local frame": (((16, 1, (5, 0, 0, 0, 1.0, 2.0, 0)),), "item 1 .* is in frame 1"),
    "no place": (((16, 3, (5, 0, 0, 0, 0.0, 0.0, 0)),), "item 1 .* which is no position"),
    "beyond the pole": (((16, 3, (5, 0, 0, 0, 91.0, 8.0, 0)),), "item 1 .* which is no position"),
    "place unsaid": (((16, 3, (5, 0, 0, 0, None, None, 0)),), "item 1 .* which is no position"),
    "another town": ((waypoint(5000, hold=5),), "item 1 .* is 50 km from the site's origin"),
    "another continent": ((waypoint(-500_000, hold=5),), "km from the site's origin"),
}


@pytest.mark.parametrize("case", REFUSED)
@BOTH
def test_what_means_something_else_is_refused_by_item(case: str, write: Write, read: Callable) -> None:
    rows, words = REFUSED[case]
    with pytest.raises(InputError, match=words) as refusal:
        read(write(*rows), "site.file", ImportOptions())
    assert str(refusal.value).startswith("site.file: ")
    assert "\n" not in str(refusal.value)
