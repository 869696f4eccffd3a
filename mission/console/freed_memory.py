"""Memory that the stages of a plan have freed: when it is looked for, and given back to the system."""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager

LARGE = 400_000
"""Kilobytes that a process has taken at most; below, what it could give back is not worth the time."""

OBJECTS = 250_000
"""New objects after which Python looks for some that only refer to each other; modules alone are 150 000."""


@contextmanager
def looking_seldom() -> Iterator[None]:
    """Look for such objects seldom in the block: a plan makes many, and nearly all are freed without it.

    It is 4 % of the processor time of a small plan.
    """
    before = gc.get_threshold()
    look_seldom()
    try:
        yield
    finally:
        gc.set_threshold(*before)


def look_seldom() -> None:
    """Look for such objects seldom until this process ends."""
    gc.set_threshold(OBJECTS, 10, 1)


def give_back() -> None:
    """Give freed memory back, of a large process on Linux.

    Its C library keeps what many small objects leave, between others, and takes more for large arrays.
    """
    if sys.platform != "linux":
        return
    import resource

    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # not every C library has it
    if trim is not None and resource.getrusage(resource.RUSAGE_SELF).ru_maxrss > LARGE:
        trim(0)
