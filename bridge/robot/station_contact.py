"""Contact of a robot with its stations: the time since any of them watched or asked."""

from __future__ import annotations

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.link.link import Request

TOKEN_S = 15.0
"""Time that a token counts after its station's last signed question; one that watches asks every 5 s."""


class StationContact:
    """The stations that watch, and the time of the last contact; told by the link's threads."""

    def __init__(self, command_clock: Clock) -> None:
        self._command_clock = command_clock
        self._watchers: set[str] = set()
        self._contact_ns = command_clock.now_ns()
        self._signed_ns: int | None = None
        """Time of the last question of a holder of keys, if ends hold keys."""

    def on_presence(self, key: str, alive: bool) -> None:
        """Note that a station's token has appeared or disappeared."""
        (self._watchers.add if alive else self._watchers.discard)(key)
        if self._signed_ns is None:
            self._contact_ns = self._command_clock.now_ns()

    def on_request(self, request: Request) -> None:
        """Note a question, unless it may be a repetition of an old one by somebody else."""
        if request.fresh:
            self._contact_ns = self._command_clock.now_ns()
            if request.holder is not None:
                self._signed_ns = self._contact_ns

    def silent_s(self) -> float:
        """Return the seconds since a station last watched or asked.

        Where ends hold keys, a token alone proves no station. It counts while its station asks now and then.
        """
        now_ns = self._command_clock.now_ns()
        if self._watchers and (self._signed_ns is None or now_ns - self._signed_ns < TOKEN_S * 1e9):
            self._contact_ns = now_ns
        return (now_ns - self._contact_ns) / 1e9
