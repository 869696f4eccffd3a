"""Kernels at two speeds from one source: as written for small work, compiled by numba for large."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pickle import UnpicklingError
from typing import Any


@cache
def compiled(kernel: Callable[..., Any], *helpers: Callable[..., Any]) -> Callable[..., Any]:
    """The kernel as machine code, kept on disk between runs; the kernel itself where numba does not load.

    `helpers` are the functions it calls, of the kernel's own file: what is kept on disk is known to be of
    an older source by that file alone. A kernel's integers must fit 64 bits, where machine code and Python
    part; each kernel's file says why its own do.
    """
    try:
        from numba import njit
        from numba.extending import register_jitable
    except ImportError:
        return kernel
    for helper in helpers:
        register_jitable(helper)
    try:
        return anew_if_not_kept(njit(kernel, cache=True), njit(kernel))
    except RuntimeError:  # a read-only install and a user without a home: there is no place to keep it
        return njit(kernel)


def anew_if_not_kept(kept: Callable[..., Any], anew: Callable[..., Any]) -> Callable[..., Any]:
    """The kernel that is kept on disk; where that is full, or what is kept is damaged, one compiled anew."""

    def call(*arguments: Any) -> Any:
        try:
            return kept(*arguments)
        except (OSError, EOFError, UnpicklingError):  # before the first line ran: kernels open no files
            return anew(*arguments)

    return call
