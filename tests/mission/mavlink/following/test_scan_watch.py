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
        made.take_item(LISTED, place, same=place == last)
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


def test_another_attempt_is_watched_anew() -> None:
    moved = watched((S1.scan, 1.0), (S1.scan, 1.0), (S1.scan, 1.2), (S1.at, 1.2), (S1.scan, 1.0))
    assert moved.why(LISTED, "S1") == ""
