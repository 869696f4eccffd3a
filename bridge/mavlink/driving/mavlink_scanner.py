"""A scanner that a MAVLink vehicle triggers: ordered as a camera or by a script, believed only with its file.

A scan is confirmed by CAMERA_IMAGE_CAPTURED (`stopgo.mission.mavlink.captures`). What comes with a number
that was told before is an older scan's, told again.
"""

from __future__ import annotations

from threading import Event
from typing import Literal

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.driving.onboard_autopilot import OnboardAutopilot
from stopgo.bridge.mavlink.line.messages import request
from stopgo.bridge.mavlink.line.wire import MessageQueue
from stopgo.mission.document import Mission, Scan
from stopgo.mission.errors import OutcomeUnknown, RobotUnreachable
from stopgo.mission.files.file_name import file_name
from stopgo.mission.mavlink.captures import Picture, picture_of, result_of
from stopgo.mission.mavlink.enums import CommandResult, MessageId
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.stop_numbers import numbers_of
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.mavlink.writing import SCAN_MESSAGE
from stopgo.mission.run.scans import ScanFailed, ScanResult

TriggerCommand = tuple[int, tuple[float, ...]]
"""A command and its params."""
ScanTrigger = Literal["camera", "script"]
TRIGGERS: tuple[ScanTrigger, ...] = ("camera", "script")

LOOK_S = 0.2
"""How often an interruption is looked for."""
AGAIN_S = 3.0
"""How often a result is asked for that may have been lost on the way."""
ORDER_S = 3.0
COUNT_S = 1.0
"""How long the camera may take to say what it has taken."""
BUSY_S = 1.0
"""Between two tries of a trigger, while an older scan is under way."""


class MavlinkScanner:
    """The scanner of one vehicle."""

    profiles: tuple[str, ...] | None = None
    """Neither trigger carries a profile, so the vehicle scans with the one it is set to."""

    def __init__(self, autopilot: OnboardAutopilot, *, clock: Clock, trigger: ScanTrigger = "camera") -> None:
        self._autopilot = autopilot
        self._clock = clock
        self._trigger = trigger
        self._numbers: dict[str, int] = {}
        self._told: set[Picture] = set()
        """Pictures that were told of; each counts once, however often it is told."""
        self._last = 0
        """The capture number that was ordered last."""

    def take(self, mission: Mission) -> None:
        """Trigger with the numbers that this mission's stops have."""
        ids = (file_name(stop.id) for stop in mission.stops)
        self._numbers = dict(zip(ids, numbers_of(mission), strict=True))

    def scan(self, label: str, scan: Scan, *, interrupt: Event) -> ScanResult | ScanFailed:
        until_s = self._now_s() + scan.timeout_s
        with self._autopilot.peer.wire.waiting("CAMERA_IMAGE_CAPTURED") as waiting:
            taken = self._pictures_taken(waiting)
            order = self._order(label, scan, taken)
            refused = self._ordered(order, waiting, until_s, interrupt)
            if refused:
                return ScanFailed(reason=refused)
            captured = self._captured(waiting, taken, until_s, interrupt)
        if captured is not None:
            return result_of(captured)
        if interrupt.is_set():
            self._break_off()
            return ScanFailed(reason="interrupted")
        lost = self._autopilot.out_of_reach()
        return ScanFailed(reason=f"no result within {scan.timeout_s:g} s" + (f": {lost}" if lost else ""))

    def scan_outcome(self, label: str) -> ScanResult | ScanFailed | None:
        """Nobody knows: a camera's last picture does not say which of two triggers it followed."""
        return None

    def _pictures_taken(self, waiting: MessageQueue) -> int | None:
        """The least number of the next picture, if the camera tells; all that was told so far is old."""
        status = self._asked(MessageId.CAMERA_CAPTURE_STATUS)
        if status is not None:
            return int(status.image_count)
        last = self._asked(MessageId.CAMERA_IMAGE_CAPTURED)
        self._forget(waiting)
        return None if last is None else int(last.image_index) + 1

    def _asked(self, number: int) -> Message | None:
        try:
            return self._autopilot.peer.ask(number, patience_s=COUNT_S)
        except RobotUnreachable:
            return None

    def _order(self, label: str, scan: Scan, taken: int | None) -> TriggerCommand:
        if self._trigger == "script":
            number = self._numbers.get(stop_of(label), 0)
            return Command.DO_SEND_SCRIPT_MESSAGE, (
                float(SCAN_MESSAGE), float(number), scan.duration_s, scan.timeout_s,
            )  # fmt: skip
        # All cameras, one picture. The interval means nothing for one, so it can carry how long a scan takes;
        # the number grows with every order, so that one which is repeated does not take two.
        self._last = max(self._last, taken or 0) + 1
        return Command.IMAGE_START_CAPTURE, (0.0, scan.duration_s, 1.0, float(self._last))

    def _ordered(self, order: TriggerCommand, waiting: MessageQueue, until_s: float, interrupt: Event) -> str:
        """Why the vehicle does not scan; empty if it does, or may: then the result will tell.

        One that is busy is busy with a scan that nobody waits for any more, and is waited for.
        """
        command, params = order
        while True:
            try:
                ack = self._autopilot.peer.command(command, *params, patience_s=ORDER_S)
            except OutcomeUnknown:
                return ""
            if ack.result != CommandResult.TEMPORARILY_REJECTED:
                return "" if ack.accepted else f"the vehicle answered the trigger with {ack.name}"
            if self._now_s() + BUSY_S > until_s:
                return "the vehicle's scanner is busy"
            if self._clock.wait(BUSY_S, interrupt):
                return "interrupted"
            self._forget(waiting)

    def _captured(
        self, waiting: MessageQueue, taken: int | None, until_s: float, interrupt: Event
    ) -> Message | None:
        """The picture that was told of for the first time; `None` if the time is up or it was interrupted."""
        asked_s = self._now_s()
        while not interrupt.is_set() and (left := until_s - self._now_s()) > 0:
            message = waiting.get(min(LOOK_S, left))
            if message is not None and self._is_new(message, taken):
                return message
            if self._now_s() - asked_s >= AGAIN_S:
                asked_s = self._now_s()
                self._ask_for(0 if taken is None else taken)
        return None

    def _is_new(self, message: Message, taken: int | None) -> bool:
        """Whether it is a picture of this vehicle that was not told of before; it is from now on."""
        if message.get_srcSystem() != self._autopilot.peer.who.system or picture_of(message) in self._told:
            return False
        self._told.add(picture_of(message))
        return taken is None or message.image_index >= taken

    def _forget(self, waiting: MessageQueue) -> None:
        """Whatever has been told so far is of older scans."""
        while (message := waiting.get(0.0)) is not None:
            self._told.add(picture_of(message))

    def _ask_for(self, index: int) -> None:
        peer = self._autopilot.peer
        peer.send(request(peer.who, MessageId.CAMERA_IMAGE_CAPTURED, index))

    def _break_off(self) -> None:
        """Tell the vehicle to stop scanning; whether it does changes nothing here."""
        self._autopilot.order(Command.IMAGE_STOP_CAPTURE, what="the end of the scan")

    def _now_s(self) -> float:
        return self._clock.now_ns() / 1e9


def stop_of(label: str) -> str:
    """The stop in a scan's label, `<run id>-<stop id as a file's name>-<attempt>`."""
    return label.partition("-")[2].rpartition("-")[0]
