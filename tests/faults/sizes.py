"""Sizes of tests that sweep many cases: a short form by default, all with STOPGO_FAULTS=full."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")

FULL = os.environ.get("STOPGO_FAULTS") == "full"


def size(*, short: int, full: int) -> int:
    """Number of trials."""
    return full if FULL else short


def some(cases: Sequence[T], *, every: int) -> list[T]:
    """Every so many of the cases; all of them in the full form."""
    return list(cases if FULL else cases[::every])
