"""Safe file names from third-party text: the only conversion of such text to a name on a disk."""

from __future__ import annotations

import hashlib
import re

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
