"""Commands that the simulated vehicle carries out: COMMAND_LONG, COMMAND_INT and other messages."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from stopgo.bridge.mavlink.simulated import replies
from stopgo.bridge.mavlink.simulated import vehicle_telemetry as telemetry
from stopgo.bridge.mavlink.simulated.rover import FAR_M
from stopgo.bridge.mavlink.simulated.steering import Course
from stopgo.bridge.mavlink.simulated.vehicle import Handlers, Vehicle
from stopgo.bridge.mavlink.vehicle_link.wire import Who
from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots.kind import Mode, ModeName
from stopgo.mission.mavlink.enums import CommandResult, Component, MessageId, ModeFlag
from stopgo.mission.mavlink.items import Command, MavFrame
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.mavlink.writing import SCAN_MESSAGE

ACCEPTED, DENIED = CommandResult.ACCEPTED, CommandResult.DENIED
REJECTED, UNSUPPORTED = CommandResult.TEMPORARILY_REJECTED, CommandResult.UNSUPPORTED
FAILED = CommandResult.FAILED
IGNORE_X_Y, IGNORE_VELOCITY, IGNORE_YAW = 0b11, 0b11000, 1 << 10
LOCAL_NED, LOCAL_OFFSET_NED = MavFrame.LOCAL_NED, MavFrame.LOCAL_OFFSET_NED
NORTHMOST = 89.0
"""Degrees; at the poles there is no east."""
OF_CAMERA = (
    MessageId.CAMERA_IMAGE_CAPTURED, MessageId.CAMERA_CAPTURE_STATUS, MessageId.CAMERA_INFORMATION,
)  # fmt: skip
ONLY_OF_CAMERA = (MessageId.CAMERA_IMAGE_CAPTURED, MessageId.CAMERA_INFORMATION)
"""Messages that an autopilot does not have whose scanner is a component of its own."""
CHANGE_MODE = 1
"""MAV_DO_REPOSITION_FLAGS."""


@dataclass(frozen=True)
class ReceivedCommand:
    """A command with its numbers; `x` and `y` are steps of 1e-7 degrees where it has a position."""

    command: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    exact: bool
    """Its position is good to a centimetre: it came in a COMMAND_INT."""
    again: bool
    """Sent again by a station that received no answer."""
    to: int
    """The component that it is for; 0: every one."""

    def whole(self, index: int, default: int = -1) -> int:
        """A param as a whole number; `default` if it is none."""
        value = self.params[index]
        return int(value) if math.isfinite(value) and abs(value) < 2**31 else default


def handlers(vehicle: Vehicle) -> Handlers:
    """Handler of each message that commands the vehicle."""
    return {
        "COMMAND_LONG": lambda who, message: _answer(vehicle, who, _long(message)),
        "COMMAND_INT": lambda who, message: _answer(vehicle, who, _int(message)),
        "SET_MODE": lambda who, message: _set_mode_message(vehicle, who, message),
        "MISSION_SET_CURRENT": lambda who, message: _set_current_message(vehicle, message),
        "SET_GPS_GLOBAL_ORIGIN": lambda who, message: _set_origin(vehicle, message),
        "SET_POSITION_TARGET_LOCAL_NED": lambda who, message: _target_local(vehicle, message),
        "SET_POSITION_TARGET_GLOBAL_INT": lambda who, message: _target_global(vehicle, message),
        "RC_CHANNELS_OVERRIDE": lambda who, message: _override(vehicle, message),
    }


def _long(message: Message) -> ReceivedCommand:
    params = (message.param1, message.param2, message.param3, message.param4)
    x, y = (_steps(value) for value in (message.param5, message.param6))
    again, to = message.confirmation > 0, message.target_component
    return ReceivedCommand(message.command, params, x, y, exact=False, again=again, to=to)


def _int(message: Message) -> ReceivedCommand:
    params = (message.param1, message.param2, message.param3, message.param4)
    x, y, to = message.x, message.y, message.target_component
    return ReceivedCommand(message.command, params, x, y, exact=True, again=False, to=to)


def _steps(degrees: float) -> int:
    return round(degrees * STEPS_PER_DEGREE) if math.isfinite(degrees) and abs(degrees) < 200 else 2**31 - 1


def _answer(vehicle: Vehicle, who: Who, command: ReceivedCommand) -> None:
    """Carry out and acknowledge a command; one that makes the vehicle silent is acknowledged first."""
    if vehicle.camera_is_apart and _answer_as_camera(vehicle, who, command):
        return
    if command.command == Command.PREFLIGHT_REBOOT_SHUTDOWN:
        return _reboot(vehicle, who, command)
    if command.command == Command.COMPONENT_ARM_DISARM and command.params[0] == 1 and vehicle.refuses_arming:
        _acknowledge(vehicle, who, command.command, _no(vehicle))
        return vehicle.text(vehicle.refuses_arming)  # a real one explains after it has answered
    execute = EXECUTED.get(command.command)
    _acknowledge(vehicle, who, command.command, UNSUPPORTED if execute is None else execute(vehicle, command))
    if command.command == Command.REQUEST_MESSAGE:
        _send_requested(vehicle, command.whole(0), command.whole(1))


def _answer_as_camera(vehicle: Vehicle, who: Who, command: ReceivedCommand) -> bool:
    """Answer for a scanner that is a component of its own; true if nothing is left for the autopilot.

    It reports its pictures itself: the autopilot, if asked for them, answers UNSUPPORTED.
    """
    for_camera, all_of = command.to == Component.CAMERA, command.to == 0
    asked = command.command == Command.REQUEST_MESSAGE and command.whole(0) in OF_CAMERA
    if asked and (for_camera or all_of):
        _send_requested(vehicle, command.whole(0), command.whole(1))
    not_its_own = asked and command.whole(0) in ONLY_OF_CAMERA
    if not_its_own and not for_camera:
        _acknowledge(vehicle, who, command.command, UNSUPPORTED)
    return for_camera or not_its_own


def _send_requested(vehicle: Vehicle, number: int, index: int) -> None:
    """Send a requested message, if there is something to report; an older scan's report by its number."""
    if number == MessageId.CAMERA_IMAGE_CAPTURED and index > 0 and index in vehicle.camera.reports:
        vehicle.send(vehicle.camera.reports[index])
    elif number in telemetry.MAKERS:
        vehicle.report(number)


def _acknowledge(vehicle: Vehicle, who: Who, command: int, result: int) -> None:
    vehicle.send(replies.command_ack(who, command, result))


def _reboot(vehicle: Vehicle, who: Who, command: ReceivedCommand) -> None:
    refused = vehicle.armed or command.whole(0) != 1
    _acknowledge(vehicle, who, command.command, _no(vehicle) if refused else ACCEPTED)
    if not refused:
        vehicle.reboot()


def _no(vehicle: Vehicle) -> int:
    """Result by which the autopilot refuses what it could do at other times."""
    return int(vehicle.autopilot.behaviour.says_no)


def _arm(vehicle: Vehicle, command: ReceivedCommand) -> int:
    wanted = command.params[0]
    if wanted not in (0.0, 1.0):
        return int(DENIED)
    (vehicle.arm if wanted else vehicle.disarm)()
    return int(ACCEPTED)


def _set_mode(vehicle: Vehicle, command: ReceivedCommand) -> int:
    main, sub = command.whole(1), command.whole(2)
    return _change_mode(vehicle, command.whole(0, 0), vehicle.autopilot.modes.custom(Mode(main, sub)))


def _change_mode(vehicle: Vehicle, flags: int, custom: int) -> int:
    mode = _mode_of(vehicle, flags, custom)
    if mode is None:
        return _no(vehicle)
    return int(ACCEPTED) if vehicle.set_mode(mode) else _no(vehicle)


def _mode_of(vehicle: Vehicle, flags: int, custom: int) -> ModeName | None:
    """Mode by its custom number; without one by the flags, which only the specification's vehicle knows."""
    modes = vehicle.autopilot.modes
    if flags & ModeFlag.CUSTOM_MODE_ENABLED:
        return next((name for name, mode in modes.numbers.items() if modes.custom(mode) == custom), None)
    if not vehicle.autopilot.behaviour.modes_by_flags:
        return None
    if flags & ModeFlag.AUTO_ENABLED:
        return "auto"
    return "guided" if flags & ModeFlag.GUIDED_ENABLED else "manual"


def _set_mode_message(vehicle: Vehicle, who: Who, message: Message) -> None:
    result = _change_mode(vehicle, message.base_mode, message.custom_mode)
    if vehicle.autopilot.behaviour.acknowledges_set_mode:
        _acknowledge(vehicle, who, MessageId.SET_MODE, result)


def _set_current(vehicle: Vehicle, command: ReceivedCommand) -> int:
    """Make an item the current one; -1 means the present one, param2 1 resets all counts."""
    if not vehicle.autopilot.behaviour.jumps_by_command:
        return int(UNSUPPORTED)
    number = command.whole(0, -2)
    if number == -1:
        number = vehicle.auto.current
    return int(ACCEPTED if vehicle.auto.jump(number, vehicle.now_ns) else DENIED)


def _set_current_message(vehicle: Vehicle, message: Message) -> None:
    if not vehicle.auto.jump(message.seq, vehicle.now_ns):
        vehicle.text(f"Item {message.seq}: not in the mission")


def _start(vehicle: Vehicle, command: ReceivedCommand) -> int:
    first, habits = command.whole(0, 0), vehicle.autopilot.behaviour
    if first > 0 and not (habits.start_takes_item and vehicle.auto.jump(first, vehicle.now_ns)):
        return int(DENIED)
    if not vehicle.set_mode("auto"):
        return _no(vehicle)
    if habits.start_arms:
        vehicle.arm()
    return int(ACCEPTED)


def _pause(vehicle: Vehicle, command: ReceivedCommand) -> int:
    if not vehicle.autopilot.behaviour.pauses_by_command:
        return int(UNSUPPORTED)
    return int(ACCEPTED) if vehicle.set_mode("auto" if command.params[0] == 1 else "hold") else int(DENIED)


def _reposition(vehicle: Vehicle, command: ReceivedCommand) -> int:
    """Drive to a position: param1 speed (-1: unchanged), param2 1 may change the mode, param4 yaw in rad."""
    if not command.exact:
        return int(CommandResult.COMMAND_INT_ONLY)
    point, mode = vehicle.rover.point(command.x, command.y), vehicle.autopilot.driving.reposition_mode
    allowed = vehicle.mode == mode or command.whole(1, 0) & CHANGE_MODE
    if point is None or not vehicle.armed or not allowed:
        return int(DENIED)
    vehicle.set_mode(mode)
    vehicle.rover.set_speed(command.params[0])
    vehicle.target.go(point, _heading(vehicle, command.params[3]), vehicle.now_ns)
    return int(ACCEPTED)


def _heading(vehicle: Vehicle, yaw: float) -> float | None:
    """Heading counter-clockwise from east of a yaw from north; None if the vehicle does not turn to it."""
    turns = vehicle.autopilot.turns and math.isfinite(yaw) and abs(yaw) < 100
    return math.pi / 2 - yaw if turns else None


def _change_speed(vehicle: Vehicle, command: ReceivedCommand) -> int:
    drives = vehicle.auto.state == "active" or vehicle.target.goes_somewhere
    if vehicle.autopilot.behaviour.speed_while_driving and not drives:
        return int(FAILED)
    if not vehicle.rover.set_speed(command.params[1]):
        return int(DENIED)
    vehicle.target.restart(vehicle.now_ns)
    return int(ACCEPTED)


def _interval(vehicle: Vehicle, command: ReceivedCommand) -> int:
    return int(ACCEPTED) if vehicle.streams.set(command.whole(0), command.params[1]) else _no(vehicle)


def _report_interval(vehicle: Vehicle, command: ReceivedCommand) -> int:
    number = command.whole(0)
    if not 0 <= number < 2**16:
        return int(DENIED)
    vehicle.send(replies.message_interval(number, vehicle.streams.interval_us(number)))
    return int(ACCEPTED)


def _request(vehicle: Vehicle, command: ReceivedCommand) -> int:
    maker = telemetry.MAKERS.get(command.whole(0))
    return int(UNSUPPORTED) if maker is None else int(DENIED if maker(vehicle) is None else ACCEPTED)


def _report_version(vehicle: Vehicle, command: ReceivedCommand) -> int:
    vehicle.report(MessageId.AUTOPILOT_VERSION)
    return int(ACCEPTED)


def _report_home(vehicle: Vehicle, command: ReceivedCommand) -> int:
    return int(ACCEPTED) if vehicle.report(MessageId.HOME_POSITION) else _no(vehicle)


def _capture(vehicle: Vehicle, command: ReceivedCommand) -> int:
    """IMAGE_START_CAPTURE: param4 is the number; param2, the interval (unused for one picture), seconds."""
    vehicle.camera.triggers += 1
    return _scan(vehicle, command, command.whole(3, 0), command.params[1])


def _script_message(vehicle: Vehicle, command: ReceivedCommand) -> int:
    """DO_SEND_SCRIPT_MESSAGE: param1 is the message, param2 the number, param3 the seconds."""
    if Command.DO_SEND_SCRIPT_MESSAGE not in vehicle.autopilot.commands:
        return int(UNSUPPORTED)
    if command.whole(0) != SCAN_MESSAGE:
        return int(ACCEPTED)
    return _scan(vehicle, command, command.whole(1, 0), command.params[2])


def _stop_capture(vehicle: Vehicle, command: ReceivedCommand) -> int:
    """Break off the current scan, without a report."""
    vehicle.camera.stop()
    vehicle.auto.scan_over(vehicle.now_ns)
    return int(ACCEPTED)


def _scan(vehicle: Vehicle, command: ReceivedCommand, number: int, seconds: float) -> int:
    """Begin a scan; a repeated trigger of the current scan does not begin another."""
    same = number == vehicle.camera.under_way or (command.again and number == vehicle.camera.last)
    if number > 0 and same:
        return int(ACCEPTED)
    return int(ACCEPTED if vehicle.camera.begin(max(0, number), seconds, vehicle.now_ns) else REJECTED)


EXECUTED: dict[int, Callable[[Vehicle, ReceivedCommand], int]] = {
    Command.COMPONENT_ARM_DISARM: _arm,
    Command.DO_SET_MODE: _set_mode,
    Command.DO_SET_MISSION_CURRENT: _set_current,
    Command.MISSION_START: _start,
    Command.DO_PAUSE_CONTINUE: _pause,
    Command.DO_REPOSITION: _reposition,
    Command.DO_CHANGE_SPEED: _change_speed,
    Command.SET_MESSAGE_INTERVAL: _interval,
    Command.GET_MESSAGE_INTERVAL: _report_interval,
    Command.REQUEST_MESSAGE: _request,
    Command.REQUEST_AUTOPILOT_CAPABILITIES: _report_version,
    Command.GET_HOME_POSITION: _report_home,
    Command.IMAGE_START_CAPTURE: _capture,
    Command.IMAGE_STOP_CAPTURE: _stop_capture,
    Command.DO_SEND_SCRIPT_MESSAGE: _script_message,
}
"""Functions by command; each returns the MAV_RESULT with which it is acknowledged."""


def _set_origin(vehicle: Vehicle, message: Message) -> None:
    """Set the origin; a position that is not on the earth is ignored."""
    lat, lon = message.latitude / STEPS_PER_DEGREE, message.longitude / STEPS_PER_DEGREE
    if abs(lat) <= NORTHMOST and abs(lon) <= 180:
        vehicle.set_origin(SiteOrigin(lat=lat, lon=lon, alt=message.altitude / 1000, heading_deg=0.0))


def _override(vehicle: Vehicle, message: Message) -> None:
    mode = vehicle.remote_control.override([getattr(message, f"chan{nth}_raw") for nth in range(1, 9)])
    if mode is not None:
        vehicle.set_mode(mode)


def _target_local(vehicle: Vehicle, message: Message) -> None:
    vehicle.target.note_setpoint()
    if message.type_mask & IGNORE_X_Y == IGNORE_X_Y:
        return _turn(vehicle, message)
    east, north = message.y, message.x
    here = vehicle.motion().pose
    if message.coordinate_frame == LOCAL_OFFSET_NED:
        east, north = east + here.x, north + here.y
    elif message.coordinate_frame != LOCAL_NED:
        return
    if math.isfinite(east) and math.isfinite(north) and math.hypot(east, north) <= FAR_M:
        _guide(vehicle, message, (east, north))


def _target_global(vehicle: Vehicle, message: Message) -> None:
    vehicle.target.note_setpoint()
    point = vehicle.rover.point(message.lat_int, message.lon_int)
    if point is not None:
        _guide(vehicle, message, point)


def _turn(vehicle: Vehicle, message: Message) -> None:
    """Steer by a course without a position: a yaw, a velocity, or both. Accelerations are not followed."""
    if vehicle.mode != "guided" or not vehicle.armed:
        return
    course = COURSES[vehicle.autopilot.driving.courses](message)
    if course is not None and math.isfinite(course.heading) and abs(course.heading) < 100:
        vehicle.target.steer(course, vehicle.now_ns)


def _by_heading(message: Message) -> Course | None:
    """ArduPilot: it holds the yaw; the sign of vx is the direction, in any frame (GCS_MAVLink_Rover)."""
    speed = 0.0 if message.type_mask & IGNORE_VELOCITY else math.hypot(message.vx, message.vy)
    if message.type_mask & IGNORE_YAW:
        return None if speed == 0 else Course(math.atan2(message.vx, message.vy), speed)
    return Course(math.pi / 2 - message.yaw, math.copysign(speed, message.vx) if speed else 0.0)


def _by_vector(message: Message) -> Course | None:
    """PX4: it drives where the velocity points and ignores a yaw (DifferentialOffboardMode)."""
    if message.type_mask & IGNORE_VELOCITY:
        return None
    return Course(math.atan2(message.vx, message.vy), math.hypot(message.vx, message.vy))


COURSES = {"heading": _by_heading, "vector": _by_vector}


def _guide(vehicle: Vehicle, message: Message, point: tuple[float, float]) -> None:
    if vehicle.mode != "guided" or not vehicle.armed or message.type_mask & IGNORE_X_Y:
        return
    heading = None if message.type_mask & IGNORE_YAW else _heading(vehicle, message.yaw)
    vehicle.target.go(point, heading, vehicle.now_ns)
