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
    """A stream that writes plain characters where its encoding lacks one; in JSON, their escapes."""

    encoding = "utf-8"
    """Encoding that libraries see: every character can be written."""

    def __init__(self, stream: TextIO, *, as_json: bool) -> None:
        self._stream, self._as_json = stream, as_json

    def write(self, text: str) -> int:
        """Write as the stream does."""
        return self._stream.write(plain(text, self._stream.encoding, as_json=self._as_json))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def plain(text: str, encoding: str, *, as_json: bool) -> str:
    """Return text of characters that an encoding has."""
    if not isinstance(text, str) or _can(text, encoding):
        return text
    replace = _escaped if as_json else _plain_letter
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


def _escaped(letter: str) -> str:
    """Return a character as JSON text escapes it."""
    units = letter.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at : at + 2].hex()}" for at in range(0, len(units), 2))


def have_plain_output(*, as_json: bool) -> None:
    """Make stdout and stderr write plain characters, if their encoding is not UTF-8."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if codecs.lookup(stream.encoding).name != "utf-8":
            setattr(sys, name, PlainOutput(stream, as_json=as_json and name == "stdout"))
