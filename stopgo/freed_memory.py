"""Memory that the stages of a large plan have freed, given back to the system."""

from __future__ import annotations

import ctypes
import sys

LARGE = 400_000
"""Kilobytes that a process has taken at most; below, what it could give back is not worth the time."""


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
