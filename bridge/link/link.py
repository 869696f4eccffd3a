"""A link carries bytes between station and robot; this is its interface, and the one in memory.

`ask` gives `None` when no answer came: that means unknown, never "not carried out".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol


@dataclass(frozen=True)
class Request:
    """A question as it reaches the end that answers it."""

    key: str
    payload: bytes
    parameters: Mapping[str, str] = field(default_factory=dict)
    signature: bytes = b""


Answering = Callable[[Request], bytes]
Hearing = Callable[[str, bytes], None]
Publish = Callable[[bytes], None]
Presence = Callable[[str, bool], None]


class Link(Protocol):
    """What both ends need of a transport. Callbacks come from the link's own threads."""

    def serve(self, key: str, answer: Answering, *, bulk: bool = False) -> None:
        """Answer every question on `key` (which may hold wildcards), one at a time.

        Answers that are `bulk` give way to others on a full line.
        """

    def publisher(self, key: str, *, bulk: bool = False) -> Publish:
        """A function that sends on `key`; what is `bulk` may be left out on a full line."""

    def announce(self, key: str) -> None:
        """Show that this end is alive until the link is closed."""

    def ask(
        self,
        key: str,
        payload: bytes = b"",
        *,
        timeout_s: float,
        parameters: Mapping[str, str] | None = None,
        bulk: bool = False,
        signature: bytes = b"",
    ) -> bytes | None:
        """The answer of the one who serves `key`, or `None` if none came in time."""

    def ask_all(self, key: str, *, timeout_s: float) -> list[bytes]:
        """The answers of all who serve a key that `key` (with wildcards) includes."""

    def hear(self, key: str, heard: Hearing) -> None:
        """Call `heard` with every sample on `key` from now on."""

    def watch_presence(self, key: str, changed: Presence) -> None:
        """Call `changed` with (key, alive) for every announcement on `key`, past ones included."""

    def close(self) -> None: ...


class Switchboard:
    """Joins links in memory: what one end publishes the others hear, at once and in the caller's thread."""

    def __init__(self) -> None:
        self.serving: dict[str, Answering] = {}
        self.hearing: list[tuple[str, Hearing]] = []
        self.watching: list[tuple[str, Presence]] = []
        self.alive: set[str] = set()
        self.cut = False
        """While true nothing passes."""

    def link(self) -> MemoryLink:
        return MemoryLink(self)


class MemoryLink:
    """One end of a switchboard."""

    def __init__(self, board: Switchboard) -> None:
        self._board = board
        self._announced: list[str] = []

    def serve(self, key: str, answer: Answering, *, bulk: bool = False) -> None:
        self._board.serving[key] = answer

    def publisher(self, key: str, *, bulk: bool = False) -> Publish:
        def publish(payload: bytes) -> None:
            for pattern, heard in list(self._board.hearing):
                if not self._board.cut and matches(pattern, key):
                    heard(key, payload)

        return publish

    def announce(self, key: str) -> None:
        self._announced.append(key)
        self._board.alive.add(key)
        self._tell_presence(key, True)

    def ask(
        self,
        key: str,
        payload: bytes = b"",
        *,
        timeout_s: float,
        parameters: Mapping[str, str] | None = None,
        bulk: bool = False,
        signature: bytes = b"",
    ) -> bytes | None:
        if self._board.cut:
            return None
        for pattern, answer in self._board.serving.items():
            if matches(pattern, key):
                return answer(Request(key, payload, parameters or {}, signature))
        return None

    def ask_all(self, key: str, *, timeout_s: float) -> list[bytes]:
        if self._board.cut:
            return []
        serving = self._board.serving.items()
        return [answer(Request(served, b"")) for served, answer in serving if matches(key, served)]

    def hear(self, key: str, heard: Hearing) -> None:
        self._board.hearing.append((key, heard))

    def watch_presence(self, key: str, changed: Presence) -> None:
        for alive in sorted(self._board.alive):
            if matches(key, alive):
                changed(alive, True)
        self._board.watching.append((key, changed))

    def close(self) -> None:
        for key in self._announced:
            self._board.alive.discard(key)
            self._tell_presence(key, False)

    def _tell_presence(self, key: str, alive: bool) -> None:
        for pattern, changed in list(self._board.watching):
            if matches(pattern, key):
                changed(key, alive)


def matches(pattern: str, key: str) -> bool:
    """Whether a key expression with `*` (one part) and a last `**` (any number) includes `key`."""
    wanted, parts = pattern.split("/"), key.split("/")
    if wanted[-1] == "**":
        wanted.pop()
        parts = parts[: len(wanted)]
    return len(wanted) == len(parts) and all(
        want in ("*", part) for want, part in zip(wanted, parts, strict=True)
    )
