"""Motion during a scan in AUTO: only poses that are surely of the scan count."""

from __future__ import annotations

from stopgo.mission.mavlink.following.listed_mission import ListedMission, listed_mission
from stopgo.mission.mavlink.following.scan_watch import ScanWatch
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Pose
from tests.mission.mavlink.following.worlds import tour

MISSION = tour(tolerance_m=0.05)
LISTED: ListedMission = listed_mission(MISSION, translate(MISSION, "ardupilot"))
S1, S2 = LISTED.stops[:2]


def watched(*places: tuple[int, float]) -> ScanWatch:
    """A vehicle at these items, each with the x of the pose before its report."""
    made, last = ScanWatch(), -1
    for place, x in places:
        made.take_pose(Pose(x=x, y=0.0, heading=0.0), 0.0)
        made.take_item(LISTED, place, 0, same=place == last)
        last = place
    return made


def test_a_pose_off_the_first_one_during_the_scan_is_a_motion() -> None:
    moved = watched((S1.scan, 0.5), (S1.scan, 1.0), (S1.scan, 1.2))
    assert moved.why(LISTED, "S1") == "the vehicle moved 0.20 m during the scan"
    assert moved.why(LISTED, "S2") == ""


def test_a_vehicle_that_arrives_or_leaves_has_not_moved_during_its_scan() -> None:
    assert watched((S1.at, 0.2), (S1.scan, 0.5), (S1.scan, 1.0), (S1.scan, 1.0)).why(LISTED, "S1") == ""
    assert watched((S1.scan, 1.0), (S1.scan, 1.0), (S2.first, 1.3)).why(LISTED, "S1") == ""


def test_a_motion_is_known_after_the_vehicle_has_left() -> None:
    moved = watched((S1.scan, 1.0), (S1.scan, 1.0), (S1.scan, 1.2), (S2.first, 1.2), (S2.first, 1.4))
    assert moved.why(LISTED, "S1") == "the vehicle moved 0.20 m during the scan"


def test_another_attempt_is_watched_again() -> None:
    moved = watched((S1.scan, 1.0), (S1.scan, 1.0), (S1.scan, 1.2), (S1.at, 1.2), (S1.scan, 1.0))
    assert moved.why(LISTED, "S1") == ""


def at(watch: ScanWatch, place: int, seconds: float) -> None:
    watch.take_item(LISTED, place, round(seconds * 1e9), same=False)


def test_a_report_near_the_end_of_a_scan_that_was_left_without_one_is_that_of_the_older_scan() -> None:
    """As after a jump from one stop's scan to the next stop: the scanner works on meanwhile."""
    s1, s2 = LISTED.stops[0], LISTED.stops[1]
    watch, wait_s = ScanWatch(), LISTED.wait_s(s1.scan, s1.after)
    at(watch, s1.scan, 10.0)
    at(watch, s2.at, 11.0)
    at(watch, s2.scan, 10.0 + 0.9 * wait_s)
    assert not watch.take_report(round((10.0 + wait_s) * 1e9))
    assert watch.take_report(round((10.0 + 1.9 * wait_s) * 1e9))


def test_another_attempt_does_not_take_the_report_of_the_one_that_was_broken_off() -> None:
    s1 = LISTED.stops[0]
    watch, wait_s = ScanWatch(), LISTED.wait_s(s1.scan, s1.after)
    at(watch, s1.scan, 10.0)
    at(watch, s1.at, 12.0)
    at(watch, s1.scan, 10.0 + 0.9 * wait_s)
    assert not watch.take_report(round((10.0 + wait_s) * 1e9))


def test_a_report_near_its_planned_end_is_that_of_the_present_scan() -> None:
    s1, s2 = LISTED.stops[0], LISTED.stops[1]
    watch, wait_s = ScanWatch(), LISTED.wait_s(s2.scan, s2.after)
    at(watch, s1.scan, 10.0)
    at(watch, s2.scan, 40.0)
    assert watch.take_report(round((40.0 + 0.9 * wait_s) * 1e9))


def test_a_report_from_before_the_trigger_is_none_of_the_stop() -> None:
    s1 = LISTED.stops[0]
    watch = ScanWatch()
    assert not watch.is_after_trigger(LISTED, s1.stop, 5 * 10**9)
    at(watch, s1.scan, 10.0)
    assert not watch.is_after_trigger(LISTED, s1.stop, 8 * 10**9)
    assert watch.is_after_trigger(LISTED, s1.stop, round(9.5e9))
    assert not watch.is_after_trigger(LISTED, LISTED.stops[1].stop, 11 * 10**9)
