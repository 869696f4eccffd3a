"""Kernels at two speeds from one source: as written for small work, compiled by numba for large."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any


@cache
def compiled(kernel: Callable[..., Any], *helpers: Callable[..., Any]) -> Callable[..., Any]:
    """The kernel as machine code, kept on disk between runs; the kernel itself where numba is absent.

    `helpers` are the functions it calls, of the kernel's own file: what is kept on disk is known to be of
    an older source by that file alone. A kernel's integers must fit 64 bits, where machine code and Python
    part; each kernel's file says why its own do.
    """
    try:
        from numba import njit
        from numba.extending import register_jitable
    except ModuleNotFoundError:
        return kernel
    for helper in helpers:
        register_jitable(helper)
    return njit(kernel, cache=True)
