"""How long a peer takes to answer: smoothed, with its deviation, as TCP does (RFC 6298)."""

from __future__ import annotations


class RoundTrips:
    """Those seen with one peer, by whatever transfer."""

    def __init__(self) -> None:
        self.shortest_s: float | None = None
        self._smooth_s = 0.0
        self._deviation_s = 0.0

    @property
    def expected_s(self) -> float | None:
        """After so long an answer is missing; `None` before any was seen."""
        if self.shortest_s is None:
            return None
        return self._smooth_s + max(4.0 * self._deviation_s, self._smooth_s / 2.0)

    def saw(self, seconds: float) -> None:
        if self.shortest_s is None:
            self.shortest_s, self._smooth_s, self._deviation_s = seconds, seconds, seconds / 2.0
            return
        self.shortest_s = min(self.shortest_s, seconds)
        off_s = seconds - self._smooth_s
        self._deviation_s += (abs(off_s) - self._deviation_s) / 4.0
        self._smooth_s += off_s / 8.0
