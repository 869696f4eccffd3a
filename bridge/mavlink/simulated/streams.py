"""Intervals at which the simulated vehicle sends its messages, and the messages that are due."""

from __future__ import annotations

import math
from collections.abc import Collection

from stopgo.bridge.link.clock import Clock
from stopgo.mission.mavlink.enums import MessageId

LOWEST_INTERVAL_US, HIGHEST_INTERVAL_US = 10_000, 2**31 - 1
DEFAULT_US: dict[int, int] = {
    MessageId.HEARTBEAT: 1_000_000,
    MessageId.SYS_STATUS: 1_000_000,
    MessageId.GPS_RAW_INT: 1_000_000,
    MessageId.ATTITUDE: 250_000,
    MessageId.LOCAL_POSITION_NED: 250_000,
    MessageId.GLOBAL_POSITION_INT: 250_000,
    MessageId.MISSION_CURRENT: 1_000_000,
    MessageId.GPS_GLOBAL_ORIGIN: 1_000_000,
    MessageId.VFR_HUD: 1_000_000,
    MessageId.BATTERY_STATUS: 2_000_000,
    MessageId.HOME_POSITION: 2_000_000,
    MessageId.EXTENDED_SYS_STATE: 1_000_000,
}
"""Interval of each message unless a station requests another; the others are sent only on events."""


class Streams:
    """Due time of each message, by the wall's clock: stations use their own, however time is sped up."""

    def __init__(self, clock: Clock, known: Collection[int]) -> None:
        self._clock = clock
        self._known = known
        """Numbers of the messages that can be sent."""
        self._every_us = dict(DEFAULT_US)
        self._due_ns = dict.fromkeys(DEFAULT_US, clock.now_ns())

    def interval_us(self, number: int) -> int:
        """Interval of a message; 0 if it is not known, -1 if it is not sent."""
        return self._every_us.get(number, -1) if number in self._known else 0

    def set(self, number: int, interval_us: float) -> bool:
        """Set an interval (0: default, negative: never); false if the message is not known."""
        if number not in self._known or not math.isfinite(interval_us):
            return False
        wanted = DEFAULT_US.get(number, -1) if interval_us == 0 else round(interval_us)
        if wanted < 0:
            self._every_us.pop(number, None)
            self._due_ns.pop(number, None)
        else:
            self._every_us[number] = min(max(LOWEST_INTERVAL_US, wanted), HIGHEST_INTERVAL_US)
            self._due_ns[number] = self._clock.now_ns()
        return True

    def wait_s(self) -> float:
        """Seconds until the next message is due; endless if none is sent."""
        return (min(self._due_ns.values(), default=math.inf) - self._clock.now_ns()) / 1e9

    def due(self) -> list[int]:
        """The messages that are due, each next time an interval from now."""
        now = self._clock.now_ns()
        found = [number for number, due in self._due_ns.items() if due <= now]
        for number in found:
            self._due_ns[number] = now + self._every_us[number] * 1000
        return found
