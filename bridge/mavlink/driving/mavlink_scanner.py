"""A scanner that a MAVLink vehicle triggers as a camera or by a script; a scan counts only with its file.

CAMERA_IMAGE_CAPTURED confirms a scan (`stopgo.mission.mavlink.captures`). A message with a number that was
reported before repeats an older scan's result. A scan during which the vehicle moved has failed, whatever
the scanner reports: another station may have driven it.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import Event
from typing import Literal

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.driving.command_refusal import COMMAND_S, refusal
from stopgo.bridge.mavlink.driving.onboard_autopilot import OnboardAutopilot
from stopgo.bridge.mavlink.driving.takeover_watch import TakeoverWatch
from stopgo.bridge.mavlink.vehicle_link.messages import every_component, request
from stopgo.bridge.mavlink.vehicle_link.wire import MessageQueue, Who, sender
from stopgo.mission.document import Mission, Scan
from stopgo.mission.errors import InputError, OutcomeUnknown, RobotUnreachable
from stopgo.mission.files.file_name import file_name
from stopgo.mission.mavlink.captures import Picture, picture_of, result_of
from stopgo.mission.mavlink.enums import CommandResult, MessageId
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.stop_numbers import numbers_of
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.mavlink.writing import SCAN_MESSAGE
from stopgo.mission.run.events import Pose
from stopgo.mission.run.scan_motion import ScanMotion
from stopgo.mission.run.scans import ScanFailed, ScanResult

TriggerCommand = tuple[int, tuple[float, ...]]
"""A command and its params."""
ScanTrigger = Literal["camera", "script"]
TRIGGERS: tuple[ScanTrigger, ...] = ("camera", "script")

TOLERANCE_M = 0.05
"""Tolerance of a position during the scan of a stop that no mission has."""
LOOK_S = 0.2
"""Interval at which interruption and motion are checked."""
AGAIN_S = 3.0
"""Interval at which a result is requested again: it may have been lost on the link."""
COUNT_S = 1.0
"""Time that the camera may take to report its number of pictures."""
NO_MESSAGE = 0.0
"""Number of a script message that means nothing: the scans' number is `SCAN_MESSAGE`."""
OLD_AGAIN_S = 0.2
"""Interval at which the last picture is requested before a scan."""
BUSY_S = 1.0
"""Interval between two tries of a trigger, while an older scan is in progress."""


class StandstillWatch:
    """Watches one vehicle during a scan; `why` says why the scan is spoilt, empty if it is not."""

    def __init__(self, autopilot: OnboardAutopilot, tolerance_m: float) -> None:
        self._autopilot = autopilot
        self._motion = ScanMotion(tolerance_m)
        self._takeover = TakeoverWatch(autopilot, by_hold=False)
        self._look()

    def why(self) -> str:
        """Look at the vehicle once more."""
        if self._takeover.is_restarted:
            return "the autopilot was restarted during the scan"
        if taken := self._takeover.taken():
            return f"the vehicle was taken during the scan: {taken}"
        if steered := self._takeover.steered():
            return f"{steered} during the scan"
        self._look()
        return self._motion.why

    def disarmed(self) -> str:
        """Return who has disarmed the vehicle; empty if nobody has."""
        return self._takeover.disarmed()

    def _look(self) -> None:
        """Take the present pose, in the vehicle's own frame; a late one says nothing."""
        telemetry = self._autopilot.telemetry
        if not telemetry.is_late:
            x, y = telemetry.position()
            self._motion.take(Pose(x=x, y=y, heading=telemetry.yaw()), telemetry.speed())


class MavlinkScanner:
    """The scanner of one vehicle."""

    profiles: tuple[str, ...] | None = None
    """Neither trigger carries a profile, so the vehicle scans with the one it is set to."""

    def __init__(self, autopilot: OnboardAutopilot, *, clock: Clock, trigger: ScanTrigger = "camera") -> None:
        self._autopilot = autopilot
        self._clock = clock
        self._trigger = trigger
        self.pause: Callable[[str], bool] = lambda why: False
        """Pauses the run for a hold or disarming by somebody else during a scan; true if paused then."""
        self._numbers: dict[str, int] = {}
        self._tolerances_m: dict[str, float] = {}
        self._camera: Who | None = None
        """The component that reports the scans, once it has reported one."""
        self._reported: set[Picture] = set()
        """Pictures that were reported; each counts once, however often it is reported."""
        self._last_number = 0
        """The capture number of the last trigger."""

    def take(self, mission: Mission) -> None:
        """Trigger with the numbers of this mission's stops; any component may be its scanner."""
        self._camera = None
        ids = tuple(file_name(stop.id) for stop in mission.stops)
        self._numbers = dict(zip(ids, numbers_of(mission), strict=True))
        self._tolerances_m = dict(zip(ids, (stop.tolerance_m for stop in mission.stops), strict=True))

    def scan(self, label: str, scan: Scan, *, interrupt: Event) -> ScanResult | ScanFailed:
        watch = StandstillWatch(self._autopilot, self._tolerances_m.get(stop_of(label), TOLERANCE_M))
        with self._autopilot.peer.wire.waiting("CAMERA_IMAGE_CAPTURED") as waiting:
            next_index = self._next_index(waiting)
            self._learn_old_pictures(waiting)
            until_s = self._now_s() + scan.timeout_s
            command = self._trigger_command(label, scan, next_index)
            refused = self._send_trigger(command, waiting, until_s, interrupt)
            if refused:
                return ScanFailed(reason=refused)
            due_s = self._now_s() + scan.duration_s
            captured = self._await_picture(waiting, next_index, (due_s, until_s), interrupt, watch)
        spoilt = watch.why()
        if spoilt:
            self._end_spoilt(captured is None)
            return ScanFailed(reason=spoilt)
        if captured is not None:
            return result_of(captured)
        if interrupt.is_set():
            self._break_off()
            return ScanFailed(reason="interrupted")
        lost = self._autopilot.telemetry.why_unknown()
        return ScanFailed(reason=f"no result within {scan.timeout_s:g} s" + (f": {lost}" if lost else ""))

    def scan_outcome(self, label: str) -> ScanResult | ScanFailed | None:
        """Always unknown: a camera's last picture does not show which of two triggers it followed."""
        return None

    def _end_spoilt(self, under_way: bool) -> None:
        """Have the vehicle stop scanning and stand, unless somebody has switched its mode."""
        if under_way:
            self._break_off()
        if not self._autopilot.control.is_changed:
            self._autopilot.control.stop()

    def _next_index(self, waiting: MessageQueue) -> int | None:
        """Lowest index of the autopilot's next picture, if it reports it."""
        status = None if self._has_own_component else self._ask(MessageId.CAMERA_CAPTURE_STATUS)
        if status is not None:
            return int(status.image_count)
        last = None if self._has_own_component else self._ask(MessageId.CAMERA_IMAGE_CAPTURED)
        return None if last is None else int(last.image_index) + 1

    def _learn_old_pictures(self, waiting: MessageQueue) -> None:
        """Have the last picture reported, and take it and all before as old ones.

        It may have come while nobody listened, or before a restart of this program: reported again during
        the scan, it would count for this stop.
        """
        self._discard_old(waiting)
        known, end_s = len(self._reported), self._now_s() + COUNT_S
        while len(self._reported) == known and self._now_s() < end_s:
            self._request_picture(None)
            message = waiting.get(OLD_AGAIN_S)
            if message is not None and message.get_srcSystem() == self._autopilot.peer.who.system:
                old = picture_of(message) in self._reported
                self._reported.add(picture_of(message))
                if old:
                    return

    @property
    def _has_own_component(self) -> bool:
        """True if the scanner is no part of the autopilot, whose count of pictures is another one then."""
        return self._camera not in (None, self._autopilot.peer.who)

    def _ask(self, number: int) -> Message | None:
        try:
            return self._autopilot.peer.ask(number, patience_s=COUNT_S)
        except RobotUnreachable:
            return None

    def _trigger_command(self, label: str, scan: Scan, next_index: int | None) -> TriggerCommand:
        if self._trigger == "script":
            number = self._numbers.get(stop_of(label), 0)
            return Command.DO_SEND_SCRIPT_MESSAGE, (
                float(SCAN_MESSAGE), float(number), scan.duration_s, scan.timeout_s,
            )  # fmt: skip
        # All cameras, one picture. The interval means nothing for one, so it can carry how long a scan takes;
        # the number grows with every trigger, so that a repeated one does not take two.
        self._last_number = max(self._last_number, next_index or 0) + 1
        return Command.IMAGE_START_CAPTURE, (0.0, scan.duration_s, 1.0, float(self._last_number))

    def _send_trigger(
        self, command: TriggerCommand, waiting: MessageQueue, until_s: float, interrupt: Event
    ) -> str:
        """Trigger a scan; return why the vehicle does not scan, empty if it does or may.

        A busy scanner works on a scan that nobody waits for any more; the trigger waits for its end.
        """
        number, params = command
        while True:
            try:
                # Not again into silence: after a stall each repeated trigger would arrive, and count.
                ack = self._autopilot.peer.command(number, *params, patience_s=COMMAND_S, unheard=0)
            except OutcomeUnknown:
                return ""
            if ack.result != CommandResult.TEMPORARILY_REJECTED:
                return "" if ack.accepted else f"the vehicle answered the trigger with {ack.name}"
            if self._now_s() + BUSY_S > until_s:
                return "the vehicle's scanner is busy"
            if self._clock.wait(BUSY_S, interrupt):
                return "interrupted"
            self._discard_old(waiting)

    def _await_picture(
        self,
        waiting: MessageQueue,
        next_index: int | None,
        times_s: tuple[float, float],
        interrupt: Event,
        watch: StandstillWatch,
    ) -> Message | None:
        """The first report of a new picture; `None` if there is none in time, or the scan ends early.

        From the first of the two times on, when it should have ended, it is requested again.
        """
        asked_s, until_s = times_s[0] - AGAIN_S, times_s[1]
        reported = False
        while not (interrupt.is_set() or watch.why()) and (left := until_s - self._now_s()) > 0:
            reported = reported or self._report_change(watch)
            message = waiting.get(min(LOOK_S, left))
            if message is not None and self._is_new(message, next_index):
                return message
            if self._now_s() - asked_s >= AGAIN_S:
                asked_s = self._now_s()
                self._request_picture(next_index)
        return None

    def _report_change(self, watch: StandstillWatch) -> bool:
        """Report whoever has put the vehicle on hold, or disarmed it; the scan goes on, for it stands."""
        control = self._autopilot.control
        change = control.mode_change() if control.is_put_on_hold else watch.disarmed()
        if change:
            self.pause(change)
        return bool(change)

    def _is_new(self, message: Message, next_index: int | None) -> bool:
        """True at the first report of a picture of this vehicle; the picture counts as reported then."""
        picture, who = picture_of(message), sender(message)
        other = self._camera not in (None, who)
        if who.system != self._autopilot.peer.who.system or other or picture in self._reported:
            return False
        self._reported.add(picture)
        counted = next_index is not None and who == self._autopilot.peer.who
        if counted and message.image_index < (next_index or 0):
            return False
        self._camera = who
        return True

    def _discard_old(self, waiting: MessageQueue) -> None:
        """Take all reports so far as reports of older scans."""
        while (message := waiting.get(0.0)) is not None:
            self._reported.add(picture_of(message))

    def _request_picture(self, index: int | None) -> None:
        """Request the last picture of the component that has it, or of each while that is not known.

        `index` is the number that the autopilot gives its next picture, if it is known.
        """
        peer = self._autopilot.peer
        if self._camera != peer.who:
            peer.send(request(self._camera or every_component(peer.who), MessageId.CAMERA_IMAGE_CAPTURED))
        if self._camera in (None, peer.who) and index is not None:
            peer.send(request(peer.who, MessageId.CAMERA_IMAGE_CAPTURED, index))
        elif self._camera == peer.who:
            peer.send(request(peer.who, MessageId.CAMERA_IMAGE_CAPTURED))

    def _break_off(self) -> None:
        """Command the vehicle to stop scanning; its answer changes nothing here."""
        refusal(self._autopilot.peer, Command.IMAGE_STOP_CAPTURE, what="the end of the scan")

    def _now_s(self) -> float:
        return self._clock.now_ns() / 1e9


def check_trigger(autopilot: OnboardAutopilot, trigger: ScanTrigger) -> None:
    """Check that the autopilot takes the trigger's command, by a message that no script reads as a scan.

    Raises
    ------
    InputError
        If it does not. Without an answer nothing is known, and the first scan shows it.
    """
    if trigger != "script":
        return
    try:
        ack = autopilot.peer.command(Command.DO_SEND_SCRIPT_MESSAGE, NO_MESSAGE, patience_s=COMMAND_S)
    except OutcomeUnknown:
        return
    if ack.result == CommandResult.UNSUPPORTED:
        raise InputError(
            f"--trigger script: {autopilot.peer} does not take DO_SEND_SCRIPT_MESSAGE as a command"
            " (ArduPilot may know it as a mission item only); use --trigger camera"
        )


def stop_of(label: str) -> str:
    """The stop in a scan's label, `<run id>-<stop id as a file's name>-<attempt>`."""
    return label.partition("-")[2].rpartition("-")[0]
