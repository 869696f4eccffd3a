"""Time that a peer takes to answer: smoothed, with its deviation, as TCP does (RFC 6298)."""

from __future__ import annotations


class RoundTrips:
    """Round trips measured with one peer, in all transfers."""

    def __init__(self) -> None:
        self.shortest_s: float | None = None
        self._smooth_s = 0.0
        self._deviation_s = 0.0
        self._guessed = True

    @property
    def expected_s(self) -> float | None:
        """Time after which an answer is missing; `None` before any was measured."""
        if self.shortest_s is None:
            return None
        return self._smooth_s + max(4.0 * self._deviation_s, self._smooth_s / 2.0)

    def guess(self, seconds: float) -> None:
        """Take the time since the last of several repetitions; it counts only until one is measured."""
        if self.shortest_s is None:
            self._begin(seconds)

    def saw(self, seconds: float) -> None:
        if self._guessed:
            self._guessed = False
            return self._begin(seconds)
        assert self.shortest_s is not None
        self.shortest_s = min(self.shortest_s, seconds)
        off_s = seconds - self._smooth_s
        self._deviation_s += (abs(off_s) - self._deviation_s) / 4.0
        self._smooth_s += off_s / 8.0

    def _begin(self, seconds: float) -> None:
        self.shortest_s, self._smooth_s, self._deviation_s = seconds, seconds, seconds / 2.0
