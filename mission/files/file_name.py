"""What others named, as a part of a file's name: the one way from text of theirs to a name on a disk."""

from __future__ import annotations

import hashlib
import re

LONGEST = 100
_OTHER = re.compile(r"[^A-Za-z0-9_.-]+")


def file_name(text: str) -> str:
    """`text` with nothing but letters, digits, `_`, `.` and `-`, never empty, hidden, a path or too long.

    What has to be changed gets a piece of its hash, so that two texts never give the same name.
    """
    plain = _OTHER.sub("_", text).lstrip(".-")[:LONGEST]
    if plain == text and plain:
        return plain
    return f"{plain or 'unnamed'}~{hashlib.sha256(text.encode(errors='surrogatepass')).hexdigest()[:8]}"
