"""An autopilot as seen from the computer on its robot: what it tells, and the few words that drive it.

A thread keeps it telling, and keeps ordering a stop until a heartbeat shows that it was obeyed: a stop waits
behind no other command, and outlives a line that is cut.
"""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from stopgo.bridge.mavlink.line.messages import (
    aim_at,
    aim_yaw,
    command_long,
    interval,
    keep_course,
    on_board_beat,
    set_origin,
)
from stopgo.bridge.mavlink.line.parameter_reading import read_parameters
from stopgo.bridge.mavlink.line.peer import Peer, found
from stopgo.bridge.mavlink.line.url import Url
from stopgo.bridge.mavlink.line.wire import MessageQueue, Who, wire
from stopgo.mission.document import Point
from stopgo.mission.errors import InputError, OutcomeUnknown, RobotUnreachable
from stopgo.mission.mavlink.autopilots import AUTOPILOTS
from stopgo.mission.mavlink.autopilots.kind import Mode, why_no_rover
from stopgo.mission.mavlink.enums import Component, MessageId
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.local_frame import VehicleOrigin
from stopgo.mission.mavlink.telemetry import (
    Message,
    charge_of,
    is_arming_refusal,
    is_lost,
    local_speed,
    origin_of,
    stands_still,
)

ON_BOARD = Who(253, Component.ONBOARD_COMPUTER)
"""Ourselves: neither QGroundControl (255) nor a station of ours (254)."""
KEEP_S = 0.1
ORDER_S = 3.0
"""How long one order waits for its answer."""
STOP_S = 2.5
"""How long `stop` waits to see itself obeyed; it goes on being ordered after that."""
WORDS_S = 0.5
"""So long after it refused an order an autopilot may say why."""
IN_FLIGHT_S = 0.3
"""A heartbeat that comes so soon after an order may have been sent before it."""
ASK_ORIGIN_S = 4.0
ORIGIN_S = 15.0
"""An origin that was not confirmed for so long is gone: the vehicle was started again and has none."""
POSE_HZ = 20
ASK_S = 1.0
"""How often it is looked at whether all comes that should be told."""
RARE = 0.4
"""What comes in less than this share of its wanted number is asked for again; a bad line loses the rest."""
LATE_GAPS, LOST_GAPS = 4.0, 20.0
"""What does not come in so many times the longest pause of late is late, is lost."""
SOONEST_LATE_S, LATEST_S = 0.4, 2.0
SOONEST_LOST_S = 20.0
FORGETS = 0.998
"""Share of the longest pause that is remembered from one place to the next."""
SOONEST_GIVEN_UP_S = 0.3
"""Whatever a parameter says: an autopilot looks at it every now and then."""
TURNING_M_S = 0.05
"""An autopilot that is told a velocity by its direction needs one to turn."""
POSE = ("LOCAL_POSITION_NED", "ATTITUDE")
STREAMS = {
    "LOCAL_POSITION_NED": (MessageId.LOCAL_POSITION_NED, POSE_HZ),
    "ATTITUDE": (MessageId.ATTITUDE, POSE_HZ),
    "BATTERY_STATUS": (MessageId.BATTERY_STATUS, 1),
    "SYS_STATUS": (MessageId.SYS_STATUS, 1),
}
"""What we want to be told, by name: number of the message, times a second."""


class NewestMessages(MessageQueue):
    """The newest message of each type from the vehicle, when it came, and how regularly its places come."""

    def __init__(self, of: Who) -> None:
        super().__init__(of=of)
        self._newest: dict[str, tuple[float, Message]] = {}
        self._counts: Counter[str] = Counter()
        self._longest_s = 1.0 / POSE_HZ

    def put(self, message: Message) -> None:
        now_s = time.monotonic()
        self._counts[message.get_type()] += 1
        if message.get_type() == POSE[0]:
            gap_s = min(self.age_s(POSE[0]), LATEST_S)
            self._longest_s = max(gap_s, self._longest_s * FORGETS)
        self._newest[message.get_type()] = (now_s, message)

    def counted(self) -> Counter[str]:
        """How many messages of each type have come since it was asked last."""
        counts, self._counts = self._counts, Counter()
        return counts

    def age_s(self, name: str) -> float:
        """Seconds since the newest of a type came."""
        return time.monotonic() - self._newest.get(name, (-math.inf, None))[0]

    @property
    def late_s(self) -> float:
        """After so long without a place it is late, by this line's own measure."""
        return max(SOONEST_LATE_S, min(LATEST_S, LATE_GAPS * self._longest_s))

    @property
    def lost_s(self) -> float:
        """After so long it is not late but lost."""
        return max(SOONEST_LOST_S, LOST_GAPS * self._longest_s)

    def newest(self, name: str, within_s: float = math.inf) -> Message | None:
        """The newest of a type, unless it is older than that."""
        return self.since(name, time.monotonic() - within_s)

    def fresh(self, name: str) -> Message | None:
        """The newest of a type, unless it is so old that nothing is known any more."""
        at, message = self._newest.get(name, (-math.inf, None))
        return None if is_lost(time.monotonic() - at) else message

    def since(self, name: str, at_s: float) -> Message | None:
        """The newest of a type, if it came after a moment of the monotonic clock."""
        at, message = self._newest.get(name, (-math.inf, None))
        return message if at >= at_s else None


@contextmanager
def on_board(
    url: Url, *, signing_key: bytes | None = None, vehicle: int | None = None, timeout_s: float = 30.0
) -> Iterator[OnboardAutopilot]:
    """The autopilot at `url`, once it tells where it is.

    Raises
    ------
    RobotUnreachable
        If no vehicle is heard, or it does not tell its position.
    InputError
        If several are heard and none was named, or it is of a kind that cannot be driven, or steers like a
        car.
    """
    with (
        wire(url, me=ON_BOARD, signing_key=signing_key) as opened,
        found(opened, vehicle, timeout_s=timeout_s, beat=on_board_beat) as peer,
        opened.filling(NewestMessages(peer.who)) as heard,
    ):
        _check_drivable(peer)
        autopilot = OnboardAutopilot(peer, heard)
        try:
            autopilot.await_pose(timeout_s)
            with suppress(RobotUnreachable):
                peer.origin(patience_s=ORDER_S)  # so that it is known to the first who asks
            autopilot.ask_how_it_drives()
            yield autopilot
        finally:
            autopilot.close()


def _check_drivable(peer: Peer) -> None:
    if not peer.autopilot.drivable:
        known = " and ".join(name for name, kind in AUTOPILOTS.items() if kind.drivable)
        raise InputError(
            f"--controller: an autopilot of kind {peer.autopilot.name!r} cannot be driven; {known} can"
        )
    no_rover = why_no_rover(peer.heartbeat.type)
    if no_rover:
        raise InputError(f"--controller: {no_rover}")


class OnboardAutopilot:
    """A vehicle that was found. Places are metres north and east of its origin, yaws clockwise from north."""

    def __init__(self, peer: Peer, heard: NewestMessages) -> None:
        self.peer = peer
        self.kind = peer.autopilot
        self.modes = peer.autopilot.modes
        self.left: Mode | None = None
        """The mode in which we know it: any other was chosen by somebody else."""
        self._heard = heard
        self._turns = threading.Lock()
        """An order to hold and one to be guided are given one after the other, never crossed."""
        self._guide_asked_s = 0.0
        self.gives_up_s = peer.autopilot.driving.gives_up_s
        self._stands: Point | None = None
        self._stop_owed = threading.Event()
        self._stop_asked_s = 0.0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._keep, name="autopilot", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread; the vehicle stays as it is."""
        self._closing.set()
        self._thread.join()

    def await_pose(self, timeout_s: float) -> None:
        """Wait until the vehicle has told where it is.

        Raises
        ------
        RobotUnreachable
            If it does not.
        """
        until = time.monotonic() + timeout_s
        while any(self._heard.newest(name) is None for name in POSE):
            if time.monotonic() > until:
                raise RobotUnreachable(
                    f"{self.peer} tells no position ({', '.join(POSE)}) within {timeout_s:g} s:"
                    " has it an origin, and GNSS or external navigation?"
                )
            self._closing.wait(KEEP_S)

    def ask_how_it_drives(self) -> None:
        """Learn how long it drives on by a velocity that is not told again.

        Raises
        ------
        InputError
            If it says that it cannot turn on the spot.
        """
        name = self.kind.driving.gives_up_parameter
        values = read_parameters(self.peer, [name, *self.kind.steering.parameters])
        fixed = self.kind.why_no_pivot(values)
        if fixed:
            raise InputError(
                f"--controller: {self.peer}: {fixed}, as it must at the corners of a mission's legs;"
                " drive one with two driven sides"
            )
        told = values.get(name)
        if told is not None:
            self.gives_up_s = max(SOONEST_GIVEN_UP_S, told)

    # What it tells

    def place(self) -> Point:
        told = self._told("LOCAL_POSITION_NED")
        return (told.x, told.y)

    def yaw(self) -> float:
        return float(self._told("ATTITUDE").yaw)

    def speed(self) -> float:
        """Metres per second; 0 when it is not known any more."""
        told = self._heard.fresh("LOCAL_POSITION_NED")
        return 0.0 if told is None else local_speed(told)

    def still(self) -> bool:
        """Whether it stands; not while it does not tell."""
        moved, turned = (self._heard.fresh(name) for name in POSE)
        if moved is None or turned is None:
            return False
        return stands_still(speed=local_speed(moved), yaw_rate=turned.yawspeed)

    def battery(self) -> float | None:
        """0 to 1, as it last told, however old; `None` if it never did."""
        for name in ("BATTERY_STATUS", "SYS_STATUS"):
            told = self._heard.newest(name)
            charge = None if told is None else charge_of(told.battery_remaining)
            if charge is not None:
                return charge
        return None

    def origin(self, since_s: float | None = None) -> VehicleOrigin | None:
        """What its metres count from; `None` if it has none, or has not told it since then (monotonic)."""
        at_s = time.monotonic() - ORIGIN_S if since_s is None else since_s
        told = self._heard.since("GPS_GLOBAL_ORIGIN", at_s)
        return None if told is None else origin_of(told)

    def mode_since(self, at_s: float) -> Mode | None:
        """The mode that a heartbeat has told since then (monotonic); `None` if none came."""
        beat = self._heard.since("HEARTBEAT", at_s)
        return None if beat is None else self.kind.mode_of(beat)

    @property
    def is_late(self) -> bool:
        """Whether it should have told its place and heading again by now."""
        return max(self._heard.age_s(name) for name in POSE) > self._heard.late_s

    @property
    def is_gone(self) -> bool:
        """Whether it has been late for so long that nobody should wait for it any longer."""
        return max(self._heard.age_s(name) for name in POSE) > self._heard.lost_s

    def mode(self) -> Mode:
        return self.kind.mode_of(self.peer.heartbeat)

    @property
    def holds_by_itself(self) -> bool:
        """Whether it is on hold by a failsafe of its own, as one that lives on setpoints is without them."""
        beat = self.peer.heartbeat
        return self.kind.mode_of(beat) == self.modes.hold and self.kind.in_failsafe(beat)

    def out_of_reach(self) -> str:
        """Why nobody knows where it is or what it does; empty if all is well."""
        if is_lost(self.peer.silent_s):
            gone = f" ({self.peer.wire.gone})" if self.peer.wire.gone else ""
            return f"the autopilot has not been heard for {self.peer.silent_s:.0f} s{gone}"
        lost = [name for name in POSE if self._heard.fresh(name) is None]
        return f"the autopilot tells no {lost[0]}: has it lost its position?" if lost else ""

    def in_other_hands(self) -> str:
        """Who has it, if it is in a mode that is neither ours nor to hold; empty if it is not."""
        mode = self.mode()
        if mode in (self.modes.guided, self.modes.hold):
            return ""
        name = self.modes.name(mode)
        return f"the autopilot is in {name}: somebody else drives it; to hand it over, switch it to HOLD"

    def changed_hands(self) -> str:
        """What somebody else has switched it to since we left or drove it; empty if nobody did."""
        mode = self.mode()
        ours = self._stop_owed.is_set() and mode == self.modes.hold
        if ours or self.left in (None, mode):
            return ""
        return f"somebody switched the autopilot to {self.modes.name(mode)}"

    def leave(self) -> None:
        """Take the mode it is in for the one we know: whoever orders to go on knows of it.

        From a mode in which somebody else drives it, going on hold is handing it over.
        """
        self.left = None if self.in_other_hands() else self.mode()

    def _told(self, name: str) -> Message:
        told = self._heard.newest(name)
        assert told is not None  # `await_pose`
        return told

    # What it is told

    def aim(self, place: Point) -> None:
        """Drive to a place, in a straight line."""
        self.peer.send(aim_at(self.peer.who, place, **self._setpoint))

    def keep_course(self, yaw: float, speed: float) -> None:
        """Turn to a yaw and drive along it, backwards if the speed is negative; for `gives_up_s` at most."""
        by_vector = self.kind.driving.courses == "vector"
        speed = max(speed, TURNING_M_S) if by_vector else speed
        velocity = (speed * math.cos(yaw), speed * math.sin(yaw)) if by_vector else (speed, 0.0)
        self.peer.send(keep_course(self.peer.who, velocity, yaw, **self._setpoint))

    def halt(self) -> None:
        """Stand where it is, and neither drive nor turn."""
        if self.kind.driving.courses == "vector":
            self.aim(self.place())
        else:
            self.keep_course(self.yaw(), 0.0)

    def aim_yaw(self, yaw: float) -> None:
        """Turn where it stands."""
        self.peer.send(aim_yaw(self.peer.who, yaw, **self._setpoint))

    def order(self, command: int, *params: float, what: str) -> str:
        """Why an order was not obeyed; empty if it was."""
        with self.peer.waiting("STATUSTEXT") as waiting:
            try:
                ack = self.peer.command(command, *params, patience_s=ORDER_S)
            except OutcomeUnknown:
                return f"the autopilot did not answer {what}{self.peer.why_silent()}"
            if ack.accepted:
                return ""
            said = _said(waiting)
        return f"the autopilot answered {what} with {ack.name}" + (f' (it said "{said}")' if said else "")

    @property
    def up_s(self) -> float:
        """Seconds since it was started, by its own clock."""
        return float(self._told("LOCAL_POSITION_NED").time_boot_ms) / 1000

    def arm(self) -> str:
        """Why it cannot be armed; empty once it is."""
        return self.order(Command.COMPONENT_ARM_DISARM, 1.0, what="arming")

    def ask_origin(self, origin: VehicleOrigin) -> None:
        """Give it back the origin that it had; it says itself whether it has taken it."""
        self.peer.send(set_origin(self.peer.who, origin))
        self.peer.request(MessageId.GPS_GLOBAL_ORIGIN)

    def take(self, woke: Mode) -> str:
        """Put it on hold after it was started again in the mode `woke`; why not, if somebody else has it."""
        if self.mode() not in (woke, self.modes.hold):
            return f"somebody switched the autopilot to {self.modes.name(self.mode())}"
        self.left = None
        asked_s = time.monotonic()
        why = self.order(Command.DO_SET_MODE, *self.modes.hold.params, what="the mode to hold")
        while not why and self.mode_since(asked_s) != self.modes.hold:
            self.peer.request(MessageId.HEARTBEAT)
            self._closing.wait(KEEP_S)
            if time.monotonic() > asked_s + ORDER_S:
                why = "the autopilot took the order to hold and does not show it"
        return why

    def guide(self) -> str:
        """Why it does not go into the mode in which we drive it; empty if it may (`is_guided`)."""
        with self._turns:
            self._stop_owed.clear()
            self._guide_asked_s = time.monotonic()
        self.left = guided = self.modes.guided
        name = self.modes.name(guided)
        return self.order(Command.DO_SET_MODE, *guided.params, what=f"the mode {name}")

    def is_guided(self) -> bool:
        """Whether a heartbeat has shown it since `guide`; one from before a cut line shows nothing."""
        beat = self._heard.since("HEARTBEAT", self._guide_asked_s)
        if beat is None:
            self.peer.request(MessageId.HEARTBEAT)
            return False
        return self.kind.mode_of(beat) == self.modes.guided

    def stop(self) -> None:
        """Order to hold, and wait a moment to see it obeyed; it is ordered on until it is.

        Somebody who drives the vehicle in another mode is left alone.
        """
        self._stop_asked_s = time.monotonic()
        self._stop_owed.set()
        until = self._stop_asked_s + STOP_S
        while self._stop_owed.is_set() and time.monotonic() < until and not self._closing.is_set():
            self._hold()
            self._closing.wait(KEEP_S)

    def _hold(self) -> None:
        """Order what is still owed, or see that it is no longer."""
        with self._turns:
            if not self._stop_owed.is_set():
                return
            beat = self._heard.since("HEARTBEAT", self._stop_asked_s + IN_FLIGHT_S)
            mode = self.mode()
            if beat is not None and mode != self.modes.guided:
                self.leave()
                self._stop_owed.clear()
            elif mode in (self.modes.guided, self.modes.hold):
                self.peer.send(command_long(self.peer.who, Command.DO_SET_MODE, *self.modes.hold.params))
        self.peer.request(MessageId.HEARTBEAT)

    @contextmanager
    def standing_at(self, place: Point) -> Iterator[None]:
        """Keep telling it to stand there, whatever else is waited for; never more than that by itself."""
        self._stands = place
        try:
            yield
        finally:
            self._stands = None

    def _keep(self) -> None:
        """Until closed: ask for what should be told and is not, and order the stop that is owed."""
        asked_s = -math.inf
        while not self._closing.wait(KEEP_S):
            stands = self._stands
            if stands is not None:
                self.aim(stands)
            if self._stop_owed.is_set():
                self._hold()
            if time.monotonic() - asked_s >= ASK_S:
                asked_s = time.monotonic()
                self._ask_for_streams()

    def _ask_for_streams(self) -> None:
        """One that was started again tells its place as seldom as by default, and that is not enough."""
        came = self._heard.counted()
        for name, (number, hertz) in STREAMS.items():
            missing = self._heard.newest(name, 3.0 / hertz + 1.0) is None
            if missing or came[name] < RARE * hertz * ASK_S - 1:
                self.peer.send(interval(self.peer.who, number, hertz))
        if self._heard.newest("GPS_GLOBAL_ORIGIN", ASK_ORIGIN_S) is None:
            self.peer.request(MessageId.GPS_GLOBAL_ORIGIN)

    @property
    def _setpoint(self) -> dict[str, Any]:
        """What every setpoint bears: the height it is at, and the time."""
        down = self._told("LOCAL_POSITION_NED").z
        return {"down": down, "now_ms": int(time.monotonic() * 1000)}


def _said(waiting: MessageQueue) -> str:
    """What it says of an order that it refused: its complaint, or else its last words; they may come late."""
    until_s, said = time.monotonic() + WORDS_S, ""
    while (message := waiting.get(until_s - time.monotonic())) is not None:
        said = message.text
        if is_arming_refusal(said):
            break
    return said
