"""What a command says to the person: lines and a progress bar on stderr, one JSON object on stdout."""

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
"""Called with what is done and what there is to do, as a bar's `show`."""

KILOBYTES = ("kB", 1000)


class Bar:
    """A progress bar on stderr, if that is a terminal."""

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
        """Show how much is done, in the unit's parts."""
        if self._drawn is not None:
            amount = f"{done / self._per:.0f}/{total / self._per:.0f} {self._unit}"
            (task,) = self._drawn.task_ids
            self._drawn.update(task, completed=done, total=total, description=amount)


def say(line: str) -> None:
    """One line for the person, on stderr; in one piece, for several threads may say something."""
    print(f"{printable(line)}\n", end="", file=sys.stderr, flush=True)  # noqa: T201


def tell(line: str, *, at_once: bool = False) -> None:
    """A line of what a command was asked for, on stdout; it may hold what a robot or a file says."""
    print(printable(line), flush=at_once)  # noqa: T201


def tell_lines(text: str) -> None:
    """Several such lines: a table or a document, whose cells can hold no line breaks of their own."""
    print(printable_lines(text))  # noqa: T201


@contextmanager
def refusals_in(as_json: bool) -> Iterator[None]:
    """A refusal in the block is also printed as JSON, if that is what is printed."""
    try:
        yield
    except NegativeResult as no:
        if as_json:
            print_json({"outcome": "refused", "reason": no.reason, "message": str(no)})
        raise


@contextmanager
def carried_out(what: str) -> Iterator[None]:
    """Tells of what a robot has done; where that cannot be told, nobody may believe that nothing was sent.

    Raises
    ------
    OutcomeUnknown
        If the output takes no more.
    """
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutcomeUnknown(f"{what}, and could not be told: output: {error.strerror}") from None


def print_json(document: dict[str, Any]) -> None:
    print(json.dumps(document), flush=True)  # noqa: T201
