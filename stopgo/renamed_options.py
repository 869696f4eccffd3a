"""Options that had another name in 0.1, or no effect: accepted until 0.3, each with one line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from stopgo.mission.errors import InputError


@dataclass(frozen=True)
class NewName:
    """Today's name of an option."""

    option: str
    unit: str = ""
    """Unit of the old option's values, where today's values have another by default."""


@dataclass(frozen=True)
class Dropped:
    """An option that never had an effect on its command."""

    takes_value: bool


@dataclass(frozen=True)
class Unavailable:
    """An option that its command could never carry out."""

    remedy: str


_OF_PLANS = {
    "--use": NewName("--require-stop"),
    "--d-sec": NewName("--clearance"),
    "--edge": NewName("--edge-clearance"),
    "--door-access": NewName("--min-door-width"),
    "--near": NewName("--min-range"),
    "--views": NewName("--min-views"),
    "--battery": NewName("--battery-life"),
}
_OF_FLOORS = {"--scan-height": NewName("--cut-height")}
_OF_VEHICLES = {"--any-origin": NewName("--skip-origin-check")}
_OF_ITEMS = {"--settle": NewName("--settle-item")}
_OF_COVERAGE = {"--coverage": NewName("--coverage-file")}
_WITHOUT_LEASE = {"--take-over": Dropped(takes_value=False), "--stop": Dropped(takes_value=True)}
_WITHOUT_STOP = {"--stop": Dropped(takes_value=True)}

_HOME: dict[str, NewName | Dropped | Unavailable] = {
    **_WITHOUT_STOP,
    "--mavlink": Unavailable(
        "an autopilot drives its mission forward only; end the run with stopgo abort --mavlink, or drive the "
        "vehicle by stopgo robot --controller mavlink:URL, which can drive home"
    ),
}

RENAMED: Mapping[str, Mapping[str, NewName | Dropped | Unavailable]] = {
    "plan": {**_OF_PLANS, **_OF_FLOORS},
    "floors": {**_OF_FLOORS, "--svg": NewName("--picture")},
    "convert": _OF_FLOORS,
    "check": _OF_COVERAGE,
    "export": {**_OF_COVERAGE, **_OF_ITEMS},
    "prove": {
        **_OF_COVERAGE,
        "--step": NewName("--angular-step"),
        "--height": NewName("--scanner-height"),
    },
    "push": {**_OF_VEHICLES, **_OF_ITEMS},
    "doctor": _OF_VEHICLES,
    "start": _OF_VEHICLES,
    "pause": _WITHOUT_LEASE,
    "abort": _WITHOUT_LEASE,
    "resume": {**_OF_VEHICLES, **_WITHOUT_STOP},
    "home": _HOME,
    "skip": _OF_VEHICLES,
    "retry": _OF_VEHICLES,
    "robot": {"--endurance": NewName("--battery-life", unit="h")},
    "simulate": {"--profile": NewName("--autopilot")},
    "runs": {"--web": Unavailable("the pages are part of stopgo site DIR")},
    "tunnel": {"--raw-orders": NewName("--allow-commands")},
}
"""Old options by command."""


def with_new_names(arguments: list[str]) -> tuple[list[str], list[str]]:
    """The arguments of a command with today's option names, and a line for each old one.

    Everything after `--` is left as it is.

    Raises
    ------
    InputError
        For an option that its command could never carry out.
    """
    renamed = next((RENAMED[word] for word in arguments[:1] if word in RENAMED), {})
    end = arguments.index("--") if "--" in arguments else len(arguments)
    words: list[str] = []
    lines: list[str] = []
    rest = iter(arguments[:end])
    for argument in rest:
        option, sign, value = argument.partition("=")
        new = renamed.get(option)
        if new is None:
            words.append(argument)
        elif isinstance(new, Unavailable):
            raise InputError(f"{option} has no meaning with {arguments[0]}: {new.remedy}")
        elif isinstance(new, Dropped):
            lines.append(f"{option} has no effect on {arguments[0]}; it ends with 0.3")
            if new.takes_value and not sign:
                next(rest, None)
        else:
            lines.append(f"{option} is now called {new.option}; the old name ends with 0.3")
            given = value if sign or not new.unit else next(rest, None)
            words.append(f"{new.option}={given}{new.unit}" if sign or given else new.option)
    return [*words, *arguments[end:]], list(dict.fromkeys(lines))
