"""Kernels at two speeds from one source: as written for small work, compiled by numba for large."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any


@cache
def compiled(kernel: Callable[..., Any], *helpers: Callable[..., Any]) -> Callable[..., Any]:
    """The kernel as machine code, kept on disk between runs; the kernel itself where numba is absent.

    `helpers` are the functions it calls. Kernels are written for integers that numba wraps at 64 bits
    and Python does not; they only wrap where the true value is known to fit.
    """
    try:
        from numba import njit
        from numba.extending import register_jitable
    except ModuleNotFoundError:
        return kernel
    for helper in helpers:
        register_jitable(helper)
    return njit(kernel, cache=True)
