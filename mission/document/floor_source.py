"""Source of a floor: the file, and the choices made in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any


@dataclass(frozen=True, eq=False)
class FloorSource:
    """A file, and the floor in it: two storeys or two dates of one model are two floors.

    A value of None was not chosen, because the file has only one floor or does not contain it.
    """

    file: str
    """The file's name, without its folder."""
    digest: str
    """sha256 of the file's bytes, hexadecimal."""
    storey: str | None = None
    """The storey of a model, by name."""
    date: str | None = None
    """The day whose construction status is shown, as YYYY-MM-DD."""
    since: str | None = None
    """Only elements finished after this day are targets."""
    drawing: int | None = None
    """Number of the drawing, among several in one model space, from 1."""
    region: tuple[float, float, float, float] | None = None
    """The part of a model space that is read, as x0, y0, x1, y1 in drawing units."""
    units: str | None = None
    """The drawing's unit of length, if the user gives it."""
    options: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    """Other options of the reader that differ from its defaults: names, and values that JSON can hold."""

    @property
    def chosen(self) -> dict[str, Any]:
        """All choices by name, with the reader's options; empty for a plain file of one floor."""
        names = ("storey", "date", "since", "drawing", "region", "units")
        own = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        return {**own, **{name: self.options[name] for name in sorted(self.options)}}

    @property
    def basis(self) -> str | dict[str, Any]:
        """Value that identifies the floor, for a hash: the bare digest if nothing was chosen."""
        return {"digest": self.digest, **self.chosen} if self.chosen else self.digest

    @property
    def title(self) -> str:
        """The choices in words, such as `storey EG, date 2024-05-01`; empty if nothing was chosen."""
        return ", ".join(f"{name} {_in_words(value)}" for name, value in self.chosen.items())


def _in_words(value: object) -> str:
    return ",".join(map(_in_words, value)) if isinstance(value, tuple | list) else str(value)
