"""The options of `stopgo plan` and `stopgo floors`: one for each parameter of `stopgo.mission.settings`."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Iterable
from typing import Annotated, Any, cast

import typer

from stopgo.mission.settings import PARAMETERS
from stopgo.mission.settings.parameter import Parameter

KEY = re.compile(r"[a-z]+(_[a-z]+)+")
"""Name of a parameter as plan.toml has it; on the command line it is an option."""


def with_options(command: Callable[..., int], names: Iterable[str] = PARAMETERS) -> Callable[..., int]:
    """The command with an option for each parameter in place of its `**given`, after its positional ones.

    With all parameters, those that people use first have a heading of their own in the help.
    """
    *own, _ = inspect.signature(command, eval_str=True).parameters.values()
    first, last = [[p for p in own if (p.kind == p.KEYWORD_ONLY) is late] for late in (False, True)]
    made: Any = functools.wraps(command)(functools.partial(command))
    own_names = [name for name in names if _own(PARAMETERS[name])]
    options = [_option(PARAMETERS[name], whole=names is PARAMETERS) for name in own_names]
    made.__signature__ = inspect.Signature([*first, *options, *last])
    return cast(Callable[..., int], made)


def values_of(options: dict[str, Any]) -> dict[str, Any]:
    """The values of the options that were given, by the parameters' names."""
    values: dict[str, Any] = {}
    for name, parameter in PARAMETERS.items():
        if not _own(parameter) or _key(parameter) not in options:
            continue
        given = options[_key(parameter)]
        if parameter.further and given:
            given, *rest = given
            values[parameter.further] = tuple(map(parameter.given, rest)) or None
        values[name] = parameter.given(given or None if parameter.further else given)
    return values


def _own(parameter: Parameter) -> bool:
    """True if the parameter has its own option, and does not take the further values of another."""
    return parameter.name not in {item.further for item in PARAMETERS.values()}


def _key(parameter: Parameter) -> str:
    return parameter.option or parameter.key


def _option(parameter: Parameter, *, whole: bool) -> inspect.Parameter:
    kind = list[str] if parameter.repeatable or parameter.further else _plain(parameter)
    name = parameter.flag
    declared = typer.Option(
        *([f"{name}/--no-{name[2:]}"] if parameter.default is None and kind is bool else [name]),
        metavar=parameter.form.upper() or _words(parameter) or None,
        help=f"{_help(parameter)}  [default: {_default(parameter)}]",
        show_default=False,
        rich_help_panel=parameter.panel if whole else parameter.group,
    )
    return inspect.Parameter(
        _key(parameter),
        inspect.Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[kind | None, declared],
    )


LONGEST_WORDS = 40
"""Of the words of an option, in its left column of the help; longer ones stand in its text."""


def _words(parameter: Parameter) -> str:
    words = "|".join(parameter.choices)
    return words if len(words) <= LONGEST_WORDS else "NAME"


def _plain(parameter: Parameter) -> type:
    """Type on the command line; a parameter with its own form reads a text."""
    return str if parameter.form else parameter.plain


def _help(parameter: Parameter) -> str:
    unit = f", {parameter.unit}" if parameter.unit else ""
    named = f": {', '.join(parameter.choices)}" if _words(parameter) == "NAME" else ""
    return f"{parameter.help}{unit}{'; repeatable' * parameter.repeatable}{named}."


def _default(parameter: Parameter) -> str:
    value = parameter.default
    if value in (None, ()):
        return KEY.sub(lambda key: "--" + key[0].replace("_", "-"), parameter.undecided)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)
