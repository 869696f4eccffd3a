"""How one straight of a leg ends, by numbers that can be checked on paper."""

from __future__ import annotations

from bridge.mavlink.driving.straight_drive import Patience, StraightDrive


def course() -> StraightDrive:
    """Four metres ahead; a vehicle is there within 5 cm, or for good within 35."""
    return StraightDrive((0.0, 0.0), (4.0, 0.0), 0.0, near_m=0.05, over_m=0.35, patience=Patience())


def judged(drive: StraightDrive, *seen: tuple[float, float, float, bool]) -> list[str]:
    """The verdicts on (time, x, y, still)."""
    return [drive.judge((x, y), still=still, now_s=at) for at, x, y, still in seen]


def test_to_have_arrived_is_to_stand_there() -> None:
    passing = [(8.0, 3.96, 0.0, False), (8.1, 4.04, 0.0, False)]
    standing = [(8.2, 4.02, 0.0, True), (8.6, 4.02, 0.0, True), (8.7, 4.02, 0.0, True)]
    assert judged(course(), *passing, *standing) == ["going"] * 4 + ["arrived"]


def test_standing_for_good_within_the_robots_radius_is_as_near_as_it_gets() -> None:
    drive = course()
    assert judged(drive, (8.0, 3.8, 0.0, True), (12.9, 3.8, 0.0, True), (13.0, 3.8, 0.0, True)) == [
        *("going", "going", "arrived")
    ]


def test_standing_for_good_farther_away_is_to_be_blocked() -> None:
    drive = course()
    assert judged(drive, (4.0, 2.0, 0.0, True), (8.9, 2.0, 0.0, True), (9.0, 2.0, 0.0, True)) == [
        *("going", "going", "blocked")
    ]
    assert drive.why == "the vehicle stands 2.00 m from where it was sent, and does not go on"


def test_a_pause_to_turn_at_the_beginning_is_no_block() -> None:
    drive = course()
    assert (
        judged(drive, (0.1, 0.0, 0.0, True), (4.0, 0.0, 0.0, True), (4.2, 0.1, 0.0, False)) == ["going"] * 3
    )


def test_a_vehicle_that_leaves_the_way_is_stopped() -> None:
    drive = course()
    assert judged(drive, (2.0, 1.0, 0.99, False), (2.1, 1.0, 1.01, False)) == ["going", "blocked"]
    assert drive.why == "the vehicle is 1.01 m beside the way"


def test_a_vehicle_that_circles_is_stopped_after_half_a_minute() -> None:
    drive = course()
    assert judged(drive, (4.0, 2.0, 0.0, False), (33.9, 2.0, 0.5, False), (34.0, 2.0, 0.0, False)) == [
        *("going", "going", "blocked")
    ]
    assert drive.why == "the vehicle moves without getting nearer than 2.00 m"
