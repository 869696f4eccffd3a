"""What `stopgo doctor` has looked at."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Check:
    """What was looked at; `do` says what to do about it, if something is wrong or missing."""

    name: str
    ok: bool
    told: str
    do: str = ""
