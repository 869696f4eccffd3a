"""Output of a command: messages and a progress bar on stderr, its report or one JSON object on stdout."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from stopgo.mission.console.table import printable, printable_lines
from stopgo.mission.errors import NegativeResult, OutcomeUnknown

if TYPE_CHECKING:
    import rich.progress

Progress = Callable[[int, int], None]
"""Callback with the amount done and the total amount, such as `Bar.show`."""

KILOBYTES = ("kB", 1000)
"""Unit of a progress bar: its name, and the amount that it stands for."""


class Bar:
    """Progress bar on stderr, if stderr is a terminal."""

    def __init__(self, label: str, unit: tuple[str, int] = KILOBYTES) -> None:
        self._label = label
        self._unit, self._per = unit
        self._drawn: rich.progress.Progress | None = None

    def __enter__(self) -> Bar:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
            from rich.progress import Progress as Drawn

            columns = TextColumn(self._label), BarColumn(30), TextColumn("{task.description}")
            self._drawn = Drawn(*columns, TimeRemainingColumn(), console=Console(stderr=True))
            self._drawn.add_task("", total=None)
            self._drawn.start()
        return self

    def __exit__(self, *exception: object) -> None:
        if self._drawn is not None:
            self._drawn.stop()

    def show(self, done: int, total: int) -> None:
        """Draw the amount done and the total amount, in the bar's unit."""
        if self._drawn is not None:
            amount = f"{done / self._per:.0f}/{total / self._per:.0f} {self._unit}"
            (task,) = self._drawn.task_ids
            self._drawn.update(task, completed=done, total=total, description=amount)


def say(line: str) -> None:
    """Print one line on stderr, in a single write because several threads may print."""
    print(f"{printable(line)}\n", end="", file=sys.stderr, flush=True)  # noqa: T201


def print_line(line: str, *, flush: bool = False) -> None:
    """Print one line of a command's report on stdout; text from a robot or a file is made harmless."""
    print(printable(line), flush=flush)  # noqa: T201


def print_text(text: str) -> None:
    """Print a table or a document on stdout; its cells must not hold line breaks."""
    print(printable_lines(text))  # noqa: T201


@contextmanager
def refusals_printed(*, as_json: bool) -> Iterator[None]:
    """Print a refusal that is raised in the block as JSON too, if the command prints JSON."""
    try:
        yield
    except NegativeResult as no:
        if as_json:
            print_json({"outcome": "refused", "reason": no.reason, "message": str(no)})
        raise


@contextmanager
def reporting_done(what: str) -> Iterator[None]:
    """Print a report of what a robot has done; a failed output must not look as if nothing was sent.

    Raises
    ------
    OutcomeUnknown
        If the report cannot be written, as on a full disk.
    """
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutcomeUnknown(f"{what}, but the report could not be printed: {error.strerror}") from None


def print_json(document: dict[str, Any]) -> None:
    """Print a document as one line of JSON on stdout."""
    print(json.dumps(document), flush=True)  # noqa: T201
