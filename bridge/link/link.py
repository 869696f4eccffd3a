"""Interface of a link, which carries bytes between station and robot.

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
    """A question as it arrives at the end that answers it."""

    key: str
    payload: bytes
    parameters: Mapping[str, str] = field(default_factory=dict)
    attachment: bytes = b""
    holder: Holder | None = None
    """The verified sender; `None` if ends hold no keys."""
    fresh: bool = True
    """True if the question was certainly asked just now."""


class Unanswered(Exception):
    """Raised by a function that answers, to give no answer at all."""


Answering = Callable[[Request], bytes]
Hearing = Callable[[str, bytes], None]
Publish = Callable[[bytes], None]
Presence = Callable[[str, bool], None]


class Link(Protocol):
    """The transport as both ends use it. Callbacks come from the link's own threads.

    Where ends hold keys a link signs its messages, and passes on only verified ones.
    """

    @property
    def distrusted(self) -> str:
        """Reason of the last message that was not accepted; empty if all were."""

    @property
    def may_be_sent(self) -> bool:
        """True once a question may have left for another end, which may get it later."""

    def serve(self, key: str, answer: Answering) -> None:
        """Answer every question on `key` (which may hold wildcards), one at a time."""

    def publisher(self, key: str, *, bulk: bool = False) -> Publish:
        """Return a function that publishes on `key`; `bulk` messages may be dropped on a full link."""

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
        """Return the answer of the end that serves `key`, or `None` if none came in time.

        A `bulk` question and its answer have a lower priority than others.
        """

    def ask_all(self, key: str, payload: bytes = b"", *, timeout_s: float) -> list[bytes]:
        """Return the answers of all ends that serve `key`: more than one if two robots have one name."""

    def hear(self, key: str, heard: Hearing) -> None:
        """Call `heard` with every sample on `key` from now on."""

    def watch_presence(self, key: str, changed: Presence) -> None:
        """Call `changed` with (key, alive) for every announcement on `key`, past ones included."""

    def close(self) -> None: ...


def endpoints_in(text: str) -> list[str]:
    """Return the endpoints in a text, with commas between them."""
    return text.split(",")


def matches(pattern: str, key: str) -> bool:
    """True if a key expression with `*` (one part) and a last `**` (any number) includes `key`."""
    wanted, parts = pattern.split("/"), key.split("/")
    if wanted[-1] == "**":
        wanted.pop()
        parts = parts[: len(wanted)]
    return len(wanted) == len(parts) and all(
        want in ("*", part) for want, part in zip(wanted, parts, strict=True)
    )
