"""Methods of dataclasses, compiled when they are called: few of them ever are.

A dataclass has five methods on average, and Python compiles a text for each when the class is made. With the
180 classes of a plan, that was a tenth of a small plan's time. From Python 3.13 on, all methods of a class
are compiled at once, and nothing is changed there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

LATE = frozenset({"__init__", "__repr__", "__eq__", "__hash__", "__setattr__", "__delattr__"})
"""All but comparisons by order, which none of ours has."""
NAME = "_create_fn"
"""Python's function that compiles a method of a dataclass, up to 3.12."""


def compile_when_called() -> None:
    """Let methods of dataclasses that are made from now on be compiled at their first call."""
    compile_now: Callable[..., Callable[..., Any]] | None = getattr(dataclasses, NAME, None)
    if compile_now is None or compile_now.__module__ == __name__:
        return

    def create(name: str, *parts: Any, **options: Any) -> Callable[..., Any]:
        if name in LATE:
            return _late(name, lambda: compile_now(name, *parts, **options))
        return compile_now(name, *parts, **options)

    setattr(dataclasses, NAME, create)


def _late(name: str, compiled: Callable[[], Callable[..., Any]]) -> Callable[..., Any]:
    """A method that is compiled by its first call, and then takes this one's place in the class."""
    known: list[Callable[..., Any]] = []

    def call(own: Any, *given: Any, **named: Any) -> Any:
        if not known:
            known.append(compiled())
            known[0].__qualname__ = call.__qualname__
        for kind in type(own).__mro__:
            if vars(kind).get(name) is call:
                setattr(kind, name, known[0])
        return known[0](own, *given, **named)

    call.__name__ = name
    return call
