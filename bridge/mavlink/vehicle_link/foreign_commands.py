"""Other hands on a vehicle: commands of other stations, and motions of its remote control, as they are heard.

A link carries another station's commands where all share it, as on a radio. Elsewhere it may carry the
vehicle's answers to them. Nothing heard proves nothing: the command may have come by another link.
"""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass
from typing import Literal

from stopgo.bridge.mavlink.vehicle_link.wire import MessageQueue, Who, sender
from stopgo.mission.mavlink.autopilots.kind import Autopilot, Mode
from stopgo.mission.mavlink.enums import CommandResult, MessageId
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.telemetry import Message, is_lost

Effect = Literal["mode", "item", "arming", "set points", "override"]
"""What a command changes; `override`: it moves the sticks of a remote control in its place."""

EFFECTS: dict[int, Effect] = {
    MessageId.SET_MODE: "mode",  # so ArduPilot acknowledges that message
    Command.DO_SET_MODE: "mode",
    Command.DO_PAUSE_CONTINUE: "mode",
    Command.DO_REPOSITION: "mode",
    Command.NAV_LOITER_UNLIM: "mode",
    Command.NAV_RETURN_TO_LAUNCH: "mode",
    Command.MISSION_START: "mode",
    Command.DO_SET_MISSION_CURRENT: "item",
    Command.COMPONENT_ARM_DISARM: "arming",
    Command.DO_FLIGHTTERMINATION: "arming",
}
"""Effect of each command, by its number."""
BY_STATION: dict[str, Effect] = {
    "SET_MODE": "mode",
    "MISSION_SET_CURRENT": "item",
    "SET_POSITION_TARGET_LOCAL_NED": "set points",
    "SET_POSITION_TARGET_GLOBAL_INT": "set points",
    "SET_ATTITUDE_TARGET": "set points",
    "RC_CHANNELS_OVERRIDE": "override",
    "MANUAL_CONTROL": "override",
}
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")
HEARD = frozenset({*BY_STATION, *COMMANDS, "COMMAND_ACK", "RC_CHANNELS"})
BEFORE_S, AFTER_S = 10.0, 1.0
"""A change has a cause that was heard this long before it was seen, or after: reports overtake each other."""
KEPT = 200
"""Commands and motions that are remembered."""
JUST_NOW_S = 1.0
CHANNELS, STICKS = range(1, 19), 4
"""Numbers of a remote control's channels; those of its sticks come first."""
MOVED_US = 80
"""Change of a channel (microseconds) that is a motion: a switch of three positions moves by hundreds."""
SIGNAL_US = range(800, 2201)
"""Values of a channel that has a signal; others are a lost remote control, or one that is not on yet."""
DEFLECTED = 100
"""Deflection of a joystick (of 1000) that is a motion."""
UNTOUCHED = (0, 32_767, 65_535)
"""Values of an override, or of a joystick, that leave a channel as it is."""
OVERRIDDEN = range(1, 9)
"""Channels whose override counts."""
AGAIN_S, RECENT = 0.4, 20
"""A command that came this recently, among the last so many, is not noted again: some come in streams."""


@dataclass(frozen=True)
class HeardCommand:
    """A command of another station, heard at a time (monotonic)."""

    by: Who
    effect: Effect
    at_s: float
    mode: Mode | None = None
    """The mode that it asks for; `None` if it does not say."""

    def __str__(self) -> str:
        return f"system {self.by.system}, component {self.by.component}"


@dataclass(frozen=True)
class MovedChannel:
    """A motion of the remote control as the vehicle reports its channels."""

    channel: int
    before_us: int
    after_us: int
    at_s: float
    has_receiver: bool = True
    """False if RC_CHANNELS reports no receiver: then a station overrides the channel."""

    def __str__(self) -> str:
        moved = f"channel {self.channel}: {self.before_us} → {self.after_us} µs"
        if self.has_receiver:
            return f"the remote control (its {moved})"
        return f"a station in place of a remote control (not known which; {moved})"


class ForeignCommands(MessageQueue):
    """Hears what others command one vehicle; the texts name who did it, empty if that is not known."""

    overhears = True

    def __init__(self, vehicle: Who, me: Who, autopilot: Autopilot) -> None:
        super().__init__()
        self._vehicle = vehicle
        self._me = me
        self._modes = autopilot.modes
        self._commands: deque[HeardCommand] = deque(maxlen=KEPT)
        self._motions: deque[MovedChannel] = deque(maxlen=KEPT)
        self._channels: list[int] = []
        """Each channel as it was at its last motion."""
        self._channels_s = -math.inf
        self._sticks: dict[tuple[Who, str], tuple[int, ...]] = {}
        """Last sticks of each station that sends some, by the message's name."""

    def wants(self, message: Message) -> bool:
        return message.get_type() in HEARD

    def put(self, message: Message) -> None:
        who, name = sender(message), message.get_type()
        if who == self._vehicle:
            if name == "RC_CHANNELS":
                self._take_channels(message)
            elif name == "COMMAND_ACK":
                self._take_answer(message)
        elif who != self._me and _target(message) in (0, self._vehicle.system):
            self._take_command(message, name, who)

    # Texts

    def station(self, effect: Effect, age_s: float = 0.0, mode: Mode | None = None) -> str:
        """The station that commanded a change which was seen `age_s` ago, to this mode."""
        seen_s = time.monotonic() - age_s
        for command in reversed(tuple(self._commands)):
            fits = command.mode is None or mode is None or command.mode == mode
            if command.effect == effect and fits and _is_cause(command.at_s, seen_s):
                return str(command)
        return ""

    def remote_control(self, age_s: float = 0.0) -> str:
        """The remote control, if it was moved about when a change was seen, `age_s` ago.

        A station that overrides its channels moves what the vehicle reports of them; then it is named.
        """
        seen_s = time.monotonic() - age_s
        moved = next((one for one in reversed(tuple(self._motions)) if _is_cause(one.at_s, seen_s)), None)
        return "" if moved is None else self.station("override", age_s) or str(moved)

    def sticks_moved(self, within_s: float = JUST_NOW_S) -> str:
        """Whoever has moved the vehicle's sticks within this time, by remote control or in its place."""
        since_s = time.monotonic() - within_s
        for command in reversed(tuple(self._commands)):
            if command.effect == "override" and command.at_s >= since_s:
                return str(command)
        sticks = (one for one in reversed(tuple(self._motions)) if one.channel <= STICKS)
        return next((str(one) for one in sticks if one.at_s >= since_s), "")

    def sends_set_points(self, within_s: float = JUST_NOW_S) -> str:
        """The station that has sent set points within this time."""
        since_s = time.monotonic() - within_s
        heard = (one for one in reversed(tuple(self._commands)) if one.effect == "set points")
        return next((str(one) for one in heard if one.at_s >= since_s), "")

    def awaits_channels(self, age_s: float) -> bool:
        """True if the remote control's next report may still show who made a change seen `age_s` ago."""
        reported_s = time.monotonic() - self._channels_s
        return not is_lost(reported_s) and reported_s > age_s and age_s < AFTER_S

    # Messages

    def _take_command(self, message: Message, name: str, who: Who) -> None:
        mode = None
        if name in COMMANDS:
            effect = EFFECTS.get(message.command)
            if message.command == Command.DO_SET_MODE:
                mode = Mode(_whole(message.param2), _whole(message.param3))
        else:
            effect = BY_STATION.get(name)
            mode = self._modes.of(message.custom_mode) if name == "SET_MODE" else None
        if effect is None or (effect == "override" and not self._moves(message, name, who)):
            return
        self._note(HeardCommand(who, effect, time.monotonic(), mode))

    def _note(self, command: HeardCommand) -> None:
        for known in tuple(self._commands)[-RECENT:]:
            same = (known.by, known.effect, known.mode) == (command.by, command.effect, command.mode)
            if same and command.at_s < known.at_s + AGAIN_S:
                return
        self._commands.append(command)

    def _moves(self, message: Message, name: str, who: Who) -> bool:
        """True if the sticks that a station sends have moved; at first, if they are not in the middle."""
        if name == "MANUAL_CONTROL":
            values, least = [message.x, message.y, message.r], DEFLECTED
        else:
            values, least = [getattr(message, f"chan{nth}_raw") for nth in OVERRIDDEN], MOVED_US
        sticks = tuple(0 if one in UNTOUCHED else one for one in values)
        before = self._sticks.get((who, name), (0,) * len(sticks))
        self._sticks[who, name] = sticks
        return any(abs(now - then) >= least for now, then in zip(sticks, before, strict=True))

    def _take_answer(self, message: Message) -> None:
        """Take the vehicle's answer to another station: only accepted commands have an effect."""
        to = Who(message.target_system, message.target_component)
        effect = EFFECTS.get(message.command)
        if effect is None or to.system == 0 or to == self._me or message.result != CommandResult.ACCEPTED:
            return
        self._note(HeardCommand(to, effect, time.monotonic()))

    def _take_channels(self, message: Message) -> None:
        now_s = time.monotonic()
        channels = tuple(getattr(message, f"chan{nth}_raw") for nth in CHANNELS)
        if not self._channels:
            self._channels = list(channels)
        for nth, (before, after) in enumerate(zip(self._channels, channels, strict=True)):
            known = before in SIGNAL_US and after in SIGNAL_US
            if known and abs(after - before) >= MOVED_US:
                self._motions.append(MovedChannel(nth + 1, before, after, now_s, message.chancount > 0))
            if not known or abs(after - before) >= MOVED_US:
                self._channels[nth] = after
        self._channels_s = now_s


def _is_cause(at_s: float, seen_s: float) -> bool:
    return seen_s - BEFORE_S <= at_s <= seen_s + AFTER_S


def _target(message: Message) -> int:
    """System that a message is for; MANUAL_CONTROL has it under another name."""
    return int(getattr(message, "target_system", getattr(message, "target", 0)))


def _whole(value: float) -> int:
    return round(value) if math.isfinite(value) else -1
