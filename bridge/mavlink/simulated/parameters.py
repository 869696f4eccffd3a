"""Parameters that a ground station can read and set: most of them are for driving (`tuning`)."""

from __future__ import annotations

from collections.abc import Callable

from stopgo.bridge.mavlink.simulated import replies
from stopgo.bridge.mavlink.simulated.tuning import Tuning
from stopgo.bridge.mavlink.simulated.vehicle_scanner import DEFAULT_S, LONGEST_S
from stopgo.bridge.mavlink.vehicle_link.wire import Who
from stopgo.mission.mavlink.autopilots.kind import ProtocolBehaviour
from stopgo.mission.mavlink.telemetry import Message

SCAN_TIME = "SIM_SCAN_TIME"
"""Duration of a scan in seconds if its trigger gives none."""


class Parameters:
    """Named numbers, float32 in messages."""

    def __init__(
        self, habits: ProtocolBehaviour, tuning: Tuning, *, speed: float, set_speed: Callable[[float], bool]
    ) -> None:
        self._speed, self._set_speed, self._tuning = habits.speed_parameter, set_speed, tuning
        self._values = {
            **tuning.values,
            habits.system_parameter: 1.0,
            self._speed: speed,
            SCAN_TIME: DEFAULT_S,
        }

    @property
    def scan_s(self) -> float:
        return self._values[SCAN_TIME]

    def all(self) -> list[Message]:
        return [self._value(name) for name in self._values]

    def read(self, message: Message) -> Message | None:
        """The parameter requested by index or, if that is -1, by name."""
        names = list(self._values)
        if message.param_index >= 0:
            return self._value(names[message.param_index]) if message.param_index < len(names) else None
        return self._value(name) if (name := _name(message.param_id)) in self._values else None

    def set(self, message: Message) -> Message | None:
        """Set a parameter; return its value afterwards, changed or not."""
        name, value = _name(message.param_id), message.param_value
        if name not in self._values:
            return None
        if self._allowed(name, value):
            self._values[name] = value
        return self._value(name)

    def _allowed(self, name: str, value: float) -> bool:
        if name == self._speed:
            self._tuning.set(name, value)
            return self._set_speed(value)
        if name == SCAN_TIME:
            return 0 < value <= LONGEST_S
        return self._tuning.set(name, value)

    def _value(self, name: str) -> Message:
        index = list(self._values).index(name)
        value, count = self._values[name], len(self._values)
        return replies.parameter(name, value, index=index, count=count)


def _name(raw: str | bytes) -> str:
    text = raw if isinstance(raw, str) else raw.decode("ascii", "replace")
    return text.rstrip("\0")


def parameter_handlers(
    parameters: Parameters, send: Callable[[Message], None]
) -> dict[str, Callable[[Who, Message], None]]:
    """Handler of each message about parameters."""

    def send_known(value: Message | None) -> None:
        if value is not None:
            send(value)

    def send_all() -> None:
        for value in parameters.all():
            send(value)

    return {
        "PARAM_REQUEST_LIST": lambda who, message: send_all(),
        "PARAM_REQUEST_READ": lambda who, message: send_known(parameters.read(message)),
        "PARAM_SET": lambda who, message: send_known(parameters.set(message)),
    }
