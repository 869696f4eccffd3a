"""Telemetry of the simulated vehicle: one function per message."""

from __future__ import annotations

import math
import zlib

from stopgo.bridge.mavlink.simulated import replies
from stopgo.bridge.mavlink.simulated.rover import bearing
from stopgo.bridge.mavlink.simulated.vehicle import BATTERY_NS, Maker, Vehicle
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.mission.mavlink.enums import MessageId, MissionState, ModeFlag, SystemState, VehicleType
from stopgo.mission.mavlink.telemetry import Message

CAPABILITIES = (
    dialect.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    | dialect.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
)
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def heartbeat(vehicle: Vehicle) -> Message:
    modes = vehicle.autopilot.modes
    flags = modes.flags[vehicle.mode] | (ModeFlag.SAFETY_ARMED if vehicle.armed else 0)
    armed = SystemState.CRITICAL if vehicle.failsafe else SystemState.ACTIVE
    status = armed if vehicle.armed else SystemState.STANDBY
    rover = VehicleType.GROUND_ROVER
    return dialect.MAVLink_heartbeat_message(
        rover, vehicle.autopilot.firmware, flags, modes.custom(modes.numbers[vehicle.mode]), status, 3
    )


def sys_status(vehicle: Vehicle) -> Message:
    sensors = dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO | dialect.MAV_SYS_STATUS_SENSOR_GPS
    sensors |= vehicle.failsafes.enabled
    bad = vehicle.failsafes.enabled & ~vehicle.failsafes.healthy(vehicle.time.wall_ns)
    left = round(100 * vehicle.battery)
    return dialect.MAVLink_sys_status_message(
        sensors, sensors, sensors & ~bad, 100, 24_000, 150, left, 0, 0, 0, 0, 0, 0
    )


def battery_status(vehicle: Vehicle) -> Message:
    cells = [4000] * 6 + [65_535] * 4
    left = round(100 * vehicle.battery)
    return dialect.MAVLink_battery_status_message(
        0,
        dialect.MAV_BATTERY_FUNCTION_ALL,
        dialect.MAV_BATTERY_TYPE_LIPO,
        2500,
        cells,
        150,
        -1,
        -1,
        left,
        round(vehicle.battery * BATTERY_NS / 1e9),
    )


def attitude(vehicle: Vehicle) -> Message:
    now = vehicle.motion()
    return dialect.MAVLink_attitude_message(
        vehicle.time.boot_ms, 0.0, 0.0, bearing(now.pose.heading), 0.0, 0.0, -now.turning
    )


def global_position(vehicle: Vehicle) -> Message:
    """All zeros before there is an origin, as autopilots do."""
    now = vehicle.motion()
    pose = now.pose
    lat, lon = (0, 0) if vehicle.is_unplaced else vehicle.rover.place((pose.x, pose.y))
    north, east = 100 * now.speed_y, 100 * now.speed_x
    heading = round(math.degrees(bearing(pose.heading)) % 360 * 100) % 36_000
    return dialect.MAVLink_global_position_int_message(
        vehicle.time.boot_ms, lat, lon, vehicle.rover.alt_mm, 0, round(north), round(east), 0, heading
    )


def local_position(vehicle: Vehicle) -> Message:
    now = vehicle.motion()
    return dialect.MAVLink_local_position_ned_message(
        vehicle.time.boot_ms, now.pose.y, now.pose.x, 0.0, now.speed_y, now.speed_x, 0.0
    )


def gps_raw(vehicle: Vehicle) -> Message:
    now = vehicle.motion()
    pose, speed = now.pose, math.hypot(now.speed_x, now.speed_y)
    lat, lon = vehicle.rover.place((pose.x, pose.y))
    fix = dialect.GPS_FIX_TYPE_3D_FIX if vehicle.rover.origin else dialect.GPS_FIX_TYPE_NO_FIX
    auto = round(math.degrees(bearing(pose.heading)) % 360 * 100) % 36_000
    return dialect.MAVLink_gps_raw_int_message(
        vehicle.time.boot_ms * 1000, fix, lat, lon, vehicle.rover.alt_mm, 50, 50, round(100 * speed), auto, 12
    )


def vfr_hud(vehicle: Vehicle) -> Message:
    now = vehicle.motion()
    pose, speed = now.pose, math.hypot(now.speed_x, now.speed_y)
    auto = round(math.degrees(bearing(pose.heading))) % 360
    return dialect.MAVLink_vfr_hud_message(speed, speed, auto, 0, vehicle.rover.alt_mm / 1000, 0.0)


def origin(vehicle: Vehicle) -> Message | None:
    if vehicle.rover.origin is None:
        return None
    lat, lon = vehicle.rover.place((0.0, 0.0))
    return dialect.MAVLink_gps_global_origin_message(
        lat, lon, vehicle.rover.alt_mm, vehicle.time.boot_ms * 1000
    )


def home(vehicle: Vehicle) -> Message | None:
    """Home is the origin."""
    if vehicle.rover.origin is None:
        return None
    lat, lon = vehicle.rover.place((0.0, 0.0))
    return dialect.MAVLink_home_position_message(
        lat, lon, vehicle.rover.alt_mm, 0.0, 0.0, 0.0, UPRIGHT, 0.0, 0.0, 0.0, vehicle.time.boot_ms * 1000
    )


def extended_state(vehicle: Vehicle) -> Message:
    return dialect.MAVLink_extended_sys_state_message(
        dialect.MAV_VTOL_STATE_UNDEFINED, dialect.MAV_LANDED_STATE_ON_GROUND
    )


def mission_current(vehicle: Vehicle) -> Message:
    auto = vehicle.auto
    mode = 1 if vehicle.mode == "auto" else 2
    fields = (auto.current, auto.total, mission_state(vehicle), mode)
    if not vehicle.autopilot.behaviour.mission_ids:
        return dialect.MAVLink_mission_current_message(*fields)
    return replies.mission_current(*fields, number=zlib.crc32(repr(vehicle.store.stored.mission).encode()))


def mission_state(vehicle: Vehicle) -> int:
    auto = vehicle.auto
    if auto.total == 0:
        return int(MissionState.NO_MISSION)
    if auto.state == "active":
        return int(MissionState.ACTIVE)
    if auto.state == "complete":
        return int(MissionState.COMPLETE)
    paused = vehicle.autopilot.behaviour.pauses and auto.current > 0
    return int(MissionState.PAUSED if paused else MissionState.NOT_STARTED)


def item_reached(vehicle: Vehicle) -> Message | None:
    return None if vehicle.reached is None else dialect.MAVLink_mission_item_reached_message(vehicle.reached)


def rc_channels(vehicle: Vehicle) -> Message:
    channels = vehicle.remote_control.channels
    values = [*channels, *[65_535] * (18 - len(channels))]
    return dialect.MAVLink_rc_channels_message(vehicle.time.boot_ms, len(channels), *values, 200)


def image_captured(vehicle: Vehicle) -> Message | None:
    """Report of the scan that ended last."""
    return vehicle.camera.newest


def capture_status(vehicle: Vehicle) -> Message:
    """Of the autopilot: one that only passes triggers on counts these (source: AP_Camera)."""
    scans = int(vehicle.camera.under_way is not None)
    count = vehicle.camera.triggers if vehicle.camera_is_apart else vehicle.camera.count
    return dialect.MAVLink_camera_capture_status_message(vehicle.time.boot_ms, scans, 0, 0.0, 0, 0.0, count)


def camera_information(vehicle: Vehicle) -> Message:
    """Description of the scanner as a camera."""
    vendor, model = (list(text.ljust(32, "\0").encode()) for text in ("stopgo", "simulated scanner"))
    flags = dialect.CAMERA_CAP_FLAGS_CAPTURE_IMAGE
    return dialect.MAVLink_camera_information_message(
        vehicle.time.boot_ms, vendor, model, 0, 0.0, 0.0, 0.0, 0, 0, 0, flags, 0, b""
    )


def autopilot_version(vehicle: Vehicle) -> Message:
    release = (4 << 24) | (7 << 16) | dialect.FIRMWARE_VERSION_TYPE_OFFICIAL
    empty = [0] * 8
    return dialect.MAVLink_autopilot_version_message(
        CAPABILITIES, release, 0, 0, 0, empty, empty, empty, 0, 0, 1
    )


MAKERS: dict[int, Maker] = {
    MessageId.HEARTBEAT: heartbeat,
    MessageId.SYS_STATUS: sys_status,
    MessageId.GPS_RAW_INT: gps_raw,
    MessageId.ATTITUDE: attitude,
    MessageId.LOCAL_POSITION_NED: local_position,
    MessageId.GLOBAL_POSITION_INT: global_position,
    MessageId.MISSION_CURRENT: mission_current,
    MessageId.MISSION_ITEM_REACHED: item_reached,
    MessageId.GPS_GLOBAL_ORIGIN: origin,
    MessageId.VFR_HUD: vfr_hud,
    MessageId.RC_CHANNELS: rc_channels,
    MessageId.BATTERY_STATUS: battery_status,
    MessageId.AUTOPILOT_VERSION: autopilot_version,
    MessageId.HOME_POSITION: home,
    MessageId.EXTENDED_SYS_STATE: extended_state,
    MessageId.CAMERA_INFORMATION: camera_information,
    MessageId.CAMERA_CAPTURE_STATUS: capture_status,
    MessageId.CAMERA_IMAGE_CAPTURED: image_captured,
}
