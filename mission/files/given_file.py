"""Files that a user names: their bytes and digest, and the rows of those that are tables."""

from __future__ import annotations

import csv
import hashlib
import io
from pathlib import Path

from stopgo.mission.console.whole_file import must_end, whole_file
from stopgo.mission.errors import InputError


def bytes_of(path: Path, remedy: str, *, most: int | None = None) -> bytes:
    """Return a file's bytes, at most so many.

    Raises
    ------
    InputError
        Naming the file, why it cannot be read, and the remedy.
    """
    try:
        if most is not None and path.stat().st_size > most:
            raise InputError(f"{path}: is larger than {most // 1_000_000} MB, too large for a mission")
        return whole_file(path)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{path}: cannot be read ({why}); {remedy}") from None


def file_digest(*paths: Path) -> str:
    """Return the sha256 of the files' bytes, one after another, hexadecimal.

    Raises
    ------
    InputError
        If one is a pipe or a device.
    """
    digest = hashlib.sha256()
    for path in paths:
        must_end(path)
        with path.open("rb") as file:
            while chunk := file.read(1 << 20):
                digest.update(chunk)
    return digest.hexdigest()


def separator_of(text: str) -> str:
    """Return the character between cells: of comma, semicolon and tab the most frequent in the first line."""
    head = text.lstrip().partition("\n")[0]
    return max(",;\t", key=head.count)


def rows_of(text: str, source: str, *, strict: bool = False) -> list[tuple[int, list[str]]]:
    """Return the rows of a table that are not empty, each with the line it ends on.

    `strict` refuses damaged quotes.

    Raises
    ------
    InputError
        When it is no table.
    """
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator_of(text), strict=strict)
    try:
        return [(reader.line_num, cells) for cells in reader if any(map(str.strip, cells))]
    except csv.Error as error:
        raise InputError(f"{source}: not a table ({error}); save it as CSV") from None
