"""Interface of every floor reader: a file and options in, a floor plan or a survey out."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, Protocol, cast

from stopgo.mission.document.floor_source import FloorSource
from stopgo.mission.floor import FloorPlan
from stopgo.planner.floors.standing_body import StandingBody
from stopgo.planner.floors.survey import Survey


@dataclass(frozen=True, eq=False)
class FloorFile:
    """A file that a floor is read from, with all its bytes."""

    path: Path
    data: bytes = field(repr=False)

    @cached_property
    def digest(self) -> str:
        """sha256 of the bytes, hexadecimal."""
        return hashlib.sha256(self.data).hexdigest()

    def source(self, **chosen: Any) -> FloorSource:
        """This file as the source of a floor, with what was chosen in it."""
        return FloorSource(self.path.name, self.digest, **chosen)


@dataclass(frozen=True, kw_only=True)
class FloorOptions:
    """Options of a reader. None or empty means not given: the reader decides and reports its decision."""

    d_dis: float = 0.05
    """Curves are cut by Eq. 1 for units of this length in metres; every reader takes it."""
    layers: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """Meanings of layers with other names: names in capitals, kinds as in LAYER_ROLES."""
    layer_map: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """The same, from a file that `stopgo floors --write-map` wrote."""
    found_layers: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """The same, as the reader itself found them by the line work; no user gives it."""
    drawing: int | None = None
    """Number of the drawing, of several in one model space, from 1."""
    region: tuple[float, float, float, float] | None = None
    """The part of the model space to read, as x0, y0, x1, y1 in drawing units."""
    units: str | None = None
    """The drawing's unit of length, such as mm."""
    storey: str | None = None
    """Name of the model's storey."""
    level: float | None = None
    """Level of the floor in metres, where the model names no storey there."""
    scan_height: float | None = None
    """Height of the scanner above the floor in metres: a solid cut there occludes and is a target."""
    robot_height: float | None = None
    """Height of the robot in metres: a solid lower than this is an obstacle."""
    date: str | None = None
    """The day whose construction status is read, as YYYY-MM-DD."""
    since: str | None = None
    """Only elements finished after this day, as YYYY-MM-DD, is to be scanned."""
    schedule: Path | None = None
    """CSV of GlobalIds with the start and finish of their tasks."""
    schedule_columns: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """Name of the CSV column for each of guid, task, start, finish."""
    heights: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))
    """Lower and upper height in metres above the floor by kind of element of a drawing."""
    furniture: Literal["obstacle", "ignore"] | None = None
    """Treatment of a model's furniture, fixtures and equipment."""
    in_progress: Literal["obstacle", "target"] | None = None
    """Treatment of elements under construction on the day: obstacle only, or target too."""

    @property
    def given(self) -> tuple[str, ...]:
        """Names of the options that were given, except d_dis."""
        return tuple(item.name for item in fields(self) if item.name != "d_dis" and self._is_given(item.name))

    def _is_given(self, name: str) -> bool:
        value = getattr(self, name)
        return bool(value) if isinstance(value, Mapping) else value is not None


class ReaderModule(Protocol):
    """The module of a reader: two functions of one signature.

    Both raise InputError, one line with the file, the problem and the remedy.
    """

    def survey(self, file: FloorFile, options: FloorOptions) -> Survey:
        """Return the survey of the file."""

    def read(self, file: FloorFile, options: FloorOptions) -> FloorPlan:
        """The floor that the options choose in it."""


class BodiesModule(Protocol):
    """The module of a reader whose files hold bodies, which finished plans are checked against."""

    def standing(self, file: FloorFile, options: FloorOptions) -> tuple[StandingBody, ...]:
        """Return the bodies in the robot's height on the floor that the options choose."""


@dataclass(frozen=True)
class Reader:
    """One kind of file that floors are read from."""

    kind: str
    """Name for a person, such as `DXF drawing`."""
    suffixes: tuple[str, ...]
    holds: Callable[[bytes], bool]
    """True if bytes look like such a file, whatever its name is."""
    module: str
    """Dotted name of its module, a ReaderModule, which is loaded when it is used."""
    takes: frozenset[str]
    """Names of the FloorOptions that apply to it, except d_dis."""
    has_bodies: bool = False
    """True if its module is a BodiesModule."""

    def load(self) -> ReaderModule:
        """Its module."""
        return cast("ReaderModule", import_module(self.module))
