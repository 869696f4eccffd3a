"""Kernels at either speed, for tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import stopgo.planner.geometry.compiling
from stopgo.planner.geometry.compiling import compiled_module


def interpret(patch: pytest.MonkeyPatch) -> None:
    """Let every kernel run as it is written, as where stopgo was installed without a compiler."""
    patch.setattr(stopgo.planner.geometry.compiling, "compiled_module", lambda name: None)


def machine_code(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """The compiled form of a function of a kernel's file."""
    module = compiled_module(kernel.__module__)
    assert module is not None, "not compiled: `python setup.py build_ext --inplace`, with gcc and Cython"
    found: Callable[..., Any] = getattr(module, kernel.__name__)
    return found
