"""The vehicle drives its mission, obeys and reports, each autopilot in its own way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.rover import to_east
from stopgo.bridge.mavlink.simulated.vehicle_process import read_origin
from stopgo.bridge.mavlink.simulated.vehicle_telemetry import MAKERS
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.items import Command, Item, MavFrame
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.run.events import Pose
from tests.bridge.mavlink.simulated.bench import (
    OBEYED,
    OTHER,
    Bench,
    camera,
    delay,
    request_message,
    script,
    waypoint,
)

d = dialect
Make = Callable[..., Bench]
CLOSE_M = 0.012
"""A step of 1e-7 degrees."""


@pytest.fixture(params=list(PROFILES))
def make(request: pytest.FixtureRequest) -> Make:
    return lambda **more: Bench(request.param, **more)


def trigger(bench: Bench, number: int, seconds: float) -> Item:
    return script(number, seconds) if bench.first else camera(number)


def speed(metres_per_s: float) -> Item:
    return Item(Command.DO_CHANGE_SPEED, MavFrame.MISSION, (1.0, metres_per_s, -1.0, 0.0))


def captures(bench: Bench) -> list[tuple[int, int]]:
    return [(m.image_index, m.capture_result) for m in bench.said("CAMERA_IMAGE_CAPTURED")]


# The mission


def test_a_mission_is_driven_to_its_end(make: Make) -> None:
    bench = make()
    bench.upload(
        [speed(1.0), waypoint(4.0, 0.0), delay(1.0), trigger(bench, 7, 5.0), delay(5.0), waypoint(4.0, 3.0)]
    )
    bench.start()
    bench.pass_time(60.0)
    assert bench.reached() == [1, 2, 4, 5]
    assert bench.at() == pytest.approx((4.0, 3.0), abs=CLOSE_M if bench.first else 0.05)
    assert captures(bench) == [(0, 1)]
    assert bench.last("MISSION_CURRENT").mission_state == d.MISSION_STATE_COMPLETE
    assert bench.vehicle.mode == bench.vehicle.autopilot.behaviour.done_mode


def test_a_trigger_fires_when_the_wait_before_it_is_over_and_not_before(make: Make) -> None:
    """4 m at 0.5 m/s and 0.5 m/s² take 9 s; then 1 s of hold, 10 s of settling: the scan begins at 20 s."""
    bench = make()
    bench.upload([waypoint(4.0, 0.0), delay(10.0), trigger(bench, 1, 5.0), delay(5.0)])
    bench.start()
    bench.pass_time(19.0)
    assert bench.vehicle.camera.under_way is None
    bench.pass_time(2.0)
    ends_ns = bench.vehicle.camera.due_ns
    assert ends_ns is not None
    assert (ends_ns - bench.vehicle.time.booted_ns) / 1e9 == pytest.approx(25.0, abs=0.1)


def test_a_trigger_right_before_a_waypoint_fires_while_the_vehicle_drives_and_its_scan_fails(
    make: Make,
) -> None:
    bench = make()
    bench.upload([waypoint(2.0, 0.0), trigger(bench, 1, 3.0), waypoint(2.0, 5.0)])
    bench.start()
    bench.pass_time(30.0)
    assert captures(bench) == [(0, 0)]
    assert bench.last("CAMERA_IMAGE_CAPTURED").file_url == ""
    assert any("moved during the scan" in m.text for m in bench.said("STATUSTEXT"))


def test_a_scan_is_confirmed_by_the_file_it_made(make: Make) -> None:
    bench = make()
    bench.upload([trigger(bench, 12, 2.0), delay(2.0)])
    bench.start()
    bench.pass_time(5.0)
    name, _, told = bench.last("CAMERA_IMAGE_CAPTURED").file_url.partition("?")
    numbers = dict(part.split("=") for part in told.split("&"))
    assert name == "scan-0001-12.e57"
    assert (int(numbers["points"]), int(numbers["size"])) == (720_000, 11_520_000)
    assert len(bytes.fromhex(numbers["sha256"])) == 32
    assert (bench.last("CAMERA_IMAGE_CAPTURED").lat, bench.last("CAMERA_IMAGE_CAPTURED").lon) == (
        474_000_000,
        85_000_000,
    )


def test_pause_keeps_the_item_and_resume_goes_on_with_it(make: Make) -> None:
    bench = make()
    bench.upload([waypoint(1.0, 0.0), waypoint(9.0, 0.0), delay(1.0)])
    bench.start()
    bench.pass_time(10.0)
    assert bench.mode("hold") == OBEYED
    bench.pass_time(3.0)
    stood = bench.at()
    bench.pass_time(60.0)
    assert bench.at() == stood
    assert 1.0 < stood[0] < 8.0
    assert bench.last("MISSION_CURRENT").seq == 1 + bench.first
    paused = (
        d.MISSION_STATE_PAUSED if bench.vehicle.autopilot.behaviour.pauses else d.MISSION_STATE_NOT_STARTED
    )
    assert bench.last("MISSION_CURRENT").mission_state == paused
    assert bench.mode("auto") == OBEYED
    bench.pass_time(40.0)
    assert bench.reached() == [0, 1, 2]


def test_disarming_and_rebooting_begin_the_mission_again_and_keep_the_items(make: Make) -> None:
    bench = make()
    bench.upload([delay(5.0), delay(5.0), delay(5.0)])
    bench.start()
    bench.pass_time(7.0)
    assert bench.vehicle.auto.current == 1 + bench.first
    assert bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 0) == OBEYED
    assert (bench.vehicle.auto.current, bench.vehicle.auto.state) == (0, "idle")
    assert bench.command(d.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == OBEYED
    said = len(bench.all)
    bench.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert len(bench.all) == said
    bench.pass_time(2.0)
    assert (bench.vehicle.armed, bench.vehicle.mode, len(bench.held())) == (False, "manual", 3)
    assert bench.last("MISSION_CURRENT").seq == 0


def test_an_armed_vehicle_does_not_reboot(make: Make) -> None:
    bench = make()
    bench.arm()
    assert bench.command(d.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) != OBEYED
    assert bench.vehicle.armed


def test_a_mission_starts_at_the_item_that_was_set(make: Make) -> None:
    bench = make()
    bench.upload([delay(1.0), delay(2.0), delay(3.0)])
    if bench.vehicle.autopilot.behaviour.jumps_by_command:
        assert bench.command(Command.DO_SET_MISSION_CURRENT, 2 + bench.first) == OBEYED
        assert bench.command(Command.DO_SET_MISSION_CURRENT, 77) == d.MAV_RESULT_DENIED
        assert bench.command(Command.DO_SET_MISSION_CURRENT, math.nan) == d.MAV_RESULT_DENIED
    else:
        assert bench.command(Command.DO_SET_MISSION_CURRENT, 2) == d.MAV_RESULT_UNSUPPORTED
        bench.say(d.MAVLink_mission_set_current_message(1, 1, 2))
    bench.start()
    bench.pass_time(5.0)
    assert bench.reached() == [2]


def test_the_old_message_sets_the_item_too_even_in_auto(make: Make) -> None:
    bench = make()
    bench.upload([delay(100.0), delay(2.0)])
    bench.start()
    bench.say(d.MAVLink_mission_set_current_message(1, 1, 1 + bench.first))
    bench.pass_time(3.0)
    assert bench.reached() == [1]
    bench.say(d.MAVLink_mission_set_current_message(1, 1, 99))
    assert "not in the mission" in bench.last("STATUSTEXT").text


def test_a_finished_mission_begins_again_from_its_first_item(make: Make) -> None:
    bench = make()
    bench.upload([delay(1.0), delay(1.0)])
    bench.start()
    bench.pass_time(5.0)
    bench.mode("hold")
    bench.mode("auto")
    bench.pass_time(5.0)
    assert bench.reached() == [0, 1, 0, 1]


def test_an_upload_while_the_mission_runs(make: Make) -> None:
    bench = make()
    bench.upload([delay(5.0), delay(5.0), delay(5.0)])
    bench.start()
    bench.pass_time(7.0)
    bench.upload([delay(50.0), delay(60.0), delay(70.0)])
    restarts = bench.vehicle.autopilot.behaviour.restarts_item
    assert bench.vehicle.auto.current == (1 if restarts else 0) + bench.first
    assert bench.vehicle.auto.state == "active"
    bench.pass_time(49.0)
    assert bench.reached() == [0]


def test_an_upload_that_is_shorter_than_the_run_is_far(make: Make) -> None:
    bench = make()
    bench.upload([delay(5.0), delay(5.0), delay(5.0)])
    bench.start()
    bench.pass_time(12.0)
    bench.count(1 + bench.first)
    bench.pass_time(20.0)
    bench.upload([delay(3.0)])
    bench.pass_time(10.0)
    assert bench.vehicle.auto.state in ("complete", "idle")


def test_a_vehicle_with_nothing_to_drive_stays_out_of_auto(make: Make) -> None:
    bench = make()
    assert bench.mode("auto") != OBEYED
    assert bench.vehicle.mode == "manual"


def test_a_hold_is_waited_before_the_waypoint_is_reached(make: Make) -> None:
    bench = make()
    bench.upload([waypoint(0.0, 0.0, hold=10.0), delay(5.0)])
    bench.start()
    bench.pass_time(9.0)
    assert bench.reached() == []
    bench.pass_time(2.0)
    assert bench.reached() == [0]


def test_ardupilot_runs_too_long_a_hold_as_none() -> None:
    bench = Bench("ardupilot")
    bench.upload([waypoint(0.0, 0.0, hold=100_000.0), delay(1.0)])
    bench.start()
    bench.pass_time(3.0)
    assert bench.reached() == [0, 1]


def test_ardupilot_waits_until_the_script_says_that_the_scan_is_done() -> None:
    bench = Bench("ardupilot")
    wait = Item(Command.NAV_SCRIPT_TIME, MavFrame.MISSION, (1.0, 120.0, 0.0, 0.0), x=5)
    bench.upload([script(5, 20.0), wait, delay(5.0)])
    bench.start()
    bench.pass_time(19.0)
    assert bench.reached() == []
    bench.pass_time(2.0)
    assert (bench.reached(), captures(bench)) == ([1], [(0, 1)])


def test_ardupilot_waits_for_a_script_no_longer_than_it_may() -> None:
    bench = Bench("ardupilot")
    wait = Item(Command.NAV_SCRIPT_TIME, MavFrame.MISSION, (1.0, 10.0, 0.0, 0.0), x=5)
    bench.upload([script(5, 60.0), wait])
    bench.start()
    bench.pass_time(11.0)
    assert bench.reached() == [1]


def test_a_rover_turns_to_a_heading_as_its_autopilot_does(make: Make) -> None:
    bench = make()
    item = waypoint(2.0, 0.0)
    bench.upload(
        [replace(item, params=(0.0, 0.2, 0.0, 90.0)), replace(item, params=(0.0, 0.2, 0.0, math.nan))]
    )
    bench.start()
    bench.pass_time(20.0)
    bench.say(request_message(d.MAVLINK_MSG_ID_ATTITUDE))
    east = math.pi / 2 if bench.vehicle.autopilot.turns else 0.0
    assert bench.last("ATTITUDE").yaw == pytest.approx(east, abs=1e-6)


# Position


def test_without_an_origin_everything_is_taken_and_nothing_moves(make: Make) -> None:
    bench = make(origin=None)
    bench.upload([waypoint(3.0, 0.0)])
    bench.start()
    bench.pass_time(30.0)
    position = bench.last("GLOBAL_POSITION_INT")
    assert (bench.at(), position.lat, position.lon) == ((0.0, 0.0), 0, 0)
    assert bench.said("GPS_GLOBAL_ORIGIN") == []
    assert "no global origin" in bench.last("STATUSTEXT").text
    bench.say(d.MAVLink_set_gps_global_origin_message(1, 474_000_000, 85_000_000, 400_000))
    bench.pass_time(30.0)
    assert bench.at() == pytest.approx((3.0, 0.0), abs=0.05)


def test_ardupilot_takes_one_origin_per_boot_and_is_silent_about_others() -> None:
    bench = Bench("ardupilot", origin=None)
    bench.say(d.MAVLink_set_gps_global_origin_message(1, 470_000_000, 80_000_000, 1000))
    assert bench.last("GPS_GLOBAL_ORIGIN").latitude == 470_000_000
    assert bench.say(d.MAVLink_set_gps_global_origin_message(1, 480_000_000, 80_000_000, 1000)) == []
    assert bench.command(d.MAV_CMD_REQUEST_MESSAGE, d.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN) == OBEYED
    assert bench.last("GPS_GLOBAL_ORIGIN").latitude == 470_000_000
    bench.command(d.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
    bench.pass_time(2.0)
    assert bench.command(d.MAV_CMD_REQUEST_MESSAGE, d.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN) == d.MAV_RESULT_DENIED


def test_a_place_off_the_earth_is_no_origin(make: Make) -> None:
    bench = make(origin=None)
    for lat, lon in ((2**31 - 1, 0), (0, 2**31 - 1), (900_000_000, 0)):
        bench.say(d.MAVLink_set_gps_global_origin_message(1, lat, lon, 0))
    assert bench.vehicle.rover.origin is None


def test_degrees_and_metres_agree_by_the_autopilots_own_rule(make: Make) -> None:
    """200 m away the rules are 0.3 m apart; each vehicle must stand where its own rule says, to a step."""
    bench = make()
    item = waypoint(200.0, 200.0)
    bench.upload([speed(5.0), item])
    bench.start()
    bench.pass_time(200.0)
    position = bench.last("GLOBAL_POSITION_INT")
    assert abs(position.lat - item.x) <= 1 and abs(position.lon - item.y) <= 1
    if bench.first:
        assert bench.at() == pytest.approx((200.0, 200.0), abs=CLOSE_M)


def test_a_site_that_is_turned() -> None:
    """+y of the site bears 90°: its +x points south; a robot looking along +x looks south."""
    pose = to_east(Pose(x=1.0, y=2.0, heading=0.0), 90.0)
    assert (pose.x, pose.y) == pytest.approx((2.0, -1.0))
    assert pose.heading == pytest.approx(-math.pi / 2)
    assert read_origin("47.4,8.5,400") == SiteOrigin(lat=47.4, lon=8.5, alt=400.0, heading_deg=0.0)


def test_where_it_stands_outlives_the_vehicles_process(make: Make, tmp_path: Path) -> None:
    bench = make(state=tmp_path)
    bench.upload([waypoint(3.0, 0.0), trigger(bench, 1, 1.0), delay(2.0)])
    bench.start()
    bench.pass_time(30.0)
    bench.vehicle.save_pose()
    again = make(state=tmp_path)
    assert again.at() == pytest.approx(bench.at())
    assert again.vehicle.store.stored.images == 1


# Orders


PLACE_ONLY, YAW_ONLY = 0b1101_1111_1000, 0b1001_1111_1111


def setpoint(
    north: float, east: float, *, mask: int = PLACE_ONLY, yaw: float = 0.0, frame: int = 1
) -> Message:
    return d.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, frame, mask, north, east, 0.0, 0, 0, 0, 0, 0, 0, yaw, 0
    )


def target(bench: Bench, message: Message, seconds: float) -> None:
    """Setpoints twice a second, as PX4 wants them."""
    for _ in range(round(2 * seconds)):
        bench.say(message)
        bench.pass_time(0.5)


def test_guided_drives_to_a_target(make: Make) -> None:
    bench = make()
    bench.arm()
    bench.say(setpoint(2.0, 1.0))
    assert bench.mode("guided") == OBEYED
    target(bench, setpoint(2.0, 1.0), 15.0)
    assert bench.at() == pytest.approx((2.0, 1.0))
    target(bench, setpoint(math.nan, 1e30), 5.0)
    assert bench.at() == pytest.approx((2.0, 1.0))
    bench.say(setpoint(1.0, 0.0, frame=d.MAV_FRAME_LOCAL_OFFSET_NED))
    target(bench, setpoint(0.0, 0.0, frame=d.MAV_FRAME_BODY_NED), 15.0)
    assert bench.at() == pytest.approx((3.0, 1.0))


def test_px4_leaves_offboard_when_setpoints_cease_and_does_not_enter_without() -> None:
    bench = Bench("px4")
    bench.arm()
    assert bench.mode("guided") == d.MAV_RESULT_DENIED
    target(bench, setpoint(9.0, 0.0), 1.0)
    assert bench.mode("guided") == OBEYED
    target(bench, setpoint(9.0, 0.0), 5.0)
    assert bench.vehicle.mode == "guided"
    bench.pass_time(10.0)
    assert bench.vehicle.mode == "hold"
    assert 0.0 < bench.at()[0] < 8.0


def test_a_yaw_alone_turns_on_the_spot_where_the_autopilot_does(make: Make) -> None:
    bench = make()
    bench.arm()
    bench.say(setpoint(0.0, 0.0))
    bench.mode("guided")
    target(bench, setpoint(0.0, 0.0, mask=YAW_ONLY, yaw=-1.0), 5.0)
    bench.say(request_message(d.MAVLINK_MSG_ID_ATTITUDE))
    turned = -1.0 if bench.vehicle.autopilot.driving.turns else 0.0
    assert bench.last("ATTITUDE").yaw == pytest.approx(turned)
    assert bench.at() == (0.0, 0.0)


def test_a_speed_is_taken_on_a_leg(make: Make) -> None:
    """8 m at 0.5 m/s take 17 s, at 2 m/s with 0.5 m/s² no more than 8 s."""
    bench = make()
    bench.arm()
    idle = bench.command(Command.DO_CHANGE_SPEED, 1, 0.5)
    assert (idle == OBEYED) == (bench.vehicle.autopilot.name != "ardupilot")
    bench.say(setpoint(8.0, 0.0))
    bench.mode("guided")
    bench.say(setpoint(8.0, 0.0))
    assert bench.command(Command.DO_CHANGE_SPEED, 1, 2.0) == OBEYED
    target(bench, setpoint(8.0, 0.0), 8.5)
    assert bench.at() == pytest.approx((8.0, 0.0))
    assert bench.command(Command.DO_CHANGE_SPEED, 1, math.nan) == d.MAV_RESULT_DENIED


def test_a_target_on_the_globe_repeated_is_one_target(make: Make) -> None:
    bench = make()
    item = waypoint(0.0, 4.0)
    message = d.MAVLink_set_position_target_global_int_message(
        0, 1, 1, 6, 0b1101_1111_1000, item.x, item.y, 0, 0, 0, 0, 0, 0, 0, 0, 0
    )
    bench.say(message)
    bench.arm()
    bench.mode("guided")
    target(bench, message, 20.0)
    assert bench.at() == pytest.approx((0.0, 4.0), abs=0.05)


def test_reposition_changes_the_mode_only_if_allowed(make: Make) -> None:
    bench = make()
    item = waypoint(2.0, 0.0)

    def reposition(flags: int) -> int:
        said = bench.say(
            d.MAVLink_command_int_message(1, 1, 6, 192, 0, 0, -1, flags, 0, math.nan, item.x, item.y, 0)
        )
        return next(m.result for m in said if m.get_type() == "COMMAND_ACK")

    assert reposition(1) == d.MAV_RESULT_DENIED  # not armed
    bench.arm()
    assert reposition(0) == d.MAV_RESULT_DENIED
    assert bench.command(192, -1, 1, 0, 0, 47.4, 8.5) == d.MAV_RESULT_COMMAND_INT_ONLY
    assert reposition(1) == OBEYED
    bench.pass_time(10.0)
    assert bench.at() == pytest.approx((2.0, 0.0), abs=0.05)
    assert bench.vehicle.mode == bench.vehicle.autopilot.driving.reposition_mode


def test_mission_start(make: Make) -> None:
    bench = make()
    bench.upload([delay(1.0), delay(1.0)])
    name = bench.vehicle.autopilot.name
    assert (bench.command(d.MAV_CMD_MISSION_START, 1) == OBEYED) == (name != "ardupilot")
    bench.vehicle.set_mode("hold")
    assert bench.command(d.MAV_CMD_MISSION_START) == OBEYED
    assert bench.vehicle.armed == (name == "px4")
    bench.arm()
    bench.pass_time(3.0)
    assert bench.reached()[-1] == 1


def test_a_mode_by_message(make: Make) -> None:
    bench = make()
    bench.upload([delay(1.0)])
    modes = bench.vehicle.autopilot.modes
    said = bench.say(d.MAVLink_set_mode_message(1, 1, modes.custom(modes.auto)))
    assert bench.vehicle.mode == "auto"
    assert [m.command for m in said if m.get_type() == "COMMAND_ACK"] == ([11] if bench.first else [])
    bench.say(d.MAVLink_set_mode_message(1, 1, 4_000_000_000))
    assert bench.vehicle.mode == "auto"


def test_the_specifications_vehicle_knows_modes_by_their_flags_and_pauses_by_command() -> None:
    bench = Bench("strict")
    bench.upload([delay(1.0)])
    assert bench.command(d.MAV_CMD_DO_SET_MODE, d.MAV_MODE_FLAG_AUTO_ENABLED) == OBEYED
    assert bench.vehicle.mode == "auto"
    assert bench.command(d.MAV_CMD_DO_PAUSE_CONTINUE, 0) == OBEYED
    assert bench.vehicle.mode == "hold"
    assert Bench("px4").command(d.MAV_CMD_DO_SET_MODE, d.MAV_MODE_FLAG_AUTO_ENABLED) == d.MAV_RESULT_DENIED


def test_what_is_not_known_is_unsupported_and_reported_to_who_asked(make: Make) -> None:
    bench = make()
    assert bench.command(31_010, who=OTHER) == d.MAV_RESULT_UNSUPPORTED
    ack = bench.last("COMMAND_ACK")
    assert (ack.command, ack.target_system, ack.target_component) == (31_010, OTHER.system, OTHER.component)
    assert bench.command(d.MAV_CMD_REQUEST_MESSAGE, 300) == d.MAV_RESULT_UNSUPPORTED
    assert bench.command(d.MAV_CMD_REQUEST_MESSAGE, math.nan) == d.MAV_RESULT_UNSUPPORTED


def test_every_message_that_it_knows_can_be_asked_for(make: Make) -> None:
    bench = make()
    bench.upload([trigger(bench, 1, 1.0), delay(2.0)])
    bench.start()
    bench.pass_time(5.0)
    for number in MAKERS:
        said = bench.say(request_message(number))
        assert said[-1].get_msgId() == number


def test_capabilities_are_what_ground_stations_look_for(make: Make) -> None:
    bench = make()
    bench.command(d.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1)
    capabilities = bench.last("AUTOPILOT_VERSION").capabilities
    for name in ("MISSION_INT", "COMMAND_INT", "MAVLINK2", "MISSION_FENCE", "MISSION_RALLY"):
        assert capabilities & getattr(d, f"MAV_PROTOCOL_CAPABILITY_{name}")


def test_reached_is_repeated_when_asked_so(make: Make) -> None:
    bench = make()
    bench.upload([delay(1.0), delay(1000.0)])
    bench.start()
    bench.pass_time(2.0)
    assert (
        bench.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, d.MAVLINK_MSG_ID_MISSION_ITEM_REACHED, 500_000)
        == OBEYED
    )
    before = len(bench.said("MISSION_ITEM_REACHED"))
    bench.pass_time(5.0)
    assert len(bench.said("MISSION_ITEM_REACHED")) >= before + 9
    assert bench.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, d.MAVLINK_MSG_ID_MISSION_ITEM_REACHED, -1) == OBEYED
    before = len(bench.said("MISSION_ITEM_REACHED"))
    bench.pass_time(5.0)
    assert len(bench.said("MISSION_ITEM_REACHED")) == before


def test_intervals_are_set_reported_and_reset(make: Make) -> None:
    bench = make()
    number = d.MAVLINK_MSG_ID_ATTITUDE
    assert bench.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1.0) == OBEYED
    bench.command(d.MAV_CMD_GET_MESSAGE_INTERVAL, number)
    assert bench.last("MESSAGE_INTERVAL").interval_us == 10_000
    bench.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, number, 0)
    bench.command(d.MAV_CMD_GET_MESSAGE_INTERVAL, number)
    assert bench.last("MESSAGE_INTERVAL").interval_us == 250_000
    assert bench.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, 12_345, 1000) != OBEYED


def test_parameters_are_listed_read_and_set(make: Make) -> None:
    bench = make()
    bench.say(d.MAVLink_param_request_list_message(1, 1))
    listed = bench.said("PARAM_VALUE")
    assert [m.param_index for m in listed] == list(range(listed[0].param_count))
    bench.say(d.MAVLink_param_set_message(1, 1, b"SIM_SCAN_TIME", 8.0, 9))
    bench.say(d.MAVLink_param_request_read_message(1, 1, b"SIM_SCAN_TIME", -1))
    assert bench.last("PARAM_VALUE").param_value == 8.0
    bench.say(d.MAVLink_param_set_message(1, 1, b"SIM_SCAN_TIME", math.nan, 9))
    assert bench.last("PARAM_VALUE").param_value == 8.0
    before = len(bench.all)
    bench.say(d.MAVLink_param_request_read_message(1, 1, b"NONE", -1))
    bench.say(d.MAVLink_param_request_read_message(1, 1, b"", 999))
    assert len(bench.all) == before


def test_a_scan_by_command_is_not_begun_twice(make: Make) -> None:
    bench = make()
    capture = d.MAV_CMD_IMAGE_START_CAPTURE
    assert bench.command(capture, 0, 4.0, 1, 3) == OBEYED
    assert bench.command(capture, 0, 4.0, 1, 3) == OBEYED
    assert bench.command(capture, 0, 4.0, 1, 4) == d.MAV_RESULT_TEMPORARILY_REJECTED
    bench.pass_time(5.0)
    assert captures(bench) == [(0, 1)]
    assert bench.command(capture, 0, 4.0, 1, 3) == OBEYED  # the gateway retries a stop
    bench.pass_time(5.0)
    assert captures(bench) == [(0, 1), (1, 1)]
    again = d.MAVLink_command_long_message(1, 1, capture, 1, 0, 4.0, 1, 3, 0, 0, 0)
    bench.say(again)
    assert bench.vehicle.camera.under_way is None


def test_the_camera_reports_how_much_it_has_taken_and_an_older_picture_again(make: Make) -> None:
    bench = make()
    for number in (1, 2, 3):
        bench.command(d.MAV_CMD_IMAGE_START_CAPTURE, 0, 1.0, 1, number)
        bench.pass_time(2.0)
    bench.say(request_message(d.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS))
    status = bench.last("CAMERA_CAPTURE_STATUS")
    assert (status.image_count, status.image_status) == (3, 0)
    pictured = d.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED
    bench.command(d.MAV_CMD_REQUEST_MESSAGE, pictured, 1)
    assert bench.last("CAMERA_IMAGE_CAPTURED").image_index == 1
    bench.command(d.MAV_CMD_REQUEST_MESSAGE, pictured, 0)
    assert bench.last("CAMERA_IMAGE_CAPTURED").image_index == 2


def test_a_scan_that_is_broken_off_has_no_result(make: Make) -> None:
    bench = make()
    bench.command(d.MAV_CMD_IMAGE_START_CAPTURE, 0, 5.0, 1, 1)
    assert bench.command(d.MAV_CMD_IMAGE_STOP_CAPTURE) == OBEYED
    bench.pass_time(10.0)
    assert captures(bench) == []
    assert bench.command(d.MAV_CMD_REQUEST_MESSAGE, d.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED) != OBEYED


def test_a_scan_by_message_to_a_script(make: Make) -> None:
    bench = make()
    result = bench.command(Command.DO_SEND_SCRIPT_MESSAGE, 100, 5, 2.0, 60.0)
    assert (result == OBEYED) == (bench.vehicle.autopilot.name == "ardupilot")
    bench.pass_time(3.0)
    assert len(captures(bench)) == (1 if result == OBEYED else 0)


# What goes wrong


def test_a_reboot_in_the_middle_of_the_mission(make: Make) -> None:
    first = make().first
    bench = make(faults=[f"reboot-mission@{1 + first}"])
    bench.upload([waypoint(2.0, 0.0), waypoint(8.0, 0.0)])
    bench.start()
    bench.pass_time(40.0)
    assert bench.reached() == [0]
    assert not bench.vehicle.armed
    assert 2.0 < bench.at()[0] < 8.0
    bench.start()
    bench.pass_time(60.0)
    assert bench.reached() == [0, 1]


def test_its_time_since_boot_does_not_run_ahead_of_the_messages(make: Make) -> None:
    """Sped up, messages that overtake each other by 0.3 s must not look like a reboot."""
    bench = make(faults=["jitter@300"])
    bench.clock.wait(100.0)
    bench.pass_time(5.0)
    assert bench.vehicle.time.boot_ms == 5_000
    bench.vehicle.reboot()
    assert bench.vehicle.time.boot_ms == 0


def test_a_stop_error_is_not_reported(make: Make) -> None:
    bench = make(faults=[f"beside@{make().first}=0.5"])
    bench.upload([waypoint(4.0, 0.0)])
    bench.start()
    bench.pass_time(30.0)
    assert bench.reached() == [0]
    assert bench.at() == pytest.approx((4.0, -0.5), abs=0.05)


def test_reached_in_passing(make: Make) -> None:
    bench = make(faults=[f"finish@{make().first}=1.5"])
    bench.upload([waypoint(4.0, 0.0, hold=30.0), delay(20.0)])
    bench.start()
    bench.pass_time(12.0)
    assert bench.reached() == [0]
    assert bench.at() == pytest.approx((2.5, 0.0), abs=0.05)


def test_a_scanner_that_fails(make: Make) -> None:
    bench = make(faults=["scanner@2"])
    for number in (1, 2, 3):
        bench.command(d.MAV_CMD_IMAGE_START_CAPTURE, 0, 1.0, 1, number)
        bench.pass_time(2.0)
    assert captures(bench) == [(0, 1), (1, 0), (2, 1)]


def test_heartbeats_say_who_it_is(make: Make) -> None:
    bench = make()
    bench.pass_time(2.0)
    beat = bench.last("HEARTBEAT")
    assert (beat.type, beat.autopilot) == (d.MAV_TYPE_GROUND_ROVER, bench.vehicle.autopilot.firmware)
    bench.arm()
    bench.mode("hold")
    beat = bench.last("HEARTBEAT")
    assert beat.base_mode & d.MAV_MODE_FLAG_SAFETY_ARMED
    assert beat.custom_mode == {"ardupilot": 4}.get(bench.vehicle.autopilot.name, 3 << 24 | 4 << 16)
