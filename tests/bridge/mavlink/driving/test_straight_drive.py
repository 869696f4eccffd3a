"""Steering along one straight of a leg, and its end, by numbers that can be checked on paper."""

from __future__ import annotations

import math
from typing import Any

import pytest

from stopgo.bridge.mavlink.driving.straight_drive import CREEP_M_S, Ability, Patience, StraightDrive
from stopgo.mission.run.events import Pose

ABILITY = Ability(near_m=0.03, over_m=0.35, speed=0.5, acceleration=0.5, gives_up_s=1.0, reverses=True)


def straight(*, reverses: bool = True) -> StraightDrive:
    """Four metres ahead; a vehicle is there within 3 cm, or for good within 35."""
    ability = Ability(**{**vars(ABILITY), "reverses": reverses})
    return StraightDrive((0.0, 0.0), (4.0, 0.0), 0.0, ability=ability, coast_s=0.4, patience=Patience())


def seen(
    drive: StraightDrive, at: float, x: float, y: float = 0.0, *, heading: float = 0.0, **how: Any
) -> str:
    moves = {"speed": 0.0, "still": False, **how}
    return drive.judge(Pose(x=x, y=y, heading=heading), now_s=at, **moves)


def standing(drive: StraightDrive, began: float, x: float, y: float = 0.0, **how: Any) -> str:
    """After it has stood there for half a second."""
    verdicts = [seen(drive, began + part / 10, x, y, still=True, **how) for part in range(6)]
    return verdicts[-1]


def test_it_turns_on_the_spot_before_it_drives() -> None:
    drive = straight()
    seen(drive, 0.0, 0.0, heading=math.pi / 2)
    assert (drive.steer.heading, drive.steer.speed) == (0.0, 0.0)
    seen(drive, 1.0, 0.0, heading=math.radians(2))
    assert drive.steer.speed == CREEP_M_S


def test_it_stops_where_it_will_have_rolled_to_the_end_and_has_arrived_standing_there() -> None:
    drive = straight()
    seen(drive, 0.0, 0.0)
    assert seen(drive, 8.0, 3.9, speed=0.2) == "going"
    assert not drive.steer.stand
    assert seen(drive, 8.1, 3.93, speed=0.2) == "going"
    assert drive.steer.stand
    assert standing(drive, 8.5, 3.99) == "arrived"


def test_how_far_it_rolls_on_is_learnt_at_each_stop() -> None:
    drive = straight()
    seen(drive, 0.0, 0.0)
    seen(drive, 8.0, 3.93, speed=0.2)
    standing(drive, 8.5, 4.0)
    assert drive.coast_s == pytest.approx((0.4 + 0.07 / 0.2) / 2)


def test_off_its_position_it_goes_again_backwards_if_that_is_nearer() -> None:
    drive = straight()
    seen(drive, 0.0, 0.0)
    seen(drive, 8.0, 4.0, speed=0.2)
    assert standing(drive, 8.5, 4.1) == "going"
    assert drive.steer.speed == -CREEP_M_S
    assert math.remainder(drive.steer.heading, math.tau) == pytest.approx(0.0, abs=1e-9)
    turned = straight(reverses=False)
    seen(turned, 0.0, 0.0)
    seen(turned, 8.0, 4.0, speed=0.2)
    standing(turned, 8.5, 4.1)
    seen(turned, 9.1, 4.1)
    assert abs(turned.steer.heading) == pytest.approx(math.pi)


def test_off_the_line_it_steers_back_to_it_and_slowly() -> None:
    drive = straight()
    seen(drive, 0.0, 0.0)
    for step in range(40):
        seen(drive, 1.0 + step / 10, 1.0, 0.0 if step < 39 else 0.2, speed=0.5)
    assert drive.steer.heading == pytest.approx(-math.atan(0.2 / 0.5))
    assert drive.steer.speed <= 0.15


def test_its_speed_is_such_that_it_stops_near_the_end_if_it_hears_no_more() -> None:
    """One that drives on for 1 s by itself, and rolls for 0.4 s, comes 0.2 m too far at most."""
    drive = straight()
    seen(drive, 0.0, 2.0)
    for left in (1.5, 1.0, 0.5, 0.3):
        for part in range(60):
            seen(drive, 10 * left + part / 10, 4.0 - left, speed=0.3)
        asked = drive.steer.speed
        assert asked * (1.0 + 0.2 + 0.4) + asked**2 / (2 * 0.5) <= left + 0.2 + 1e-9


def test_who_stands_though_commanded_to_drive_is_pushed_and_then_blocked() -> None:
    drive = straight()
    seen(drive, 0.0, 2.0)
    verdicts = [seen(drive, part / 10, 2.0) for part in range(1, 102)]
    assert drive.steer.speed > 2 * CREEP_M_S
    assert verdicts[-1] == "blocked"
    assert drive.why == "the vehicle stopped 2.00 m from its goal, and does not go on"


def test_a_vehicle_that_leaves_the_path_by_more_than_its_radius_is_stopped() -> None:
    drive = straight()
    assert seen(drive, 0.0, 2.0, 0.34) == "going"
    assert seen(drive, 0.1, 2.0, 0.36) == "blocked"
    assert drive.why == "the vehicle is 0.36 m off the path; drive it back there by hand"


def test_a_vehicle_that_circles_is_stopped_after_half_a_minute() -> None:
    drive = straight()
    seen(drive, 0.0, 2.0)
    verdicts = [seen(drive, part, 2.0, 0.1 * (part % 2), speed=0.3) for part in range(1, 31)]
    assert verdicts[-2:] == ["going", "blocked"]
    assert drive.why == "the vehicle moves without getting nearer than 2.00 m"


def test_what_interrupts_it_is_not_held_against_it() -> None:
    drive = straight()
    seen(drive, 0.0, 2.0)
    drive.paused(100.0)
    assert seen(drive, 100.1, 2.0) == "going"
