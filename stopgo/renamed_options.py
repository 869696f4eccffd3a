"""Options that had another name in 0.1: the old names are accepted until 0.3, each with one line."""

from __future__ import annotations

from collections.abc import Mapping

_OF_PLANS = {
    "--use": "--require-stop",
    "--d-sec": "--clearance",
    "--edge": "--edge-clearance",
    "--door-access": "--min-door-width",
    "--near": "--min-range",
    "--views": "--min-views",
    "--battery": "--battery-life",
}
_OF_FLOORS = {"--scan-height": "--cut-height"}

RENAMED: Mapping[str, Mapping[str, str]] = {
    "plan": {**_OF_PLANS, **_OF_FLOORS},
    "floors": _OF_FLOORS,
    "convert": _OF_FLOORS,
}
"""New names by old ones, by command."""


def with_new_names(arguments: list[str]) -> tuple[list[str], list[str]]:
    """The arguments of a command with today's option names, and a line for each old one.

    Everything after `--` is left as it is.
    """
    renamed = next((RENAMED[word] for word in arguments[:1] if word in RENAMED), {})
    end = arguments.index("--") if "--" in arguments else len(arguments)
    words, lines = [], []
    for argument in arguments[:end]:
        option, sign, value = argument.partition("=")
        new = renamed.get(option)
        if new is not None:
            lines.append(f"{option} is now called {new}; the old name ends with 0.3")
        words.append(argument if new is None else f"{new}{sign}{value}")
    return [*words, *arguments[end:]], list(dict.fromkeys(lines))
