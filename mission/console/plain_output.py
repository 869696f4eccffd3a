"""Output to a terminal or a file that is not UTF-8: plain characters in place of those that it lacks."""

from __future__ import annotations

import codecs
import sys
import unicodedata
from typing import Any, TextIO

PLAIN = {
    "−": "-", "–": "-", "—": "-", "━": "-", "╸": "-", "╺": "-", "·": ".", "•": "*", "×": "x", "±": "+-",
    "≤": "<=", "≥": ">=", "→": "->", "←": "<-", "°": " deg", "π": "pi", "µ": "u", "ß": "ss", "☐": "[ ]",
    "‘": "'", "’": "'", "“": '"', "”": '"', "„": '"',
}  # fmt: skip
"""Plain characters for those that have no decomposition into them."""


class PlainOutput:
    """A stream that writes plain characters where its encoding lacks one; in JSON and TOML, their escapes."""

    encoding = "utf-8"
    """Encoding that libraries see: every character can be written."""

    def __init__(self, stream: TextIO, *, escaped: bool) -> None:
        self._stream, self._escaped = stream, escaped

    def write(self, text: str) -> int:
        """Write as the stream does."""
        encoding = "ascii" if self._escaped else self._stream.encoding  # JSON and TOML are read as UTF-8
        return self._stream.write(plain(text, encoding, escaped=self._escaped))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def plain(text: str, encoding: str, *, escaped: bool) -> str:
    """Return text of characters that an encoding has."""
    if not isinstance(text, str) or _can(text, encoding):
        return text
    replace = _escape if escaped else _plain_letter
    return "".join(letter if _can(letter, encoding) else replace(letter) for letter in text)


def _can(text: str, encoding: str) -> bool:
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return False
    return True


def _plain_letter(letter: str) -> str:
    found = PLAIN.get(letter) or unicodedata.normalize("NFKD", letter)
    return found.encode("ascii", "ignore").decode() or "?"


def _escape(letter: str) -> str:
    """Return a character as JSON and TOML escape it."""
    units = letter.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at : at + 2].hex()}" for at in range(0, len(units), 2))


def have_plain_output(*, escaped: bool) -> None:
    """Make stdout and stderr write plain characters, if their encoding is not UTF-8."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if codecs.lookup(stream.encoding).name != "utf-8":
            setattr(sys, name, PlainOutput(stream, escaped=escaped and name == "stdout"))
