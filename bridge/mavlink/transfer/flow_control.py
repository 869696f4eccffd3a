"""How much is under way at once, when it is sent again, and when a transfer is given up."""

from __future__ import annotations

import time

from stopgo.bridge.mavlink.line.peer import Peer
from stopgo.bridge.mavlink.line.round_trips import RoundTrips

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
    """When what is under way on one transfer is sent again."""

    def __init__(self, window: int, trips: RoundTrips) -> None:
        self.window = window
        self._trips = trips
        self._waits = 0

    @property
    def again_s(self) -> float:
        """How long to wait for an answer before sending again."""
        expected_s = self._trips.expected_s
        usual_s = FIRST_S if expected_s is None else max(LEAST_S, expected_s)
        growth = GROWTH ** max(0, self._waits - 1)  # one loss is no sign of a full line
        return min(MOST_S, usual_s * min(MOST_GROWTH, growth))

    @property
    def soonest_s(self) -> float:
        """Before this has passed, nothing that comes in can be an answer to what was just sent."""
        return SOON * (self._trips.shortest_s or FIRST_S)

    def saw(self, round_trip_s: float) -> None:
        """A round trip was seen, of something that was sent only once."""
        self._trips.saw(round_trip_s)

    def guessed(self, round_trip_s: float) -> None:
        """As `saw`, of something that was sent again: better than nothing, and only until better is seen."""
        self._trips.guess(round_trip_s)

    def waited(self) -> None:
        """Nothing came in time: the line may be full, not lossy."""
        self._waits += 1

    def went_on(self) -> None:
        self._waits = 0


class TransferTimeout:
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
