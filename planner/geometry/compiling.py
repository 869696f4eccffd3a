"""Kernels at two speeds from one source: as written, or compiled when stopgo was installed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

from stopgo.mission.console.notice import notice

LAST = "_compiled"
"""Ending of the module that the build makes of a kernel's module."""


def compiled(kernel: Callable[..., Any], *, large: bool) -> Callable[..., Any] | None:
    """Return the kernel as machine code, with the same results; None where none was built.

    Without it a line is printed before `large` work, once. Compiled kernels take contiguous arrays of
    64-bit numbers where interpreted ones also take lists. A kernel's integers must fit 64 bits, beyond
    which machine code and Python differ; each kernel's file states why they do.
    """
    module = compiled_module(kernel.__module__)
    if module is None and large:
        _say_that_plans_take_longer()
    return getattr(module, kernel.__name__, None)


@cache
def compiled_module(name: str) -> Any:
    """The module that the build made of the kernel's module `name`; None where it made none."""
    try:
        return import_module(name + LAST)
    except ImportError:  # built without a compiler, or for another Python or processor
        return None


@cache
def _say_that_plans_take_longer() -> None:
    notice(
        "the planner's kernels are not compiled, so large floors take longer; "
        "with a C compiler (such as gcc) installed, install stopgo again from its source"
    )
