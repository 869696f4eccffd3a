"""A disk without room, on any machine: no file of this process may grow beyond a size."""

from __future__ import annotations

import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager

ROOMY = resource.RLIM_INFINITY


@contextmanager
def small_disk(size: int = ROOMY) -> Iterator[Callable[[int], None]]:
    """In the block, writing beyond byte `size` of any file fails as on a full disk; gives what changes it."""
    before, most = resource.getrlimit(resource.RLIMIT_FSIZE)

    def full_at(size: int) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, most))

    full_at(size)
    try:
        yield full_at
    finally:
        full_at(before)
