"""Cache of derived values: each lives as long as the instance from which it was computed."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast

Instance = TypeVar("Instance")
T = TypeVar("T")
PREFIX = "_cached_"
"""Begin of the names under which results are stored."""


def instance_cached(compute: Callable[[Instance], T]) -> Callable[[Instance], T]:
    """Decorate a function of one instance, so that it computes its result once per instance.

    It works as `functools.cached_property`, for functions outside the class, which `mission` must not import.
    The result is stored in the instance's `__dict__`; a changed copy of the instance has no result yet.
    """
    name = _name_of(compute)

    @functools.wraps(compute)
    def result(instance: Instance) -> T:
        values: dict[str, Any] = vars(instance)
        if name not in values:
            values[name] = compute(instance)
        found: T = values[name]
        return found

    return result


def store(cached: Callable[[Instance], T], instance: Instance, result: T) -> None:
    """Store the result of an `instance_cached` function, where it is known without computing it."""
    vars(instance)[_name_of(cached)] = result


def taken(cached: Callable[[Instance], T], instance: Instance) -> T:
    """Return the result of an `instance_cached` function, and forget it: it is large, and needed once."""
    result = cached(instance)
    del vars(instance)[_name_of(cached)]
    return result


def forget(cached: Callable[[Instance], T], instance: Instance) -> None:
    """Forget the result of an `instance_cached` function, if there is one."""
    vars(instance).pop(_name_of(cached), None)


def forget_all(instance: object) -> None:
    """Forget the results of all `instance_cached` functions of an instance."""
    for name in [name for name in vars(instance) if name.startswith(PREFIX)]:
        del vars(instance)[name]


def changed_copy(instance: Instance, **changes: Any) -> Instance:
    """A copy of a dataclass instance, with changes on which nothing depends that was derived from it."""
    made = dataclasses.replace(cast(Any, instance), **changes)
    vars(made).update({name: held for name, held in vars(instance).items() if name not in vars(made)})
    return cast(Instance, made)


def _name_of(function: Callable[[Instance], T]) -> str:
    return f"{PREFIX}{function.__module__}.{function.__qualname__}"
