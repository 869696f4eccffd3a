"""Lays out plain text tables for the terminal: words to the left, numbers to the right."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence

_GAP = "  "


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Lines of a table; a column whose every cell reads as a number is set to the right."""
    rows = [[printable(cell) for cell in row] for row in rows]
    columns = list(zip(header, *rows, strict=True))
    widths = [max(map(_width, column)) for column in columns]
    right = [all(map(_is_number, column[1:])) and len(rows) > 0 for column in columns]
    rule = ["-" * width for width in widths]
    return "\n".join(_line(cells, widths, right) for cells in (header, rule, *rows))


def printable(content: str) -> str:
    """Text from a file, with what would move the cursor or colour the terminal replaced."""
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in content)


def printable_lines(content: str) -> str:
    """Text of several lines, each of them `printable`."""
    return "\n".join(map(printable, content.split("\n")))


def duration(seconds: float) -> str:
    """Seconds as a person reads them: `0:42`, `12:05`, `1:02:03`."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def _line(cells: Sequence[str], widths: Sequence[int], right: Sequence[bool]) -> str:
    padded = []
    for cell, width, to_right in zip(cells, widths, right, strict=True):
        space = " " * (width - _width(cell))
        padded.append(space + cell if to_right else cell + space)
    return _GAP.join(padded).rstrip()


def _is_number(cell: str) -> bool:
    return cell.strip("-") == "" or cell.translate(_NUMBER).isdigit()


_NUMBER = str.maketrans("", "", ".:+-% ")


def _width(text: str) -> int:
    """Columns on a terminal: East Asian wide characters take two, combining marks none."""
    wide = sum(unicodedata.east_asian_width(character) in "WF" for character in text)
    return len(text) + wide - sum(unicodedata.combining(character) > 0 for character in text)
