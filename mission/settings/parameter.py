"""A parameter of a plan, declared once: its meaning, its limits, and its form for people."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from stopgo.mission.errors import InputError

FIRST = "Used first"
"""The group of the options that people use first, whatever they concern."""
GROUPS = ("Floor", "Scanner", "Robot", "Quality", "Route", "Fleet", "Output", "Paper")
"""The other groups of options, in the order of the help: the parameters of the paper come last."""

Pair = tuple[float, float]

LARGEST = 1e6
HIGHEST_M = 10_000.0
"""Metres above or below the sea beyond which no site lies."""
FARTHEST = 1e9
"""Coordinates of a site may be this large, in metres."""


def numbers(text: str) -> tuple[float, ...]:
    """The numbers in `1,2.5,-3`."""
    return tuple(map(float, text.split(",")))


def words(text: str) -> tuple[str, ...]:
    """The words in `walls,columns`."""
    return tuple(part.strip() for part in text.split(","))


def seconds(text: str) -> float:
    """Seconds in `1800`, `90s`, `30min` or `1h30min`."""
    found = _DURATION.fullmatch(text.replace(" ", ""))
    if found is None or not found[0]:
        return float(text)
    return sum(float(part) * size for part, size in zip(found.groups(), (3600, 60, 1), strict=True) if part)


def millimetres(text: str) -> float:
    """Millimetres in `5`, `5mm`, `0.5cm` or `0.005m`."""
    unit = next((unit for unit in ("mm", "cm", "m") if text.strip().endswith(unit)), "")
    return float(text.strip().removesuffix(unit)) * {"": 1.0, "mm": 1.0, "cm": 10.0, "m": 1000.0}[unit]


_NUMBER = r"(\d+(?:\.\d+)?)"
_DURATION = re.compile(f"(?:{_NUMBER}h)?(?:{_NUMBER}min)?(?:{_NUMBER}s)?")


@dataclass(frozen=True)
class Parameter:
    """The declaration of a parameter; name, type and default come from the field that it annotates."""

    section: str
    """The table of plan.toml it stands in."""
    help: str
    unit: str = ""
    group: str = ""
    """The heading above its option in the help, one of GROUPS."""
    first: bool = False
    """True if people use it first: the help then shows it before the groups."""
    above: float | None = None
    least: float | None = None
    below: float | None = None
    most: float | None = None
    farthest: float = FARTHEST
    """Limit of several numbers, to either side."""
    why: str = ""
    """The reason for the limits, or an example."""
    undecided: str = "none"
    """Value that is taken if none is given."""
    form: str = ""
    """Form of a value of more than one number or word …"""
    example: str = ""
    read: Callable[[str], Any] = numbers
    """… and its reader."""
    known: tuple[str, ...] = ()
    """Words that such a value may have."""
    further: str = ""
    """The parameter that holds the option's values from the second on; its own option is this one."""
    word: str = ""
    """The name that people use in options and plan.toml, where missions keep an older one."""
    option: str = ""
    """The option's name, where it is another. Such an option, as every list of lists, may be repeated."""
    quiet: bool = False
    """True if missions leave it out at its default: they stay what they were before it came."""
    name: str = ""
    type: Any = None
    default: Any = None

    def left_out(self, value: Any) -> bool:
        """True if missions leave this value out."""
        return self.quiet and bool(value == self.default)

    @property
    def key(self) -> str:
        """Its key in plan.toml."""
        return self.word or self.name

    @property
    def panel(self) -> str:
        """The heading above its option in the help."""
        return FIRST if self.first else self.group

    @property
    def flag(self) -> str:
        """Its option on the command line."""
        return "--" + (self.option or self.key).replace("_", "-")

    def shown(self, value: object) -> str:
        """The option with a value, as a person gives it: `--robots 2`."""
        if value is True:
            return self.flag
        if isinstance(value, tuple):
            value = ",".join(f"{item:g}" if isinstance(item, float) else str(item) for item in value)
        return f"{self.flag} {value:g}" if isinstance(value, float) else f"{self.flag} {value}"

    @property
    def meaning(self) -> str:
        """Its purpose, with its unit or its words."""
        unit = f", {self.unit}" if self.unit else ""
        return f"{self.help}{unit}{': ' if self.choices else ''}{', '.join(self.choices)}"

    @property
    def choices(self) -> tuple[str, ...]:
        """Its words, where they are fixed."""
        parts = (self.type, *get_args(self.type))
        return tuple(word for part in parts if get_origin(part) is Literal for word in get_args(part))

    @property
    def repeatable(self) -> bool:
        """True if the option may be given several times."""
        return self.default == ()

    @property
    def plain(self) -> type:
        """The type of the option's value: bool, int, float or str."""
        return next((kind for kind in (bool, int, float) if kind in (self.type, *get_args(self.type))), str)

    @property
    def right(self) -> str:
        """Its form, if it is more than one number or word, or else its words."""
        if self.form:
            each = " for each" if self.repeatable else ""
            known = f"; known: {', '.join(self.known)}" if self.known else ""
            return f"write {self.form}{each}, such as {self.example}{known}"
        return f"known: {', '.join(self.choices)}" if self.choices else ""

    def given(self, text: Any) -> Any:
        """The value of what was given as the option.

        Raises
        ------
        InputError
            Naming the parameter, the text and how it is written.
        """
        if text is None or not self.form:
            return text
        return (tuple(map(self._read, text)) or None) if self.repeatable else self._read(text)

    def as_option(self, value: Any) -> Any:
        """A value with its texts read as on the command line; what is no text, or a file, stays as it is."""
        if not self.form or self.form == "FILE":
            return value
        try:
            if isinstance(value, str):
                return (self.read(value),) if self.repeatable else self.read(value)
            if self.repeatable and isinstance(value, list | tuple):
                return [self.read(item) if isinstance(item, str) else item for item in value]
        except ValueError:  # the types of parameters refuse it, with its form
            pass
        return value

    def _read(self, text: str) -> Any:
        try:
            return self.read(text)
        except ValueError:
            raise InputError(f"{self.flag} {text}: {self.right}") from None

    def check(self, value: Any) -> None:
        """Refuse a value beyond the limits, naming the parameter and the value."""
        limit = self.farthest if isinstance(value, tuple) else LARGEST
        for number in _numbers_in(value):
            if not math.isfinite(number) or abs(number) > limit:
                raise InputError(f"{self.flag} {number}: must be a finite number below {limit:g}")
        if value is not None and not self._within(value):
            raise InputError(f"{self.flag} {value}: {self.limits}")

    def _within(self, value: Any) -> bool:
        return (
            (self.above is None or value > self.above)
            and (self.least is None or value >= self.least)
            and (self.below is None or value < self.below)
            and (self.most is None or value <= self.most)
            and (not self.choices or value in self.choices)
        )

    @property
    def limits(self) -> str:
        """Limits of the value, in words."""
        if self.choices:
            return self.right
        why = f" ({self.why})" if self.why else ""
        if self.least is not None and self.most is not None:
            return f"must be between {self.least:g} and {self.most:g}{why}"
        bounds = {"above": self.above, "at least": self.least, "below": self.below, "at most": self.most}
        both = " and ".join(f"{word} {bound:g}" for word, bound in bounds.items() if bound is not None)
        usual = {"above 0": "must be greater than 0", "at least 0": "must not be negative"}
        return usual.get(both, f"must be {both}") + why


def _numbers_in(value: object) -> list[float]:
    """All numbers in a value, however deep."""
    if isinstance(value, tuple):
        return [number for item in value for number in _numbers_in(item)]
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else []
