"""The vehicle: its parts put together, what it hears given to them, and what is due made to happen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.line.wire import Who, sender
from stopgo.bridge.mavlink.simulated import parameters, replies
from stopgo.bridge.mavlink.simulated.auto_mission import AutoEvents, AutoMission
from stopgo.bridge.mavlink.simulated.camera import Camera
from stopgo.bridge.mavlink.simulated.estimator import Estimate
from stopgo.bridge.mavlink.simulated.exact_drive import ExactDrive
from stopgo.bridge.mavlink.simulated.guided_target import GuidedTarget
from stopgo.bridge.mavlink.simulated.parameters import Parameters
from stopgo.bridge.mavlink.simulated.real_drive import RealDrive
from stopgo.bridge.mavlink.simulated.rover import STANDING, Rover
from stopgo.bridge.mavlink.simulated.steering import LAWS
from stopgo.bridge.mavlink.simulated.streams import Streams
from stopgo.bridge.mavlink.simulated.transfers import Transfers
from stopgo.bridge.mavlink.simulated.tuning import Tuning
from stopgo.bridge.mavlink.simulated.vehicle_faults import NO_FAULTS, Mishaps, VehicleFaults
from stopgo.bridge.mavlink.simulated.vehicle_store import MISSION, Store
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots.kind import Autopilot, ModeName
from stopgo.mission.mavlink.enums import MessageId
from stopgo.mission.mavlink.items import Command, Item, MavFrame
from stopgo.mission.mavlink.read_back import home_item
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.run.events import Pose

BOOT_NS = KEEP_NS = 1_000_000_000
FOREVER_NS = 2**63
PATIENCE_S = 1.0
BATTERY_NS = 6 * 3600 * 10**9
"""A full battery lasts six hours."""
NOWHERE = Item(Command.NAV_WAYPOINT, MavFrame.GLOBAL)


Maker = Callable[["Vehicle"], Message | None]
"""The message as it is now; None if there is nothing to tell."""
Handlers = dict[str, Callable[[Who, Message], None]]
"""What to do with each message that is heard."""


@dataclass(frozen=True)
class Setting:
    """How a vehicle is set up."""

    autopilot: Autopilot
    state: Path | None = None
    origin: SiteOrigin | None = None
    """Its global origin from the start; else none until a station sets it."""
    at: Pose | None = None
    """Where it stands, x to the east and y to the north of the origin; else where it last stood."""
    faults: VehicleFaults = NO_FAULTS
    seed: int | None = 1
    """It drives as a real one, by chances of this seed, if it is known how its kind does; `None`: exactly."""
    changed: Mapping[str, float] = field(default_factory=dict)
    """Parameters that are not as by default."""


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
    makers
        All that it can tell of itself, by the message's number.
    orders
        What it does with each message that is an order.
    """

    def __init__(
        self, setting: Setting, *, clock: Clock, wall: Clock, say: Callable[[Message], None],
        makers: Mapping[int, Maker], orders: Callable[[Vehicle], Handlers],
    ) -> None:  # fmt: skip
        self.autopilot = setting.autopilot
        self._setting, self._clock, self._wall, self._say_out = setting, clock, wall, say
        self._makers = makers
        self._mishaps = Mishaps(setting.faults)
        self._booted_ns = clock.now_ns()
        # Frames overtake each other in the wall's time: a faster one would seem to go back by a reboot.
        self._told_clock = wall if setting.faults.any("jitter") else None
        self._told_from_ns = wall.now_ns()
        self._quiet_until_ns = self._kept_ns = 0
        self._made_ns = wall.now_ns()
        self.now_ns = self._booted_ns
        """The time of what is happening."""
        self.mode: ModeName = "manual"
        self.armed = False
        self.failsafe = False
        """It holds because it heard no setpoints, and nobody has ordered anything since."""
        self.reached: int | None = None
        """The item reached last."""
        self.store = Store(setting.state)
        rule = self.autopilot.rule
        driving = self.autopilot.driving
        self._tuning = tuning = Tuning(self.autopilot.name, **setting.changed)
        self.rover = Rover(self.store, self._drive(tuning), rule=rule, origin=setting.origin)
        self.target = GuidedTarget(
            self.rover, wall, patience_s=lambda: tuning.values.get(driving.gives_up_parameter, PATIENCE_S)
        )
        self.parameters = Parameters(
            self.autopilot.behaviour, tuning, speed=self.rover.speed, set_speed=self.rover.set_speed
        )
        self.camera = Camera(self.store, self.rover, self._mishaps, default_s=lambda: self.parameters.scan_s)
        tells = AutoEvents(
            current=self._went_on, reached=self._reach, trigger=self._triggered, finished=self._finish,
            reboot=self.reboot, text=self.text,
        )  # fmt: skip
        self.auto = AutoMission(self.autopilot, self.store, self.rover, self.camera, self._mishaps, tells)
        self.streams = Streams(wall, makers)
        self.transfers = Transfers(
            self.autopilot, self.store, wall, say=self.say, text=self.text, home=self._home,
            stored=self._stored, running=lambda: self.auto.state == "active", event=self._item_came,
            mishaps=self._mishaps,
        )  # fmt: skip
        self._handlers = {
            **self.transfers.handlers,
            **parameters.answer(self.parameters, self.say),
            **orders(self),
        }

    def _drive(self, tuning: Tuning) -> ExactDrive | RealDrive:
        pose, seed = self._setting.at or self.store.kept.pose or STANDING, self._setting.seed
        real = seed is not None and self.autopilot.name in LAWS
        return RealDrive(self.autopilot.name, tuning, pose, seed=seed or 0) if real else ExactDrive(pose)

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
            if self.camera.due_ns is not None and self.camera.due_ns <= due_ns:
                self._scanned()
            else:
                self.auto.step()
        self.now_ns = max(self.now_ns, until_ns)
        self._keep()
        self._suffer()
        if self.target.overdue:
            self.text("target not received, stopping")
            self.target.forget()
            self.rover.brake(self.now_ns)
        self._look_for_setpoints()
        if self._quiet():
            return
        self.transfers.tick()
        for number in self.streams.due():
            self.tell(number)

    def _look_for_setpoints(self) -> None:
        """One that lives on them holds without them, and goes on by itself once they come again."""
        if self.failsafe and self.target.fresh:
            self.set_mode("guided")
        if self.mode == "guided" and self.autopilot.driving.streams and not self.target.fresh:
            self.text("Offboard: setpoints lost")
            self.set_mode("hold", by_failsafe=True)

    def rest(self) -> None:
        """Write down where it stands, before it is switched off."""
        self.rover.keep(self.now_ns)

    # What it tells

    def say(self, message: Message) -> None:
        if not self._quiet():
            self._say_out(message)

    def tell(self, number: int) -> bool:
        """Send the message with that number as it is now; false if there is nothing to tell."""
        made = self._makers[number](self)
        if made is not None:
            self.say(made)
        return made is not None

    def text(self, text: str) -> None:
        self.say(replies.text(text))

    def motion(self) -> Estimate:
        """Where it believes it is, and how it moves."""
        return self.rover.told(self.now_ns)

    @property
    def boot_ms(self) -> int:
        up_ns = self.now_ns - self._booted_ns
        if self._told_clock is not None:
            up_ns = self._told_clock.now_ns() - self._told_from_ns
        return up_ns // 1_000_000 & 0xFFFFFFFF

    @property
    def battery(self) -> float:
        """0 to 1."""
        used = (self.now_ns - self._booted_ns) / BATTERY_NS
        return max(0.0, 1.0 - used)

    # What it can be told to do

    def set_mode(self, mode: ModeName, *, by_failsafe: bool = False) -> bool:
        """Change the mode; false if it cannot be."""
        if mode == "auto" and not self.auto.total:
            self.text("No mission")
            return False
        if mode == self.mode:
            self.failsafe = self.failsafe and by_failsafe
            return True
        if mode == "guided" and self.autopilot.driving.streams and not self.target.fresh:
            self.text("Offboard: no setpoints")
            return False
        self.mode, self.failsafe = mode, by_failsafe
        self.target.forget()
        self.auto.stand(self.now_ns)
        self.rover.brake(self.now_ns)
        if mode == "auto" and self.armed:
            self.auto.go_on(self.now_ns)
        self.tell(MessageId.HEARTBEAT)
        return True

    @property
    def is_unplaced(self) -> bool:
        """Whether its origin is of no use to it."""
        return self._setting.faults.any("unplaced") is not None

    @property
    def refuses_arming(self) -> str:
        """Why it does not let itself be armed; empty if it does."""
        settled_s = self._tuning.values.get("SIM_ARM_AFTER", 0.0)
        return "Arm: Accels inconsistent" if self.boot_ms < 1000 * settled_s else ""

    def arm(self) -> None:
        was, self.armed = self.armed, True
        if self.mode == "auto" and not was:
            self.auto.go_on(self.now_ns)
        self.tell(MessageId.HEARTBEAT)

    def disarm(self) -> None:
        """Stand still; the mission begins anew next time."""
        self.armed = False
        self.target.forget()
        self.auto.stand(self.now_ns)
        self.rover.brake(self.now_ns)
        self.auto.reset()
        self.tell(MessageId.HEARTBEAT)

    def set_origin(self, origin: SiteOrigin) -> None:
        """Take a global origin; ArduPilot takes one per boot, and says nothing about others."""
        if self.rover.origin is not None and not self.autopilot.behaviour.origin_again:
            return
        self.rover.origin = origin
        self.tell(MessageId.GPS_GLOBAL_ORIGIN)
        self.tell(MessageId.HOME_POSITION)
        if self.auto.state == "active":
            self.auto.jump(self.auto.current, self.now_ns)

    def requested(self, number: int, index: int) -> None:
        """Send a message that was asked for, if there is something to tell; an older scan's by its number."""
        if number == MessageId.CAMERA_IMAGE_CAPTURED and index > 0 and index in self.camera.told:
            self.say(self.camera.told[index])
        elif number in self._makers:
            self.tell(number)

    def break_off(self) -> None:
        """End the scan under way, if there is one, without a result."""
        self.camera.stop()
        self.auto.scan_over(self.now_ns)

    def reboot(self) -> None:
        """Be away for a while, then wake up with the items but without mode, origin or current item."""
        self.rover.brake(self.now_ns)
        self.rover.origin = self._setting.origin
        self.armed, self.mode, self.failsafe, self.reached = False, "manual", False, None
        self.target.forget()
        self.auto.stand(self.now_ns)
        self.auto.reset()
        self.camera.reset()
        self.transfers.reset()
        self.streams = Streams(self._wall, self._makers)
        self._booted_ns = self.now_ns
        self._told_from_ns = self._wall.now_ns()
        self._quiet_until_ns = self._wall.now_ns() + BOOT_NS

    # What happens to it

    def _next_ns(self) -> int | None:
        dues = [due_ns for due_ns in (self.camera.due_ns, self.auto.due_ns) if due_ns is not None]
        return min(dues, default=None)

    def _keep(self) -> None:
        """Write down where it stands, by the wall's clock, for the disk's sake."""
        wall_ns = self._wall.now_ns()
        if wall_ns >= self._kept_ns + KEEP_NS:
            self._kept_ns = wall_ns
            self.rover.keep(self.now_ns)

    def _suffer(self) -> None:
        """What goes wrong at a time happens."""
        up_s = (self._wall.now_ns() - self._made_ns) / 1e9
        for jump in self._mishaps.by("jump", up_s):
            self.rover.motion.jump(jump.amount, self.now_ns)
        for gap in self._mishaps.by("gap", up_s):
            self._quiet_until_ns = self._wall.now_ns() + round(gap.amount * 1e9)
        for restart in self._mishaps.by("restart", up_s):
            self.reboot()
            self._quiet_until_ns += round(restart.amount * 1e9)

    def _quiet(self) -> bool:
        return self._wall.now_ns() < self._quiet_until_ns

    def _went_on(self, number: int) -> None:
        self.tell(MessageId.MISSION_CURRENT)

    def _reach(self, number: int) -> None:
        self.reached = number
        self.tell(MessageId.MISSION_ITEM_REACHED)

    def _triggered(self, number: int, seconds: float, now_ns: int) -> None:
        self.now_ns = max(self.now_ns, now_ns)
        if not self.camera.begin(number, seconds, self.now_ns):
            self.text(f"Scan {number}: the scanner is busy")

    def _finish(self, now_ns: int) -> None:
        self.text("Mission Complete")
        self.tell(MessageId.MISSION_CURRENT)
        if self.autopilot.behaviour.done_mode != self.mode:
            self.mode = self.autopilot.behaviour.done_mode
            self.tell(MessageId.HEARTBEAT)

    def _scanned(self) -> None:
        message, why = self.camera.end(self.now_ns, self.boot_ms)
        if why:
            self.text(why)
        self.say(message)
        self.auto.scan_over(self.now_ns)

    def _home(self) -> Item:
        return home_item(self.rover.origin) if self.rover.origin else NOWHERE

    def _stored(self, kind: int, marked: int | None) -> None:
        if kind == MISSION:
            self.auto.replaced(marked, self.now_ns)
            self.tell(MessageId.MISSION_CURRENT)

    def _item_came(self, number: int) -> bool:
        """Whether an upload's item gets through what the faults have in store for it."""
        silent = self._mishaps.once("silent", number)
        if silent:
            lasts_ns = round(silent.amount * 1e9) or FOREVER_NS
            self._quiet_until_ns = self._wall.now_ns() + lasts_ns
        if self._mishaps.once("reboot-upload", number):
            self.reboot()
        return not self._quiet()
