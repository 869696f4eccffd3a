"""Keeps what was worked out of a noun with that noun, for as long as the noun itself is kept."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar

Noun = TypeVar("Noun")
T = TypeVar("T")


def kept(work_out: Callable[[Noun], T]) -> Callable[[Noun], T]:
    """The function, whose result for a noun is worked out once.

    As `functools.cached_property` does, for what `mission` may not know of: the result lies beside the
    noun's own values, so that it goes with the noun, and a noun with other values has another.
    """
    name = f"_kept_{work_out.__module__}.{work_out.__qualname__}"

    @functools.wraps(work_out)
    def result(noun: Noun) -> T:
        values: dict[str, Any] = vars(noun)
        if name not in values:
            values[name] = work_out(noun)
        found: T = values[name]
        return found

    return result
