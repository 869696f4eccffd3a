"""Flow control of a transfer: items in flight at once, repetition, and the end for lack of data."""

from __future__ import annotations

import time

from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.round_trips import RoundTrips

WINDOW = 8
"""Items in flight at once: some 400 bytes, as much as a telemetry radio takes at once."""
FIRST_S = 0.3
"""Wait before a repetition while no round trip has been measured."""
LEAST_S = 0.05
MOST_S = 2.0
SOON = 0.9
"""Fraction of the shortest round trip within which no answer can come."""
GROWTH = 1.5
MOST_GROWTH = 4.0
"""Enough for a link that is full; on one that loses frames the wait must not grow further."""


class Pace:
    """Times at which items in flight are sent again."""

    def __init__(self, window: int, trips: RoundTrips) -> None:
        self.window = window
        self._trips = trips
        self._waits = 0

    @property
    def again_s(self) -> float:
        """Seconds to wait for an answer before sending again."""
        expected_s = self._trips.expected_s
        usual_s = FIRST_S if expected_s is None else max(LEAST_S, expected_s)
        growth = GROWTH ** max(0, self._waits - 1)  # one loss is no sign of a full link
        return min(MOST_S, usual_s * min(MOST_GROWTH, growth))

    @property
    def soonest_s(self) -> float:
        """Seconds within which no message can be an answer to what was just sent."""
        return SOON * (self._trips.shortest_s or FIRST_S)

    def saw(self, round_trip_s: float) -> None:
        """Note a round trip of something that was sent only once."""
        self._trips.saw(round_trip_s)

    def guessed(self, round_trip_s: float) -> None:
        """Note a round trip of something that was sent again: it counts only until a better one is known."""
        self._trips.guess(round_trip_s)

    def waited(self) -> None:
        """Note that nothing came in time: the link may be full, not lossy."""
        self._waits += 1

    def went_on(self) -> None:
        self._waits = 0


class TransferTimeout:
    """Time without relevant data, and time without progress."""

    def __init__(self, patience_s: float, stall_s: float | None = None) -> None:
        self.patience_s = patience_s
        self._stall_s = stall_s or 6 * patience_s
        self._received_s = self._went_on_s = time.monotonic()

    def received(self, *, went_on: bool) -> None:
        self._received_s = time.monotonic()
        if went_on:
            self._went_on_s = self._received_s

    @property
    def seconds(self) -> float:
        return time.monotonic() - self._received_s

    @property
    def over(self) -> bool:
        """True if it is time to give up; a vehicle that only repeats itself gets more time."""
        return self.seconds > self.patience_s or time.monotonic() - self._went_on_s > self._stall_s


def window_for(peer: Peer) -> int:
    """Number of items in flight at once; on a slow link answers must not queue behind items."""
    return 1 if peer.wire.slow else WINDOW
