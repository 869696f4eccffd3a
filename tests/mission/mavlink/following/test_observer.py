"""A vehicle's reports, and the observations made of them."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE, bearing_deg, to_geodetic
from stopgo.mission.mavlink.autopilots.ardupilot import ARDUPILOT
from stopgo.mission.mavlink.following.listed_mission import ListedMission, listed_mission
from stopgo.mission.mavlink.following.observer import Observer
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Arrived, Pose
from stopgo.mission.run.scans import ScanFailed, ScanResult
from stopgo.mission.run.states import Run
from tests.mission.mavlink.following.worlds import tour

UNKNOWN, ACTIVE, COMPLETE = 0, dialect.MISSION_STATE_ACTIVE, dialect.MISSION_STATE_COMPLETE
URL = b"scan-1.e57?size=1600&points=100&sha256=" + b"ab" * 32
AT_S1 = Run(state="RUNNING", run_id="r", at=0, stop_state="SCANNING")


class Telling:
    """An observer, and its messages."""

    def __init__(self) -> None:
        mission = tour()
        self.listed: ListedMission = listed_mission(mission, translate(mission, "ardupilot"))
        self.now_ns = 10**18
        self.observer = Observer(ARDUPILOT)
        self.site = self.listed.sent.origin
        self.tell(dialect.MAVLink_heartbeat_message(10, 3, 128, 10, 4, 3))

    def tell(self, *messages: Any) -> None:
        for message in messages:
            self.now_ns += 10**8
            self.observer.take(message, self.listed, self.now_ns)

    def current(self, seq: int, state: int = ACTIVE, total: int | None = None) -> None:
        held = self.listed.end if total is None else total
        self.tell(dialect.MAVLink_mission_current_message(seq, held, state, 1))

    def reached(self, seq: int) -> None:
        self.tell(dialect.MAVLink_mission_item_reached_message(seq))

    def origin(self) -> None:
        lat, lon = (round(angle * STEPS_PER_DEGREE) for angle in (self.site.lat, self.site.lon))
        self.tell(dialect.MAVLink_gps_global_origin_message(lat, lon, round(self.site.alt * 1000)))

    def captured(self, index: int, at: tuple[float, float], result: int = 1, url: bytes = URL) -> None:
        place = to_geodetic(self.site, at, "ardupilot")
        lat, lon = round(place.lat * STEPS_PER_DEGREE), round(place.lon * STEPS_PER_DEGREE)
        upright = (1.0, 0.0, 0.0, 0.0)
        self.tell(
            dialect.MAVLink_camera_image_captured_message(
                1000 * index, 0, 0, lat, lon, 0, 0, upright, index, result, url
            )
        )

    def scan(self, after: tuple[int, int] = (-1, -1)) -> ScanResult | ScanFailed | None:
        observed = self.observer.observe(AT_S1, self.listed, after=after)
        assert observed is not None
        return observed.scan


def test_a_mission_ends_by_its_state_or_by_its_last_item_where_there_is_none() -> None:
    telling = Telling()
    last = telling.listed.sequence(telling.listed.end - 1)
    telling.current(last, UNKNOWN)
    assert telling.observer.position.place(telling.listed) == telling.listed.end - 1
    telling.reached(last - 1)
    assert telling.observer.position.place(telling.listed) == telling.listed.end - 1
    telling.reached(last)
    assert telling.observer.position.place(telling.listed) == telling.listed.end
    telling.current(1, UNKNOWN)
    assert telling.observer.position.place(telling.listed) == 0
    telling.current(last, COMPLETE)
    assert telling.observer.position.place(telling.listed) == telling.listed.end


def test_local_metres_are_exact_and_degrees_a_step_off() -> None:
    telling = Telling()
    bearing = bearing_deg(telling.site, 0.0)
    place = to_geodetic(telling.site, (3.0, 4.0), "ardupilot")
    lat, lon = round(place.lat * STEPS_PER_DEGREE), round(place.lon * STEPS_PER_DEGREE)
    yaw = (bearing - 360.0 if bearing > 180 else bearing) / 57.29577951308232
    telling.tell(
        dialect.MAVLink_attitude_message(1, 0, 0, yaw, 0, 0, 0),
        dialect.MAVLink_global_position_int_message(1, lat, lon, 0, 0, 30, 40, 0, 0),
    )
    fix = telling.observer.poses.fix
    assert fix is not None and fix.speed == pytest.approx(0.5)
    assert (fix.pose.x, fix.pose.y) == pytest.approx((3.0, 4.0), abs=0.008)
    assert fix.pose.heading == pytest.approx(0.0, abs=1e-6)
    telling.origin()
    telling.tell(dialect.MAVLink_local_position_ned_message(2, 4.0, 3.0, 0, 0, 0, 0))
    fix = telling.observer.poses.fix
    assert (fix.pose.x, fix.pose.y) == pytest.approx((3.0, 4.0), abs=0.001)  # type: ignore[union-attr]


@pytest.mark.parametrize(("north", "east_m_s"), [(math.nan, 0.0), (math.inf, 0.0), (1.0, math.nan)])
def test_a_position_that_is_no_number_is_no_pose(north: float, east_m_s: float) -> None:
    telling = Telling()
    telling.origin()
    telling.tell(dialect.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0))
    telling.tell(dialect.MAVLink_local_position_ned_message(2, 0, 1.0, 0, 0, 0, 0))
    before = telling.observer.poses.fix
    telling.tell(dialect.MAVLink_local_position_ned_message(3, north, 1.0, 0, 0, east_m_s, 0))
    telling.tell(dialect.MAVLink_attitude_message(3, 0, 0, math.nan, 0, 0, 0))
    assert before is not None
    assert telling.observer.poses.fix is before
    telling.tell(dialect.MAVLink_local_position_ned_message(4, 0, 1.0, 0, 0, 0, 0))
    after = telling.observer.poses.fix
    assert after is not None
    assert after.pose == before.pose, "the heading is the last one that was a number"


def test_a_pose_is_of_the_item_only_if_it_was_reported_after_it() -> None:
    telling = Telling()
    telling.origin()
    telling.tell(dialect.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0))
    telling.tell(dialect.MAVLink_local_position_ned_message(2, 0, 1.0, 0, 0, 0, 0))
    telling.current(3)
    before = telling.observer.observe(AT_S1, telling.listed)
    telling.current(3)
    telling.tell(dialect.MAVLink_local_position_ned_message(3, 0, 1.0, 0, 0, 0, 0))
    after = telling.observer.observe(AT_S1, telling.listed)
    assert before is not None and before.pose is None
    assert after is not None and after.pose is not None and after.still


@pytest.mark.parametrize(
    ("north_m_s", "yaw_rate", "still"), [(0.02, 0.0, True), (0.04, 0.0, False), (0.0, 0.1, False)]
)
def test_a_vehicle_that_creeps_or_turns_is_not_seen_to_stand(
    north_m_s: float, yaw_rate: float, still: bool
) -> None:
    telling = Telling()
    telling.origin()
    telling.current(3)
    telling.tell(dialect.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, yaw_rate))
    telling.tell(dialect.MAVLink_local_position_ned_message(2, 0, 1.0, 0, north_m_s, 0, 0))
    observed = telling.observer.observe(AT_S1, telling.listed)
    assert observed is not None and observed.still is still


def test_a_scan_belongs_to_the_stop_where_it_was_made_and_counts_once() -> None:
    telling = Telling()
    telling.current(4)
    telling.captured(1, at=(2.0, 1.0))
    assert telling.scan() is None
    telling.captured(2, at=(1.0, 0.0))
    telling.captured(2, at=(1.0, 0.0))
    assert telling.scan() == ScanResult(file="scan-1.e57", size=1600, points=100, sha256="ab" * 32)
    assert telling.scan(after=(2, 2000)) is None
    telling.captured(3, at=(1.0, 0.0), result=0)
    assert isinstance(telling.scan(after=(2, 2000)), ScanFailed)


def test_a_file_that_is_not_reported_in_full_is_no_scan() -> None:
    telling = Telling()
    telling.current(4)
    telling.captured(1, at=(1.0, 0.0), url=URL.replace(b"size=1600", b"size=01600"))
    assert isinstance(telling.scan(), ScanFailed)


def test_a_battery_that_is_not_reported_changes_nothing() -> None:
    telling = Telling()
    for remaining in (40, -1):
        telling.tell(dialect.MAVLink_sys_status_message(0, 0, 0, 0, 0, 0, remaining, 0, 0, 0, 0, 0, 0))
    assert telling.observer.status.health.charge == 0.4


def test_a_number_of_items_that_is_not_reported_is_not_taken_for_one() -> None:
    telling = Telling()
    told = []
    for total in (0, 65_535, 7):
        telling.current(1, total=total)
        told.append(telling.observer.position.items)
    assert told == [None, None, 7]
    telling.current(0, dialect.MISSION_STATE_NO_MISSION, total=65_535)
    assert telling.observer.position.items == 0


def standing(telling: Telling, x: float, y: float) -> None:
    telling.tell(dialect.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0))
    telling.tell(dialect.MAVLink_local_position_ned_message(2, y, x, 0, 0, 0, 0))


def stood(telling: Telling, arrived: Arrived | None = None) -> Pose:
    observed = telling.observer.observe(AT_S1, telling.listed, arrived)
    assert observed is not None and observed.stood is not None
    return observed.stood


def arrival(x: float) -> Arrived:
    return Arrived(
        number=1, robot="", boot_id="", run_id="r", mission_id="m", revision=1, robot_ns=0,
        mission_time_s=0.0, stop="S1", pose=Pose(x=x, y=0.0, heading=0.0), deviation_m=abs(1.0 - x),
    )  # fmt: skip


def test_a_scan_made_off_its_stop_is_that_stops_with_where_it_was_made() -> None:
    """The vehicle arrived, and was moved, or its estimate jumped, before the scan was over."""
    telling = Telling()
    telling.origin()
    telling.current(4)
    standing(telling, 1.12, 0.0)
    telling.captured(1, at=(1.12, 0.0))
    assert isinstance(telling.scan(), ScanResult)
    assert stood(telling, arrival(1.01)).x == pytest.approx(1.12, abs=0.001)


def test_where_a_scan_was_made_is_reported_as_exactly_as_it_is_known() -> None:
    """The camera reports it in steps of a centimetre; its rounding is no motion of anybody."""
    telling = Telling()
    telling.origin()
    telling.current(4)
    telling.captured(1, at=(1.018, 0.0))
    assert stood(telling, arrival(1.01)).x == 1.01
    assert stood(telling).x == pytest.approx(1.018, abs=0.012)
    telling.captured(2, at=(1.12, 0.0))
    assert stood(telling, arrival(1.01)).x == pytest.approx(1.12, abs=0.012)


def test_a_scan_between_two_stops_is_of_the_nearer_one() -> None:
    telling = Telling()
    telling.current(4)
    telling.captured(1, at=(1.55, 0.0))
    assert telling.scan() is None
    telling.captured(2, at=(1.45, 0.0))
    assert isinstance(telling.scan(), ScanResult)
