"""Plain text tables for the terminal: words to the left, numbers to the right."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from io import StringIO

ENDLESS = 100_000
"""Width of an output that is no terminal: nothing is folded there."""


def table(header: Sequence[str], rows: Sequence[Sequence[str]], *, width: int | None = None) -> str:
    """Return the lines of a table; a column of numbers only is aligned right.

    Cells are folded if the table is wider than `width`: the terminal's width, if stdout is one.
    """
    from rich.console import Console
    from rich.rule import Rule
    from rich.table import Table
    from rich.text import Text

    grid = Table.grid(padding=(0, 2, 0, 0), pad_edge=False)
    for cells in zip(*rows, strict=True) if rows else [()] * len(header):
        grid.add_column(justify="right" if cells and all(map(_is_number, cells)) else "left", overflow="fold")
    grid.add_row(*map(Text, header))
    grid.add_row(*(Rule(characters="-", style="none") for _ in header))
    for row in rows:
        grid.add_row(*(Text(printable(cell)) for cell in row))
    page = Console(file=StringIO(), width=width or _columns(), color_system=None, legacy_windows=False)
    with page.capture() as drawn:
        page.print(grid)
    return "\n".join(line.rstrip() for line in drawn.get().rstrip("\n").split("\n"))


def _columns() -> int:
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else ENDLESS


def printable(content: str) -> str:
    """Return text of a file without characters that move the cursor or colour the terminal."""
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in content)


def printable_lines(content: str) -> str:
    """Return text of several lines, each of them `printable`."""
    return "\n".join(map(printable, content.split("\n")))


def shortened(word: str, longest: int = 400) -> str:
    """Return a word of an error message; of a very long one, its beginning and its length."""
    return word if len(word) <= longest else f"{word[:80]}… ({len(word)} characters)"


def counted(count: int, noun: str, plural: str = "") -> str:
    """Return a count with its noun: `1 gap`, `0 gaps`; a plural that is not noun + s is given."""
    return f"{count} {noun if count == 1 else plural or f'{noun}s'}"


def duration(seconds: float) -> str:
    """Return seconds as text: `0:42`, `12:05`, `1:02:03`."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def _is_number(cell: str) -> bool:
    return cell.strip("-") == "" or cell.translate(_NUMBER).isdigit()


_NUMBER = str.maketrans("", "", ".:+-% ")
