"""A link carries bytes between station and robot; this is its interface.

`ask` gives `None` when no answer came: that means unknown, never "not carried out".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from stopgo.bridge.link.keys import Holder


@dataclass(frozen=True)
class Request:
    """A question as it reaches the end that answers it."""

    key: str
    payload: bytes
    parameters: Mapping[str, str] = field(default_factory=dict)
    seal: bytes = b""
    holder: Holder | None = None
    """Who asks, where ends hold keys; that has been verified then."""
    fresh: bool = True
    """Whether it is certain that it was asked just now."""


class Unanswered(Exception):
    """Raised by whoever answers, to give no answer at all."""


Answering = Callable[[Request], bytes]
Hearing = Callable[[str, bytes], None]
Publish = Callable[[bytes], None]
Presence = Callable[[str, bool], None]


class Link(Protocol):
    """What both ends need of a transport. Callbacks come from the link's own threads.

    Where ends hold keys a link seals what is said on it, and passes on only what is to be believed.
    """

    @property
    def distrusted(self) -> str:
        """Why the last message that was not believed was not; empty if all were."""

    def serve(self, key: str, answer: Answering) -> None:
        """Answer every question on `key` (which may hold wildcards), one at a time."""

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
    ) -> bytes | None:
        """The answer of the one who serves `key`, or `None` if none came in time.

        A question that is `bulk`, and its answer, give way to others on a full line.
        """

    def ask_all(self, key: str, payload: bytes = b"", *, timeout_s: float) -> list[bytes]:
        """The answers of all who serve `key`: more than one if two robots have one name."""

    def hear(self, key: str, heard: Hearing) -> None:
        """Call `heard` with every sample on `key` from now on."""

    def watch_presence(self, key: str, changed: Presence) -> None:
        """Call `changed` with (key, alive) for every announcement on `key`, past ones included."""

    def close(self) -> None: ...


def endpoints_in(text: str) -> list[str]:
    """Where to connect to, as it is typed: endpoints with commas between them."""
    return text.split(",")


def matches(pattern: str, key: str) -> bool:
    """Whether a key expression with `*` (one part) and a last `**` (any number) includes `key`."""
    wanted, parts = pattern.split("/"), key.split("/")
    if wanted[-1] == "**":
        wanted.pop()
        parts = parts[: len(wanted)]
    return len(wanted) == len(parts) and all(
        want in ("*", part) for want, part in zip(wanted, parts, strict=True)
    )
