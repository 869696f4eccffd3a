"""Conversion of an option's words to its value, without the library that typer converts with.

Typer builds a pydantic adapter for every parameter of a command. Loading pydantic takes a third of the time
in which `pause` or `status` starts. Words and numbers in their usual form are converted here, to the same
values. Whatever else is given goes to typer, which converts it or says what is wrong with it.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any, get_args, get_origin

WHOLE = re.compile(r"-?(0|[1-9][0-9]{0,8})")
DECIMAL = re.compile(WHOLE.pattern + r"(\.[0-9]{1,9})?")
DEFAULTS = {
    **{"parser": None, "exists": False, "file_okay": True, "dir_okay": True, "writable": False},
    **{"readable": True, "resolve_path": False, "allow_dash": False, "path_type": None, "clamp": False},
}
"""Settings of a parameter that is converted here; with any other, typer converts."""
NOT_PLAIN = object()


class PlainValue:
    """Conversion of one parameter; it stands where typer keeps the adapter that it builds."""

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """Return the value of the words; raises what typer raises."""
        several = param.multiple or param.nargs == -1
        if value is None:
            return () if several else None
        descriptor = param.type_descriptor
        info = descriptor.parameter_info
        if all(getattr(info, name, default) == default for name, default in DEFAULTS.items()):
            kind = descriptor.annotation
            found = _each(value, kind, info) if several else _converted(value, kind, info)
            if found is not NOT_PLAIN:
                return found
        param._runtime_param = None  # typer builds its own
        try:
            return param.get_runtime_param().coerce(value, param=param, ctx=ctx)
        finally:
            param._runtime_param = self


def converted_plainly(params: list[Any]) -> list[Any]:
    """Return the parameters of a command, which are converted here from now on."""
    for param in params:
        if getattr(param, "_runtime_param", NOT_PLAIN) is None:
            param._runtime_param = PlainValue()
    return params


def _each(values: Any, annotation: Any, info: Any) -> Any:
    if get_origin(annotation) is not list or not isinstance(values, list | tuple):
        return NOT_PLAIN
    (kind,) = get_args(annotation)
    found = [_converted(value, kind, info) for value in values]
    return NOT_PLAIN if any(value is NOT_PLAIN for value in found) else found


def _converted(value: Any, kind: Any, info: Any) -> Any:
    """Return the value of one word or default; NOT_PLAIN if it is for typer to convert."""
    if kind is str:
        return value if type(value) is str else NOT_PLAIN
    if kind is Path:
        return _path(value)
    if kind not in (int, float):
        return NOT_PLAIN
    if kind is float and type(value) is int:  # a default
        value = float(value)
    elif type(value) is not kind:
        if type(value) is not str or not (WHOLE if kind is int else DECIMAL).fullmatch(value):
            return NOT_PLAIN
        value = kind(value)
    too_small = info.min is not None and not value >= info.min
    too_large = info.max is not None and not value <= info.max
    return NOT_PLAIN if too_small or too_large else value


def _path(value: Any) -> Any:
    if not isinstance(value, str | Path):
        return NOT_PLAIN
    try:
        there = os.access(value, os.F_OK)
    except ValueError:  # a name with a null character
        return NOT_PLAIN
    return NOT_PLAIN if there and not os.access(value, os.R_OK) else Path(value)
