"""The simulated vehicle: it joins its parts, passes messages to them, and brings about events when due."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.simulated import replies
from stopgo.bridge.mavlink.simulated.auto_mission import AutoEvents, AutoMission
from stopgo.bridge.mavlink.simulated.camera import Camera
from stopgo.bridge.mavlink.simulated.estimator import Estimate
from stopgo.bridge.mavlink.simulated.exact_drive import ExactDrive
from stopgo.bridge.mavlink.simulated.guided_target import GuidedTarget
from stopgo.bridge.mavlink.simulated.lasting_failsafes import LastingFailsafes
from stopgo.bridge.mavlink.simulated.parameters import Parameters, parameter_handlers
from stopgo.bridge.mavlink.simulated.real_drive import RealDrive
from stopgo.bridge.mavlink.simulated.remote_control import RemoteControl
from stopgo.bridge.mavlink.simulated.rover import STANDING, Rover
from stopgo.bridge.mavlink.simulated.steering import LAWS
from stopgo.bridge.mavlink.simulated.streams import Streams
from stopgo.bridge.mavlink.simulated.transfers import Transfers
from stopgo.bridge.mavlink.simulated.tuning import Tuning
from stopgo.bridge.mavlink.simulated.vehicle_clock import VehicleClock
from stopgo.bridge.mavlink.simulated.vehicle_faults import Mishaps, VehicleFaults
from stopgo.bridge.mavlink.simulated.vehicle_store import MISSION, Store
from stopgo.bridge.mavlink.vehicle_link.wire import Who, sender
from stopgo.bridge.robot.simulated_faults import NO_FAULTS
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots.kind import Autopilot, ModeName
from stopgo.mission.mavlink.enums import MessageId
from stopgo.mission.mavlink.items import Command, Item, MavFrame
from stopgo.mission.mavlink.read_back import home_item
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.run.events import Pose

SAVE_NS = 1_000_000_000
FOREVER_NS = 2**63
STEP_S, LONGEST_STEP_S = 0.02, 0.1
"""Shortest and longest time for which it waits for a message before it looks after its own affairs."""
PATIENCE_S = 1.0
BATTERY_NS = 6 * 3600 * 10**9
"""A full battery lasts six hours."""
NOWHERE = Item(Command.NAV_WAYPOINT, MavFrame.GLOBAL)

Maker = Callable[["Vehicle"], Message | None]
"""The message as it is now; None if there is nothing to report."""
Handlers = dict[str, Callable[[Who, Message], None]]
"""Handler of each message by its name."""


@dataclass(frozen=True)
class VehicleSetup:
    """Setup of a simulated vehicle."""

    autopilot: Autopilot
    state: Path | None = None
    origin: SiteOrigin | None = None
    """Its global origin from the start; `None`: none until a station sets it."""
    at: Pose | None = None
    """Its pose, x to the east and y to the north of the origin; `None`: its last pose."""
    faults: VehicleFaults = NO_FAULTS
    seed: int | None = 1
    """Seed of chance for realistic driving, if its kind has a model of that; `None`: exact driving."""
    changed: Mapping[str, float] = field(default_factory=dict)
    """Parameters that differ from the default."""


class Vehicle:
    """Everything happens in the thread that calls `receive` and `advance`.

    Parameters
    ----------
    clock
        The run's, which may be sped up.
    wall
        The stations': timeouts of the mission protocol and telemetry.
    send
        Sends a message.
    makers
        Makers of all messages that it can send about itself, by the message's number.
    events
        Reports of its mission in AUTO.
    commands
        Handlers of the messages that command it.
    """

    def __init__(
        self, setup: VehicleSetup, *, clock: Clock, wall: Clock, send: Callable[[Message], None],
        makers: Mapping[int, Maker], events: Callable[[Vehicle], AutoEvents],
        commands: Callable[[Vehicle], Handlers],
    ) -> None:  # fmt: skip
        self.autopilot = autopilot = setup.autopilot
        self._setup, self._wall, self._transmit, self._makers = setup, wall, send, makers
        self._mishaps, self._saved_ns = Mishaps(setup.faults), 0
        self.time = VehicleClock(clock, wall, boots_by_wall=setup.faults.any("jitter") is not None)
        self.mode: ModeName = "manual"
        self.armed = False
        self.failsafe = False
        """True while it holds because setpoints were missing, and no command has come since."""
        self.failsafes, self.remote_control = LastingFailsafes(setup.faults), RemoteControl()
        self.reached: int | None = None
        """The item reached last."""
        self.store = Store(setup.state)
        self._tuning = tuning = Tuning(autopilot.name, **setup.changed)
        self.rover = Rover(self.store, self._drive(tuning), rule=autopilot.rule, origin=setup.origin)
        timeout = autopilot.driving.gives_up_parameter
        self.target = GuidedTarget(
            self.rover, wall, patience_s=lambda: tuning.values.get(timeout, PATIENCE_S)
        )
        self.parameters = Parameters(
            autopilot.behaviour, tuning, speed=self.rover.speed, set_speed=self.rover.set_speed
        )
        self.camera = Camera(self.store, self.rover, self._mishaps, default_s=lambda: self.parameters.scan_s)
        self.auto = AutoMission(autopilot, self.store, self.rover, self.camera, self._mishaps, events(self))
        self.streams = Streams(wall, makers)
        self.transfers = Transfers(
            autopilot, self.store, wall, send=self.send, text=self.text, home=lambda: _home_of(self.rover),
            stored=self._stored, running=lambda: self.auto.state == "active", event=self._item_arrives,
            mishaps=self._mishaps,
        )  # fmt: skip
        self._handlers = {
            **self.transfers.handlers,
            **parameter_handlers(self.parameters, self.send),
            **commands(self),
        }

    @property
    def now_ns(self) -> int:
        """Time of the present event."""
        return self.time.now_ns

    def _drive(self, tuning: Tuning) -> ExactDrive | RealDrive:
        pose, seed = self._setup.at or self.store.stored.pose or STANDING, self._setup.seed
        real = seed is not None and self.autopilot.name in LAWS
        return RealDrive(self.autopilot.name, tuning, pose, seed=seed or 0) if real else ExactDrive(pose)

    # Messages in, and time

    def receive(self, message: Message) -> None:
        """Carry out a message; an unknown one is ignored."""
        self.advance()
        handler = self._handlers.get(message.get_type())
        if handler is not None and not self.time.is_silent:
            handler(sender(message), message)

    def advance(self) -> None:
        """Bring about all events that are due by now, in their order, and send the messages that are due."""
        until_ns = self.time.run_ns
        while (due_ns := self._next_ns()) is not None and due_ns <= until_ns:
            self.time.advance(due_ns)
            if self.camera.due_ns is not None and self.camera.due_ns <= due_ns:
                self._end_scan()
            else:
                self.auto.step()
        self.time.advance(until_ns)
        self._save_pose_at_times()
        self._apply_timed_faults()
        if self.target.overdue:
            self.text("target not received, stopping")
            self.target.forget()
            self.rover.brake(self.now_ns)
        self._check_setpoints()
        if self.time.is_silent:
            return
        self.transfers.tick()
        for number in self.streams.due():
            self.report(number)

    @property
    def wait_s(self) -> float:
        """Time for which it has nothing to do but to wait for messages."""
        if self._next_ns() is not None or self.transfers.running:
            return STEP_S
        return min(max(STEP_S, self.streams.wait_s()), LONGEST_STEP_S)

    def _check_setpoints(self) -> None:
        """Hold if an autopilot that needs setpoints has none, and go on once they come again."""
        if self.failsafe and self.target.fresh:
            self.set_mode("guided")
        if self.mode == "guided" and self.autopilot.driving.streams and not self.target.fresh:
            self.text("Offboard: setpoints lost")
            self.set_mode("hold", by_failsafe=True)

    def save_pose(self) -> None:
        """Save the pose, before the vehicle is switched off."""
        self.rover.save_pose(self.now_ns)

    # Messages out

    def send(self, message: Message) -> None:
        if not self.time.is_silent:
            self._transmit(message)

    def report(self, number: int) -> bool:
        """Send the message with that number as it is now; false if there is nothing to report."""
        made = self._makers[number](self)
        if made is not None:
            self.send(made)
        return made is not None

    def text(self, text: str) -> None:
        self.send(replies.text(text))

    def motion(self) -> Estimate:
        """Estimated pose and speed."""
        return self.rover.estimate(self.now_ns)

    @property
    def battery(self) -> float:
        """0 to 1."""
        used = self.time.up_ns / BATTERY_NS
        return max(0.0, 1.0 - used)

    # Commands

    def set_mode(self, mode: ModeName, *, by_failsafe: bool = False) -> bool:
        """Change the mode; false if that is refused."""
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
        self.auto.pause(self.now_ns)
        self.rover.brake(self.now_ns)
        if mode == "auto" and self.armed:
            self.auto.go_on(self.now_ns)
        self.report(MessageId.HEARTBEAT)
        return True

    @property
    def camera_is_apart(self) -> bool:
        """True if its scanner is a component of its own, which has the pictures and counts them itself."""
        return self._setup.faults.any("camera") is not None

    @property
    def is_unplaced(self) -> bool:
        """True if its origin is of no use to it."""
        return self._setup.faults.any("unplaced") is not None

    @property
    def refuses_arming(self) -> str:
        """Reason why it refuses to be armed; empty if it does not."""
        settled_s = self._tuning.values.get("SIM_ARM_AFTER", 0.0)
        return "Arm: Accels inconsistent" if self.time.boot_ms < 1000 * settled_s else ""

    def arm(self) -> None:
        was, self.armed = self.armed, True
        if self.mode == "auto" and not was:
            self.auto.go_on(self.now_ns)
        self.report(MessageId.HEARTBEAT)

    def disarm(self) -> None:
        """Stop; the mission begins again next time."""
        self.armed = False
        self.target.forget()
        self.auto.pause(self.now_ns)
        self.rover.brake(self.now_ns)
        self.auto.reset()
        self.report(MessageId.HEARTBEAT)

    def set_origin(self, origin: SiteOrigin) -> None:
        """Take a global origin; ArduPilot takes one per boot, and ignores others silently."""
        if self.rover.origin is not None and not self.autopilot.behaviour.origin_again:
            return
        self.rover.origin = origin
        self.report(MessageId.GPS_GLOBAL_ORIGIN)
        self.report(MessageId.HOME_POSITION)
        if self.auto.state == "active":
            self.auto.jump(self.auto.current, self.now_ns)

    def reboot(self) -> None:
        """Be silent for a while, then boot with the items but without mode, origin or current item."""
        self.rover.brake(self.now_ns)
        self.rover.origin = self._setup.origin
        self.armed, self.mode, self.failsafe, self.reached = False, "manual", False, None
        self.target.forget()
        self.auto.pause(self.now_ns)
        self.auto.reset()
        self.camera.reset(is_apart=self.camera_is_apart)
        self.failsafes.reset()
        self.transfers.reset()
        self.streams = Streams(self._wall, self._makers)
        self.time.boot()

    # Events

    def _next_ns(self) -> int | None:
        dues = [due_ns for due_ns in (self.camera.due_ns, self.auto.due_ns) if due_ns is not None]
        return min(dues, default=None)

    def _save_pose_at_times(self) -> None:
        """Save the pose once a second of the wall's time: more would wear the disk."""
        wall_ns = self.time.wall_ns
        if wall_ns >= self._saved_ns + SAVE_NS:
            self._saved_ns = wall_ns
            self.save_pose()

    def _apply_timed_faults(self) -> None:
        """Apply the faults whose time has come."""
        up_s = self.time.made_s
        for jump in self._mishaps.by("jump", up_s):
            self.rover.motion.jump(jump.amount, self.now_ns)
        for gap in self._mishaps.by("gap", up_s):
            self.time.silence(round(gap.amount * 1e9))
        for restart in self._mishaps.by("restart", up_s):
            self.reboot()
            self.time.prolong_silence(round(restart.amount * 1e9))
        for failsafe in self._mishaps.by("failsafe", up_s):
            self.failsafes.begin(int(failsafe.amount), self.time.wall_ns)
            self.text(self.autopilot.failsafe_texts[int(failsafe.amount)])
            self.set_mode("hold")
        for switch in self._mishaps.by("switch", up_s):
            self.set_mode(self.remote_control.switch(int(switch.amount)))

    def _end_scan(self) -> None:
        message, why = self.camera.end(self.now_ns, self.time.boot_ms)
        if why:
            self.text(why)
        if not self._mishaps.once("lostpicture", self.camera.count):
            self.send(message)
        self.auto.scan_over(self.now_ns)

    def _stored(self, kind: int, marked: int | None) -> None:
        if kind == MISSION:
            self.auto.replaced(marked, self.now_ns)
            self.report(MessageId.MISSION_CURRENT)

    def _item_arrives(self, number: int) -> bool:
        """True if an item of an upload arrives in spite of the faults set for it."""
        silent = self._mishaps.once("silent", number)
        if silent:
            self.time.silence(round(silent.amount * 1e9) or FOREVER_NS)
        if self._mishaps.once("reboot-upload", number):
            self.reboot()
        return not self.time.is_silent


def _home_of(rover: Rover) -> Item:
    return home_item(rover.origin) if rover.origin else NOWHERE
