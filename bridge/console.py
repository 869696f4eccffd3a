"""What a command says to the person: lines and a progress bar on stderr, one JSON object on stdout."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from mission.errors import AnswerIsNo
from mission.table import printable, printable_lines

Progress = Callable[[int, int], None]
"""Called with what is done and what there is to do, as a bar's `show`."""

KILOBYTES = ("kB", 1000)


class Bar:
    """A progress bar on stderr, if that is a terminal."""

    def __init__(self, label: str, unit: tuple[str, int] = KILOBYTES) -> None:
        self._label = label
        self._unit, self._per = unit
        self._shows = sys.stderr.isatty()

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._shows:
            print(file=sys.stderr)  # noqa: T201

    def show(self, done: int, total: int) -> None:
        if self._shows:
            filled = 30 * done // max(1, total)
            bar = "█" * filled + "·" * (30 - filled)
            amount = f"{done / self._per:.0f}/{total / self._per:.0f} {self._unit}"
            print(f"\r{self._label} {bar} {amount}", end="", file=sys.stderr)  # noqa: T201


def say(line: str) -> None:
    """One line for the person, on stderr."""
    print(printable(line), file=sys.stderr, flush=True)  # noqa: T201


def tell(text: str, *, at_once: bool = False) -> None:
    """What a command was asked for, on stdout; it may hold what a robot, a vehicle or a file says."""
    print(printable_lines(text), flush=at_once)  # noqa: T201


@contextmanager
def refusals_in(as_json: bool) -> Iterator[None]:
    """A refusal in the block is also printed as JSON, if that is what is printed."""
    try:
        yield
    except AnswerIsNo as no:
        if as_json:
            print_json({"outcome": "refused", "reason": no.reason, "message": str(no)})
        raise


def print_json(document: dict[str, Any]) -> None:
    print(json.dumps(document), flush=True)  # noqa: T201
