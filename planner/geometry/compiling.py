"""Kernels at two speeds from one source: as written for small work, compiled by numba for large."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pickle import UnpicklingError
from typing import Any


@cache
def compiled(kernel: Callable[..., Any], *helpers: Callable[..., Any]) -> Callable[..., Any]:
    """Return the kernel as machine code, cached on disk; the kernel itself if numba is not available.

    `helpers` are the functions it calls. They must be in the kernel's own file: only that file's date shows
    that the cache is out of date. A kernel's integers must fit 64 bits, beyond which machine code and Python
    differ; each kernel's file states why they do.
    """
    try:
        from numba import njit
        from numba.extending import register_jitable
    except ImportError:
        return kernel
    for helper in helpers:
        register_jitable(helper)
    try:
        return recompiled_if_unreadable(njit(kernel, cache=True), njit(kernel))
    except RuntimeError:  # a read-only install and a user without a home: no folder for the cache
        return njit(kernel)


def recompiled_if_unreadable(cached: Callable[..., Any], uncached: Callable[..., Any]) -> Callable[..., Any]:
    """Return the kernel cached on disk; if the disk is full or the cache damaged, compile it again."""

    def call(*arguments: Any) -> Any:
        try:
            return cached(*arguments)
        except (OSError, EOFError, UnpicklingError):  # before the first line ran: kernels open no files
            return uncached(*arguments)

    return call
