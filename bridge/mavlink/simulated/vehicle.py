"""The vehicle: its parts put together, what it hears given to them, and what is due made to happen."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as dialect

from bridge.clock import Clock
from bridge.mavlink.simulated import orders, parameters, telemetry
from bridge.mavlink.simulated.course import Course, Tells
from bridge.mavlink.simulated.faults import NO_FAULTS, Mishaps, VehicleFaults
from bridge.mavlink.simulated.parameters import Parameters
from bridge.mavlink.simulated.profile import ModeName, Profile
from bridge.mavlink.simulated.rover import Rover
from bridge.mavlink.simulated.scanner import Captured, Scanner
from bridge.mavlink.simulated.store import MISSION, Store
from bridge.mavlink.simulated.transfers import Transfers
from bridge.mavlink.wire import Message, sender
from mission.document import Point, SiteOrigin
from mission.events import Pose
from mission.mavlink.autopilots import home_item
from mission.mavlink.items import Command, Frame, Item

BOOT_NS = KEEP_NS = LED_NS = 1_000_000_000
FOREVER_NS = 2**63
NOWHERE = Item(Command.NAV_WAYPOINT, Frame.GLOBAL)


@dataclass(frozen=True)
class Setting:
    """How a vehicle is set up."""

    profile: Profile
    state: Path | None = None
    origin: SiteOrigin | None = None
    """Its global origin from the start; else none until a station sets it."""
    at: Pose | None = None
    """Where it stands, x to the east and y to the north of the origin; else where it last stood."""
    faults: VehicleFaults = NO_FAULTS


class Vehicle:
    """Everything happens in the thread that calls `receive` and `advance`.

    Parameters
    ----------
    clock
        The run's, which may be sped up.
    wall
        The stations': timeouts of the mission protocol and telemetry.
    say
        Sends a message.
    """

    def __init__(
        self, setting: Setting, *, clock: Clock, wall: Clock, say: Callable[[Message], None]
    ) -> None:
        self.profile = setting.profile
        self._setting, self._clock, self._wall, self._say_out = setting, clock, wall, say
        self._mishaps = Mishaps(setting.faults)
        self._booted_ns = clock.now_ns()
        self._quiet_until_ns = self._kept_ns = 0
        self._led_ns = -LED_NS
        self._guided: tuple[Point, float | None] | None = None
        self.now_ns = self._booted_ns
        """The time of what is happening."""
        self.mode: ModeName = "manual"
        self.armed = False
        self.reached: int | None = None
        """The item reached last."""
        self.captured: dict[int, Message] = {}
        """What was said of each scan since the boot, by its number."""
        self.last_scan = 0
        """The number of the scan begun last."""
        self.store = Store(setting.state)
        rule = self.profile.autopilot.rule
        self.rover = Rover(self.store, rule=rule, origin=setting.origin, at=setting.at)
        self.scanner = Scanner(self._mishaps)
        tells = Tells(
            current=self._went_on,
            reached=self._reach, trigger=self._triggered, finished=self._finish, reboot=self.reboot,
            text=self.text,
        )  # fmt: skip
        self.course = Course(self.profile, self.store, self.rover, self.scanner, self._mishaps, tells)
        self.streams = telemetry.Streams(wall)
        self.parameters = Parameters(
            self.profile.name, speed=self.rover.speed, set_speed=self.rover.set_speed
        )
        self.transfers = Transfers(
            self.profile, self.store, wall, say=self.say, text=self.text, home=self._home,
            stored=self._stored, running=lambda: self.course.state == "active", event=self._item_came,
            mishaps=self._mishaps,
        )  # fmt: skip
        self._handlers = {
            **self.transfers.handlers,
            **parameters.answer(self.parameters, self.say),
            **orders.handlers(self),
        }

    # What it hears, and the time

    def receive(self, message: Message) -> None:
        """Do what a message asks; those it does not know are ignored."""
        self.advance()
        handler = self._handlers.get(message.get_type())
        if handler is not None and not self._quiet():
            handler(sender(message), message)

    def advance(self) -> None:
        """Let happen whatever is due by now, in its order, and tell what is to be told."""
        until_ns = self._clock.now_ns()
        while (due_ns := self._next_ns()) is not None and due_ns <= until_ns:
            self.now_ns = max(self.now_ns, due_ns)
            if self.scanner.scan is not None and self.scanner.scan.ends_ns <= due_ns:
                self._scanned()
            else:
                self.course.step()
        self.now_ns = max(self.now_ns, until_ns)
        self._keep()
        if self._quiet():
            return
        if self.mode == "guided" and self.profile.streams and not self._is_led():
            self.text("Offboard: setpoints lost")
            self.set_mode("hold")
        self.transfers.tick()
        for number in self.streams.due():
            self.tell(number)

    def rest(self) -> None:
        """Write down where it stands, before it is switched off."""
        self.rover.keep(self.now_ns)

    # What it tells

    def say(self, message: Message) -> None:
        if not self._quiet():
            self._say_out(message)

    def tell(self, number: int) -> bool:
        """Send the message with that number as it is now; false if there is nothing to tell."""
        made = telemetry.MAKERS[number](self)
        if made is not None:
            self.say(made)
        return made is not None

    def text(self, text: str) -> None:
        self.say(dialect.MAVLink_statustext_message(dialect.MAV_SEVERITY_NOTICE, text.encode()[:50]))

    def motion(self) -> tuple[Pose, float]:
        return self.rover.at(self.now_ns)

    @property
    def boot_ms(self) -> int:
        return (self.now_ns - self._booted_ns) // 1_000_000 & 0xFFFFFFFF

    @property
    def alt_mm(self) -> int:
        return 0 if self.rover.origin is None else round(self.rover.origin.alt * 1000)

    @property
    def battery(self) -> float:
        """0 to 1."""
        used = (self.now_ns - self._booted_ns) / telemetry.BATTERY_NS
        return max(0.0, 1.0 - used)

    # What it can be told to do

    def set_mode(self, mode: ModeName) -> bool:
        """Change the mode; false if it cannot be."""
        if mode == "auto" and not self.course.total:
            self.text("No mission")
            return False
        if mode == self.mode:
            return True
        if mode == "guided" and self.profile.streams and not self._is_led():
            self.text("Offboard: no setpoints")
            return False
        self.mode, self._guided = mode, None
        self.course.stand(self.now_ns)
        self.rover.brake(self.now_ns)
        if mode == "auto" and self.armed:
            self.course.go_on(self.now_ns)
        self.tell(dialect.MAVLINK_MSG_ID_HEARTBEAT)
        return True

    def arm(self) -> None:
        was, self.armed = self.armed, True
        if self.mode == "auto" and not was:
            self.course.go_on(self.now_ns)
        self.tell(dialect.MAVLINK_MSG_ID_HEARTBEAT)

    def disarm(self) -> None:
        """Stand still; the mission begins anew next time."""
        self.armed, self._guided = False, None
        self.course.stand(self.now_ns)
        self.rover.brake(self.now_ns)
        self.course.reset()
        self.tell(dialect.MAVLINK_MSG_ID_HEARTBEAT)

    def set_origin(self, origin: SiteOrigin) -> None:
        """Take a global origin; ArduPilot takes one per boot, and says nothing about others."""
        if self.rover.origin is not None and not self.profile.origin_again:
            return
        self.rover.origin = origin
        self.tell(dialect.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
        self.tell(dialect.MAVLINK_MSG_ID_HOME_POSITION)
        if self.course.state == "active":
            self.course.jump(self.course.current, self.now_ns)

    def scan(self, number: int, seconds: float) -> bool:
        """Begin a scan; false if one is under way. 0 seconds: as the parameter says."""
        index = self.store.kept.images
        lasts = seconds if seconds > 0 else self.parameters.scan_s
        begun = self.scanner.begin(number, lasts, index=index, pose=self.motion()[0], now_ns=self.now_ns)
        if begun:
            self.store.keep(images=index + 1)
            self.last_scan = number
        return begun

    def guide(self, point: Point, heading: float | None) -> None:
        """Drive to a point that a station leads it to; the same one again changes nothing."""
        if (point, heading) != self._guided:
            self._guided = (point, heading)
            self.rover.drive(point, self.now_ns, heading=heading)

    def turn(self, heading: float) -> None:
        """Turn on the spot to a heading that a station leads it to."""
        here = self.motion()[0]
        if self._guided is None or self._guided[1] != heading:
            self._guided = ((here.x, here.y), heading)
            self.rover.drive((here.x, here.y), self.now_ns, heading=heading)

    def led(self) -> None:
        """A setpoint has come: somebody is leading the vehicle."""
        self._led_ns = self._wall.now_ns()

    def change_speed(self, speed: float) -> bool:
        """From now on where it is led, from the next leg on in AUTO; false if that is no speed for it."""
        if not self.rover.set_speed(speed):
            return False
        if self._guided is not None:
            self.rover.drive(self._guided[0], self.now_ns, heading=self._guided[1])
        return True

    @property
    def goes_somewhere(self) -> bool:
        """Whether it drives its mission, or is led to a place."""
        return self.course.state == "active" or self._guided is not None

    def requested(self, number: int, index: int) -> None:
        """Send a message that was asked for, if there is something to tell; an older scan's by its number."""
        if number == dialect.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED and index in self.captured and index > 0:
            self.say(self.captured[index])
        elif number in telemetry.MAKERS:
            self.tell(number)

    def break_off(self) -> None:
        """End the scan under way, if there is one, without a result."""
        self.scanner.stop()
        self.course.scan_over(self.now_ns)

    def reboot(self) -> None:
        """Be away for a while, then wake up with the items but without mode, origin or current item."""
        self.rover.brake(self.now_ns)
        self.rover.origin = self._setting.origin
        self.armed, self.mode, self.reached, self.captured = False, "manual", None, {}
        self.course.stand(self.now_ns)
        self.course.reset()
        self.scanner.stop()
        self.transfers.reset()
        self.streams = telemetry.Streams(self._wall)
        self._booted_ns = self.now_ns
        self._quiet_until_ns = self._wall.now_ns() + BOOT_NS

    # What happens to it

    def _next_ns(self) -> int | None:
        scan, course_ns = self.scanner.scan, self.course.due_ns
        if scan is None or course_ns is None:
            return course_ns if scan is None else scan.ends_ns
        return min(scan.ends_ns, course_ns)

    def _is_led(self) -> bool:
        return self._wall.now_ns() - self._led_ns <= LED_NS

    def _keep(self) -> None:
        """Write down where it stands, by the wall's clock, for the disk's sake."""
        wall_ns = self._wall.now_ns()
        if wall_ns >= self._kept_ns + KEEP_NS:
            self._kept_ns = wall_ns
            self.rover.keep(self.now_ns)

    def _quiet(self) -> bool:
        return self._wall.now_ns() < self._quiet_until_ns

    def _went_on(self, number: int) -> None:
        self.tell(dialect.MAVLINK_MSG_ID_MISSION_CURRENT)

    def _reach(self, number: int) -> None:
        self.reached = number
        self.tell(dialect.MAVLINK_MSG_ID_MISSION_ITEM_REACHED)

    def _triggered(self, number: int, seconds: float, now_ns: int) -> None:
        self.now_ns = max(self.now_ns, now_ns)
        if not self.scan(number, seconds):
            self.text(f"Scan {number}: the scanner is busy")

    def _finish(self, now_ns: int) -> None:
        self.text("Mission Complete")
        self.tell(dialect.MAVLINK_MSG_ID_MISSION_CURRENT)
        if self.profile.done_mode != self.mode:
            self.mode = self.profile.done_mode
            self.tell(dialect.MAVLINK_MSG_ID_HEARTBEAT)

    def _scanned(self) -> None:
        done = self.scanner.end(self.motion()[0])
        if done.why:
            self.text(f"Scan {done.number}: {done.why}")
        self.captured[done.index] = message = self._capture_message(done)
        self.say(message)
        self.course.scan_over(self.now_ns)

    def _capture_message(self, done: Captured) -> Message:
        pose = self.motion()[0]
        lat, lon = self.rover.place((pose.x, pose.y))
        half = math.pi / 4 - pose.heading / 2
        facing = (math.cos(half), 0.0, 0.0, math.sin(half))
        return dialect.MAVLink_camera_image_captured_message(
            self.boot_ms, self.now_ns // 1000, 0, lat, lon, self.alt_mm, 0, facing, done.index,
            1 if done.file_url else 0, done.file_url.encode(),
        )  # fmt: skip

    def _home(self) -> Item:
        return home_item(self.rover.origin) if self.rover.origin else NOWHERE

    def _stored(self, kind: int, marked: int | None) -> None:
        if kind == MISSION:
            self.course.replaced(marked, self.now_ns)
            self.tell(dialect.MAVLINK_MSG_ID_MISSION_CURRENT)

    def _item_came(self, number: int) -> bool:
        """Whether an upload's item gets through what the faults have in store for it."""
        silent = self._mishaps.once("silent", number)
        if silent:
            lasts_ns = round(silent.amount * 1e9) or FOREVER_NS
            self._quiet_until_ns = self._wall.now_ns() + lasts_ns
        if self._mishaps.once("reboot-upload", number):
            self.reboot()
        return not self._quiet()
