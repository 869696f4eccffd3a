"""Short and long form of the tests: what the short one leaves out, STOPGO_FAULTS=full runs too.

Tests that sweep many cases run some of them. The tests of `long_form.txt` do not run: they take long, and
other tests run the same code.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

FULL = os.environ.get("STOPGO_FAULTS") == "full"
LONG_FORM = Path(__file__).parents[1] / "long_form.txt"
"""Tests of the long form, one in a line: functions, and single cases of functions."""
_LONG = frozenset(LONG_FORM.read_text(encoding="utf-8").splitlines())


def size(*, short: int, full: int) -> int:
    """Number of trials."""
    return full if FULL else short


def some(cases: Sequence[T], *, every: int) -> list[T]:
    """Every so many of the cases; all of them in the full form."""
    return list(cases if FULL else cases[::every])


def is_long(nodeid: str) -> bool:
    """Return True if a test, by pytest's name of it, is in the long form alone."""
    case = nodeid.removeprefix("tests/")
    return case in _LONG or case.partition("[")[0] in _LONG
