"""A line of the program itself on stderr, beginning with its name."""

from __future__ import annotations

import contextlib
import sys

from stopgo.mission.console.table import printable, shortened


def notice(message: str) -> None:
    """Print a message in one harmless line; nothing if it is empty or stderr is closed."""
    if message:
        with contextlib.suppress(OSError):
            line = " ".join(shortened(word) for word in message.split())
            print(f"stopgo: {printable(line)}", file=sys.stderr)  # noqa: T201
