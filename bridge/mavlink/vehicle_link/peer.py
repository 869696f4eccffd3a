"""The vehicle at the other end of a wire: found by its heartbeat, queried and commanded until it answers.

Every wait ends after a number of seconds without relevant data from the vehicle, never after a number of
tries.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count

from stopgo.bridge.mavlink.vehicle_link.foreign_commands import ForeignCommands
from stopgo.bridge.mavlink.vehicle_link.messages import (
    command_int,
    command_long,
    enum_name,
    is_signed,
    message_name,
    request,
    set_origin,
    station_beat,
)
from stopgo.bridge.mavlink.vehicle_link.round_trips import RoundTrips
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import SIGNATURE, MessageQueue, Who, Wire, sender, wire
from stopgo.mission.errors import InputError, NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.mavlink.autopilots import autopilot_of
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.enums import CommandResult, Component, Firmware, MessageId, ModeFlag, VehicleType
from stopgo.mission.mavlink.items import Command, MavFrame
from stopgo.mission.mavlink.local_frame import VehicleOrigin
from stopgo.mission.mavlink.telemetry import Message, has_restarted, origin_of, place_of

PATIENCE_S = 5.0
"""Time without data after which a wait for a vehicle ends."""
AGAIN_S = 0.3
"""Interval between two tries of the same query or command."""
LONGEST_AGAIN_S = 1.0
"""Longest interval between two tries of a command: each further one comes later."""
UNHEARD = 2
"""Number of times that a command is sent again while no data come from the vehicle."""
OTHERS_S = 1.3
"""Wait for a second vehicle after the first: every one sends a heartbeat once a second."""
KNOCK_S = 0.3
"""Interval at which a heartbeat is requested from a vehicle that is not found yet."""
CLOCKS = (MessageId.SYSTEM_TIME, MessageId.ATTITUDE)
UNSET_ANSWERS = 8
"""Number of accepted requests without the message that show that the vehicle has none to send."""

UNPLACED = (
    "the vehicle has an origin, but reports no position on earth (GLOBAL_POSITION_INT 0, 0): in AUTO it would"
    " pass over its waypoints; restart it, and set its origin only once it sends LOCAL_POSITION_NED"
)


@dataclass(frozen=True)
class Ack:
    """A vehicle's answer to a command."""

    command: int
    result: int
    detail: int = 0
    """result_param2, whose meaning depends on the command."""

    @property
    def accepted(self) -> bool:
        return self.result == CommandResult.ACCEPTED

    @property
    def name(self) -> str:
        """Name of the result, such as "DENIED"."""
        return enum_name("MAV_RESULT", self.result)


OF_THE_PAST = frozenset({"CAMERA_IMAGE_CAPTURED"})
"""Messages that contain the time of an earlier event, not of their sending."""


class Newest(MessageQueue):
    """The newest message of each type from one vehicle, and the number of its restarts.

    Texts of its other components, or of a tunnel in its name, are stored separately.
    """

    def __init__(self, of: Who) -> None:
        super().__init__(of=of)
        self.boots = 0
        self.heard_s = time.monotonic()
        self.messages: dict[str, Message] = {}
        self.clock: int | None = None
        """Number of the message that last reported the time since its boot."""
        self.text = ""
        self.text_s = -math.inf
        self._boot_ms = 0

    def wants(self, message: Message) -> bool:
        assert self.of is not None
        is_text = message.get_type() == "STATUSTEXT" and message.get_srcSystem() == self.of.system
        return is_text or super().wants(message)

    def put(self, message: Message) -> None:
        if message.get_type() == "STATUSTEXT":
            self.text, self.text_s = _printable(message.text), time.monotonic()
        if sender(message) != self.of:
            return
        self.heard_s = time.monotonic()
        self.messages[message.get_type()] = message
        now_ms = getattr(message, "time_boot_ms", None)
        if now_ms is not None and message.get_type() not in OF_THE_PAST:
            self.clock = message.get_msgId()
            self._count_boots(now_ms)

    def _count_boots(self, now_ms: int) -> None:
        restarted = has_restarted(self._boot_ms, now_ms)
        self.boots += restarted
        self._boot_ms = now_ms if restarted else max(now_ms, self._boot_ms)


class Peer:
    """A vehicle that was found on a wire."""

    def __init__(
        self,
        wire: Wire,
        newest: Newest,
        autopilot: Autopilot,
        foreign: ForeignCommands,
        patience_s: float = PATIENCE_S,
    ) -> None:
        assert newest.of is not None
        self.wire = wire
        self.who = newest.of
        self.autopilot = autopilot
        """The kind of its autopilot."""
        self.foreign = foreign
        """What others command it, as far as it is heard."""
        self.patience_s = patience_s
        self.round_trips = RoundTrips()
        self.in_order = False
        """True if it was found to send its items only one by one."""
        self.reading_list = threading.Lock()
        """Held while its items are read: most vehicles serve one transfer at a time."""
        self._newest = newest
        self._commanding = threading.Lock()

    def __str__(self) -> str:
        return f"vehicle {self.who.system} ({self.autopilot.name})"

    @property
    def heartbeat(self) -> Message:
        """The last heartbeat."""
        return self._newest.messages["HEARTBEAT"]

    @property
    def armed(self) -> bool:
        return bool(self.heartbeat.base_mode & ModeFlag.SAFETY_ARMED)

    @property
    def in_auto(self) -> bool:
        """True if it is in the mode in which it follows its mission."""
        return self.autopilot.in_auto(self.heartbeat)

    @property
    def silent_s(self) -> float:
        """Seconds since its last message."""
        return time.monotonic() - self._newest.heard_s

    @property
    def boots(self) -> int:
        """Number of its restarts since it was found, as far as its clock shows them."""
        return self._newest.boots

    def ask_clock(self) -> None:
        """Request its clock, by two messages of which most vehicles have one; `boots` follows."""
        for number in CLOCKS:
            self.request(number)

    def clock_seen(self, *, patience_s: float) -> None:
        """Wait for the time since its boot, if the vehicle has reported that before."""
        if self._newest.clock is not None:
            with suppress(RobotUnreachable):
                self.ask(self._newest.clock, patience_s=patience_s)

    def newest(self, name: str) -> Message | None:
        """Its last message of a type, however old."""
        return self._newest.messages.get(name)

    @contextmanager
    def waiting(self, *types: str) -> Iterator[MessageQueue]:
        """A queue of messages from this vehicle, as `Wire.waiting`."""
        with self.wire.waiting(*types, of=self.who) as waiting:
            yield waiting

    def send(self, message: Message) -> None:
        self.wire.send(message)

    def command(
        self, number: int, *params: float, patience_s: float | None = None, unheard: int = UNHEARD
    ) -> Ack:
        """Send a COMMAND_LONG until it is answered; params that are not given are 0.

        While no data come from the vehicle it is sent again `unheard` times at most. So after a stall of the
        link no pile of commands arrives.

        Raises
        ------
        OutcomeUnknown
            If there is no answer.
        """
        return self._commanded(
            number, lambda nth: command_long(self.who, number, *params, again=nth), patience_s, unheard
        )

    def command_int(
        self,
        number: int,
        *params: float,
        x: int = 0,
        y: int = 0,
        z: float = 0.0,
        frame: int = MavFrame.GLOBAL,
        patience_s: float | None = None,
    ) -> Ack:
        """Send a COMMAND_INT with up to four params and a position (1e-7 degrees); as `command`."""
        message = command_int(self.who, number, *params, x=x, y=y, z=z, frame=frame)
        return self._commanded(number, lambda _: message, patience_s, UNHEARD)

    def order(self, number: int, *params: float, what: str = "", patience_s: float | None = None) -> Ack:
        """Send a command as `command`; anything but ACCEPTED is an error.

        Raises
        ------
        AnswerIsNo
            If the vehicle does not accept it.
        """
        ack = self.command(number, *params, patience_s=patience_s)
        if not ack.accepted:
            named = what or enum_name("MAV_CMD", number)
            raise NegativeResult(f"{self}: {named} was answered {ack.name}{self._last_text()}")
        return ack

    def ask(self, number: int, *, patience_s: float | None = None) -> Message | None:
        """Request a message; return it, or `None` if the vehicle has none to send or does not know it.

        Raises
        ------
        RobotUnreachable
            If there is neither the message nor an answer.
        """
        name = message_name(number)
        taken = 0
        with self._commanding, self.waiting(name, "COMMAND_ACK") as waiting:
            for _ in self._tries(AGAIN_S, patience_s):
                self.request(number)
                reply = _reply(waiting, name, AGAIN_S)
                if reply is None:
                    continue
                if reply.get_type() == name:
                    return reply
                taken += 1
                if reply.result != CommandResult.ACCEPTED or taken >= UNSET_ANSWERS:
                    return None
        if taken:
            return None
        raise RobotUnreachable(f"{self} does not answer{self.why_silent()}; nothing was sent to it")

    def request(self, number: int) -> None:
        """Request the message of this number without waiting; `newest` has it if it comes."""
        self.wire.send(request(self.who, number))

    def origin(self, *, patience_s: float | None = None) -> VehicleOrigin | None:
        """Origin of its local frame (GPS_GLOBAL_ORIGIN); `None` if it is not set, or not reported."""
        message = self.ask(MessageId.GPS_GLOBAL_ORIGIN, patience_s=patience_s)
        return None if message is None else origin_of(message)

    def unplaced(self) -> str:
        """Reason why it would not find a waypoint; empty if it would, or if it reports nothing of that.

        ArduPilot that gets an origin before its filter runs reports it, and never uses it. Measured: it then
        reported metres, armed, and in AUTO passed over waypoint after waypoint without moving.
        """
        position = self.ask(MessageId.GLOBAL_POSITION_INT)
        return UNPLACED if position is not None and place_of(position) is None else ""

    def set_origin(self, origin: VehicleOrigin, *, patience_s: float | None = None) -> VehicleOrigin | None:
        """Set the origin of its local frame; return the one it then has: the old one if it had one."""
        message = set_origin(self.who, origin)
        for _ in self._tries(0.0, patience_s):
            self.wire.send(message)
            held = self.origin(patience_s=patience_s)
            if held is not None:
                return held
        return None

    def why_silent(self, *, answers: bool = False) -> str:
        """Possible reason why a vehicle that was found does not answer, as a part of a sentence.

        `answers`: it has answered before, so that neither signing nor a one-way link is the reason.
        """
        if self.wire.disconnected:
            return f" ({self.wire.disconnected})"
        if self.wire.dropped[SIGNATURE]:
            return f" ({self.wire.dropped[SIGNATURE]} frames had a {SIGNATURE}: is the signing key its own?)"
        if self.silent_s > OTHERS_S:
            return f" (no data for {self.silent_s:.0f} s)"
        if self._newest.text_s > time.monotonic() - self.patience_s - OTHERS_S:
            return f' (it last said "{self._newest.text}")'
        guess = (
            "it signs its messages, and may want ours signed: --signing-key FILE"
            if is_signed(self.heartbeat)
            else "its heartbeats come: does it want signed messages, or is the link one-way?"
        )
        return "" if answers else f" ({guess})"

    def _commanded(
        self, number: int, message: Callable[[int], Message], patience_s: float | None, unheard: int
    ) -> Ack:
        with self._commanding, self.waiting("COMMAND_ACK") as waiting:
            patience = self.patience_s if patience_s is None else patience_s
            until = time.monotonic() + patience
            nth, sent_s = 0, -math.inf
            while True:
                if nth <= unheard or self._newest.heard_s > sent_s:
                    sent_s = time.monotonic()
                    self.wire.send(message(nth))
                    nth += 1
                wait_s = min(LONGEST_AGAIN_S, AGAIN_S * nth)
                while (ack := _ack(waiting, number, min(wait_s, until - time.monotonic()))) is not None:
                    if ack.result != CommandResult.IN_PROGRESS:
                        return ack
                    until = time.monotonic() + patience
                if time.monotonic() >= until:
                    break
        raise OutcomeUnknown(
            f"{self}: {enum_name('MAV_CMD', number)} was sent and not answered{self.why_silent()}: "
            "whether it was carried out is unknown"
        )

    def _tries(self, again_s: float, patience_s: float | None) -> Iterator[int]:
        """Numbers of the tries as long as there is time for one more; at least one."""
        patience = self.patience_s if patience_s is None else patience_s
        until = time.monotonic() + patience - again_s
        for nth in count():
            yield nth
            if time.monotonic() > until:
                return

    def _last_text(self) -> str:
        text = self.newest("STATUSTEXT")
        return f' (it last said "{text.text}")' if text is not None else ""


def _ack(waiting: MessageQueue, number: int, timeout_s: float) -> Ack | None:
    """The next answer to this command."""
    until = time.monotonic() + timeout_s
    while (message := waiting.get(until - time.monotonic())) is not None:
        if message.command == number:
            return Ack(message.command, message.result, message.result_param2)
    return None


def _reply(waiting: MessageQueue, name: str, timeout_s: float) -> Message | None:
    """The requested message, else the answer to the request."""
    until, answer = time.monotonic() + timeout_s, None
    while (message := waiting.get(until - time.monotonic())) is not None:
        if message.get_type() == name:
            return message
        if message.command == Command.REQUEST_MESSAGE:
            answer = message
            until = min(until, time.monotonic() + AGAIN_S / 3)  # the message may follow its answer
    return answer


def _printable(text: str) -> str:
    return "".join(one for one in text if one.isprintable())


@contextmanager
def reached(
    url: Url,
    *,
    vehicle: int | None = None,
    signing_key: bytes | None = None,
    timeout_s: float = PATIENCE_S,
) -> Iterator[Peer]:
    """A vehicle at `url`, over a wire of its own; raises as `wire` and `found` do."""
    with wire(url, signing_key=signing_key) as opened, found(opened, vehicle, timeout_s=timeout_s) as peer:
        yield peer


@contextmanager
def found(
    wire: Wire,
    vehicle: int | None = None,
    *,
    timeout_s: float = PATIENCE_S,
    beat: Callable[[], Message] | None = None,
) -> Iterator[Peer]:
    """The vehicle whose heartbeats come over `wire`, while our own go out every second.

    Parameters
    ----------
    vehicle
        Its system id; not needed if only one is found.
    timeout_s
        Longest wait for a heartbeat, and then the peer's patience.
    beat
        Makes our heartbeats; those of a ground station if not given.

    Raises
    ------
    RobotUnreachable
        If none is found.
    InputError
        If several are found, and none was named; or if two have the same system id.
    """
    with wire.waiting("HEARTBEAT") as waiting:
        wire.beat(beat or station_beat)
        beats = _heartbeats(waiting, vehicle, timeout_s, lambda: _knock(wire, vehicle, beat or station_beat))
    heartbeat = _selected(wire, beats, vehicle, timeout_s)
    _check_alone(wire, heartbeat.get_srcSystem())
    wire.report_doubled(heartbeat.get_srcSystem())
    newest = Newest(sender(heartbeat))
    newest.put(heartbeat)
    autopilot = autopilot_of(heartbeat.autopilot)
    foreign = ForeignCommands(sender(heartbeat), wire.me, autopilot)
    with wire.filling(newest), wire.filling(foreign):
        yield Peer(wire, newest, autopilot, foreign, timeout_s)


def _heartbeats(
    waiting: MessageQueue, vehicle: int | None, timeout_s: float, knock: Callable[[], None]
) -> dict[int, Message]:
    """Heartbeats of autopilots by system id: of the named one, or of all until no other can come."""
    beats: dict[int, Message] = {}
    until = time.monotonic() + timeout_s
    while (left_s := until - time.monotonic()) > 0:
        message = waiting.get(min(KNOCK_S, left_s))
        if message is None and not beats:
            knock()
        if message is None or not is_of_autopilot(message):
            continue
        if not beats and vehicle is None:
            until = min(until, time.monotonic() + OTHERS_S)
        beats[message.get_srcSystem()] = message
        if message.get_srcSystem() == vehicle:
            break
    return beats


def _knock(wire: Wire, vehicle: int | None, beat: Callable[[], Message]) -> None:
    """Send our heartbeat, and request one: on a bad link one a second may be too few."""
    wire.send(beat())
    wire.send(request(Who(vehicle or 0, Component.AUTOPILOT1), MessageId.HEARTBEAT))


def is_of_autopilot(heartbeat: Message) -> bool:
    """True for the heartbeat of an autopilot, not of its camera or of a station."""
    return (
        heartbeat.get_srcComponent() == Component.AUTOPILOT1
        and heartbeat.autopilot != Firmware.INVALID
        and heartbeat.type != VehicleType.GCS
    )


def _selected(wire: Wire, beats: dict[int, Message], vehicle: int | None, timeout_s: float) -> Message:
    if vehicle is None and len(beats) == 1:
        return next(iter(beats.values()))
    if vehicle in beats:
        return beats[vehicle]
    names = ", ".join(f"{system} ({autopilot_of(beats[system].autopilot).name})" for system in sorted(beats))
    if vehicle is None and beats:
        raise InputError(f"{wire.name}: several vehicles: {names}; name one with --vehicle ID")
    whom = "no vehicle" if vehicle is None else f"no vehicle {vehicle}"
    others = f" (found: {names})" if beats else ""
    raise RobotUnreachable(
        f"{wire.name}: {whom} within {timeout_s:g} s{others}{_why_none(wire)}; nothing was sent. "
        "Is it on, and does it send there?"
    )


def _check_alone(wire: Wire, system: int) -> None:
    """Refuse to take two vehicles for one."""
    doubled = wire.doubled(system)
    if doubled:
        raise InputError(
            f"{wire.name}: two vehicles have the system id {system}, at {doubled}; nothing was sent. Give one"
            " another id (ArduPilot MAV_SYSID, before 4.7 SYSID_THISMAV; PX4 MAV_SYS_ID). If it is one"
            " vehicle over two links, use one of them"
        )


def _why_none(wire: Wire) -> str:
    if wire.disconnected:
        return f" ({wire.disconnected})"
    dropped = wire.dropped[SIGNATURE]
    return f" ({dropped} frames had a {SIGNATURE}: is the signing key the vehicle's?)" if dropped else ""
