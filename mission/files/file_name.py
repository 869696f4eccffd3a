"""File names: safe ones from third-party text, and names on a disk that are no text."""

from __future__ import annotations

import hashlib
import re

NOT_TEXT = "is not UTF-8 text; rename the file or folder"
"""Problem of a name whose bytes are no text: no message and no result can show it."""
UNREADABLE = "\N{REPLACEMENT CHARACTER}"
"""Letter for a byte that is no text."""
LONGEST = 100
_OTHER = re.compile(r"[^A-Za-z0-9_.-]+")


def file_name(text: str) -> str:
    """Return `text` with only letters, digits, `_`, `.` and `-`, never empty, hidden, a path or too long.

    A changed text gets a part of its hash, so that two texts never give the same name.
    """
    plain = _OTHER.sub("_", text).lstrip(".-")[:LONGEST]
    if plain == text and plain:
        return plain
    return f"{plain or 'unnamed'}~{hashlib.sha256(text.encode(errors='surrogatepass')).hexdigest()[:8]}"


def is_text(name: str) -> bool:
    """Return True if a name on a disk is text; each byte that is none is half a surrogate pair in Python."""
    return not any("\ud800" <= letter <= "\udfff" for letter in name)


def legible_name(name: str) -> str:
    """Return a name on a disk with `UNREADABLE` for what is no text; no file has it then."""
    return "".join(letter if is_text(letter) else UNREADABLE for letter in name)
