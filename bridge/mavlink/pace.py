"""How much is under way at once, and when it is sent again: from the round trips that were seen."""

from __future__ import annotations

import time

from bridge.mavlink.peer import Peer

WINDOW = 8
"""Items under way at once: some 400 bytes, what a telemetry radio takes in one go."""
FIRST_S = 0.3
"""Before anything is sent again when no round trip has been seen."""
LEAST_S = 0.05
MOST_S = 2.0
SOON = 0.9
"""Part of the shortest round trip before which no answer to what was just sent can be there."""
GROWTH = 1.5
MOST_GROWTH = 4.0
"""Enough for a line that is full; one that loses must not be kept waiting for longer and longer."""


class Pace:
    """Round trips of one transfer, smoothed with their deviation as TCP does (RFC 6298)."""

    def __init__(self, window: int) -> None:
        self.window = window
        self._shortest_s: float | None = None
        self._smooth_s = 0.0
        self._deviation_s = 0.0
        self._growth = 1.0

    @property
    def again_s(self) -> float:
        """How long to wait for an answer before sending again."""
        if self._shortest_s is None:
            return min(MOST_S, FIRST_S * self._growth)
        usual = self._smooth_s + max(4.0 * self._deviation_s, self._smooth_s / 2.0)
        return min(MOST_S, max(LEAST_S, usual) * self._growth)

    @property
    def soonest_s(self) -> float:
        """Before this has passed, nothing that comes in can be an answer to what was just sent."""
        return SOON * (self._shortest_s or 0.0)

    def saw(self, round_trip_s: float) -> None:
        """A round trip was seen, of something that was sent only once."""
        if self._shortest_s is None:
            self._shortest_s, self._smooth_s, self._deviation_s = round_trip_s, round_trip_s, round_trip_s / 2
            return
        self._shortest_s = min(self._shortest_s, round_trip_s)
        off_s = round_trip_s - self._smooth_s
        self._deviation_s += (abs(off_s) - self._deviation_s) / 4.0
        self._smooth_s += off_s / 8.0

    def waited(self) -> None:
        """Nothing came in time: the line may be full, not lossy."""
        self._growth = min(MOST_GROWTH, self._growth * GROWTH)

    def went_on(self) -> None:
        self._growth = 1.0


class Silence:
    """How long nothing has come that counts, and how long nothing has gone on."""

    def __init__(self, patience_s: float, stall_s: float | None = None) -> None:
        self.patience_s = patience_s
        self._stall_s = stall_s or 6 * patience_s
        self._heard_s = self._went_on_s = time.monotonic()

    def heard(self, *, went_on: bool) -> None:
        self._heard_s = time.monotonic()
        if went_on:
            self._went_on_s = self._heard_s

    @property
    def seconds(self) -> float:
        return time.monotonic() - self._heard_s

    @property
    def over(self) -> bool:
        """Whether it is time to give up; a vehicle that only repeats itself gets a little longer."""
        return self.seconds > self.patience_s or time.monotonic() - self._went_on_s > self._stall_s


def window_for(peer: Peer) -> int:
    """How many items may be under way at once; on a slow line answers must not queue behind items."""
    return 1 if peer.wire.slow else WINDOW
