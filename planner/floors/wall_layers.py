"""Choice of the layers that hold a drawing's walls where no name shows them: each is tried, its floor judged.

A trial reads the drawing as if the user had given the layers. What its floor shows counts as evidence: doors
in gaps of the walls, walls of two lines, rooms with a name in them, written areas that are true of their
rooms. Layers with enough evidence are used, and a finding names them and the evidence. Else the message
names the most probable layers, and the option that accepts them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import shapely
from ezdxf.document import Drawing

from stopgo.mission.console.table import counted
from stopgo.mission.errors import InputError
from stopgo.mission.floor import Finding
from stopgo.mission.geometry import polyline_length
from stopgo.mission.settings.layer_kinds import layer_option
from stopgo.planner.floors.drawn_shapes import Shape
from stopgo.planner.floors.dxf_sheet import DxfSheet, layers_of, sheet_of
from stopgo.planner.floors.lines_and_texts import Word
from stopgo.planner.floors.linework import Derived
from stopgo.planner.floors.reader import FloorOptions
from stopgo.planner.floors.room_words import names_a_room
from stopgo.planner.floors.strokes import sketch
from stopgo.planner.floors.units import UnitAsked
from stopgo.planner.floors.written_measures import area_in

ENOUGH = 2
"""Evidence of this weight shows walls; one kind of it alone does not."""
_MANY = 3
"""So many doors in gaps of walls are evidence of double weight."""
_DOUBLE = 0.6
"""Walls are drawn as two lines if this fraction of the lines bounds a solid."""
_CONNECTED = 15.0
"""Passages lie between walls if connected ones have an outline of this mean length, in metres."""
_LEAST_SHARE = 0.08
"""A layer with less than this fraction of the unknown lines holds no walls."""
_MOST_LAYERS, _MOST_OF_LARGE = 4, 2
"""Layers that are tried, and those of a drawing with more than _LARGE shapes, where each trial takes long."""
_LARGE = 4000
_ALIKE = 0.05
"""A written area is true of a room if it differs by less than this fraction …"""
_ROUNDED = 0.3
"""… or by less than this many m²."""
_LIKE_FLOOR = 0.9
"""Floors are the same if the smaller one has this fraction of the larger one."""
_ROWS = 0.95
"""Rooms that all have the same area, up to this fraction, are rows of a table."""
_FLOOR_M2 = (5.0, 50_000.0)
WIDEST_GAP = 1.6
"""Outer walls with a wider gap, in metres, may be those of several drawings."""
MOST_STRAY = 0.3
"""Walls of which more than this fraction lies off the floor are other lines too."""
UNTOLD = ("other", "rooms")
"""Roles whose lines may be walls in a drawing without a layer of walls …"""
NOT_ENCLOSING = (*UNTOLD, "walls", "doors", "openings", "windows", "columns")
"""… and in one whose layers of walls enclose no floor."""
_NAME = re.compile(r"[^\W\d_]{3,}|\bWC\b", re.IGNORECASE)
_NO_PLAN = re.compile(
    r"\b(ELEVATION|SECTION|ANSICHT|SCHNITT|COUPE|FA[CÇ]ADE|ALZADO|PROSPETTO|SEZIONE|GEVEL|DOORSNEDE|ELEVACI[OÓ]N|"
    r"SITE PLAN|LAGEPLAN)\b",
    re.IGNORECASE,
)
"""Titles of drawings that show no storey from above."""

Deriving = Callable[[DxfSheet], Derived]
"""Derives a floor from a sheet; raises InputError if there is none."""


@dataclass(frozen=True, eq=False)
class WallLayers:
    """Layers of walls that a drawing was tried with, and the evidence for them."""

    layers: tuple[str, ...] = ()
    weight: int = 0
    evidence: tuple[str, ...] = ()
    count: int = 0
    """Doors, passages, names and areas that are evidence."""
    is_doubted: bool = False
    """True if the floor is no storey, or written areas are false."""
    area: float = 0.0
    refusal: str = ""
    """Reason why these layers give no floor."""
    units: tuple[tuple[str, str], ...] = ()
    """Options for the unit, each with what it makes, where only the unit is missing."""
    sheet: DxfSheet | None = None
    """The drawing as read in the trial, if it gives a floor."""

    @property
    def is_told(self) -> bool:
        return self.weight >= ENOUGH

    @property
    def option(self) -> str:
        """The options that choose these layers, quoted for a shell."""
        return " ".join(layer_option(name, "walls") for name in self.layers)

    @property
    def walls(self) -> Mapping[str, str]:
        return MappingProxyType({name.upper(): "walls" for name in self.layers})

    @property
    def finding(self) -> Finding:
        names = ", ".join(self.layers)
        why = "; ".join(self.evidence)
        return Finding(
            "walls_by_geometry",
            f"no layer's name shows the walls: they are read from {names}, where {why} "
            f"({self.option} confirms it)",
        )


def has_wall_layers(drawing: Drawing, options: FloorOptions, *, source: Path) -> bool:
    """Return True if a layer shows the floor or its walls, by name or as given."""
    seen = layers_of(drawing, options, source=source)
    return seen.outlined or any(shape.role == "walls" for shape in seen.shapes)


def wall_layers(
    drawing: Drawing,
    options: FloorOptions,
    derive: Deriving,
    *,
    source: Path,
    roles: tuple[str, ...] = UNTOLD,
    more_than: tuple[str, ...] = (),
) -> WallLayers | None:
    """Return the layers of these roles that most probably hold the walls.

    None if none has lines, or none of them has a role that is not in `more_than`.
    """
    seen = layers_of(drawing, options, source=source)
    if not any(shape.role in roles and shape.role not in more_than for shape in seen.shapes):
        return None
    candidates = _candidates([shape for shape in seen.shapes if shape.role in roles])
    named = frozenset(shape.layer for shape in seen.shapes if shape.role == "walls")
    trials = [_trial(drawing, options, names, derive, source) for names in candidates]
    return _best([_with_names(trial, named) for trial in trials])


def _with_names(trial: WallLayers, named: frozenset[str]) -> WallLayers:
    """The trial, with the names of its layers as evidence if all layers of walls are among them."""
    if not named or trial.refusal or not named <= set(trial.layers):
        return trial
    says = f"{', '.join(sorted(named))} {'are' if len(named) > 1 else 'is'} named as walls"
    weight = trial.weight + (not trial.is_doubted)
    return replace(trial, weight=weight, evidence=(*trial.evidence, says))


def with_layers(options: FloorOptions, found: WallLayers) -> FloorOptions:
    """Return the options with the layers that were found."""
    return replace(options, found_layers=found.walls)


def labelled(sheet: DxfSheet) -> DxfSheet:
    """Return the sheet whose unknown texts name rooms, if they can be names or areas."""
    words = [
        replace(word, role="names") if word.role in ("other", "walls", "rooms") and _is_label(word) else word
        for word in sheet.words
    ]
    return replace(sheet, words=words)


def _is_label(word: Word) -> bool:
    return bool(_NAME.search(word.text)) or area_in(word.text) is not None


def _candidates(shapes: Sequence[Shape]) -> list[tuple[str, ...]]:
    """Layers to try: those with most lines, each alone and all of them together."""
    lengths: dict[str, float] = {}
    for layer, length in _lengths(shapes):
        lengths[layer] = lengths.get(layer, 0.0) + length
    whole = sum(lengths.values())
    is_large = len(shapes) > _LARGE
    rooms = _layers_of_rooms(shapes)
    names = sorted(lengths.keys() - set(rooms), key=lambda name: (-lengths[name], name))
    names = names[: _MOST_OF_LARGE if is_large else _MOST_LAYERS]
    names = [name for name in names if lengths[name] >= _LEAST_SHARE * whole]
    together = [tuple(sorted(names))] if len(names) > 1 and not is_large else []
    return [*((name,) for name in names), *together, *([rooms] if rooms else [])]


def _layers_of_rooms(shapes: Sequence[Shape]) -> tuple[str, ...]:
    """All layers of rooms, where each room has one of its own: they are tried together."""
    names = {shape.layer for shape in shapes if shape.role == "rooms"}
    return tuple(sorted(names)) if len(names) > 1 else ()


def _lengths(shapes: Sequence[Shape]) -> Iterator[tuple[str, float]]:
    for shape in shapes:
        if not (shape.is_text or shape.is_note):
            for points in sketch([shape]):
                length = polyline_length(points) if len(points) > 1 else 0.0
                if np.isfinite(length):
                    yield shape.layer, length


def _trial(
    drawing: Drawing, options: FloorOptions, names: tuple[str, ...], derive: Deriving, source: Path
) -> WallLayers:
    found = WallLayers(names)
    try:
        sheet = labelled(sheet_of(drawing, with_layers(options, found), source=source))
        made = derive(sheet)
    except UnitAsked as error:
        unit = error.choices[0][0].split()[-1]
        tried = _trial(drawing, replace(options, units=unit), names, derive, source)
        return _asked(tried, error)
    except InputError as error:
        return replace(found, refusal=str(error).partition(": ")[2])
    area = sum(room.area for room in made.shown.rooms)
    if not _FLOOR_M2[0] <= area <= _FLOOR_M2[1]:
        return replace(found, refusal=f"the walls on {', '.join(names)} enclose {area:.3g} m²", area=area)
    return replace(_weighed(found, made, sheet.words), area=area, sheet=sheet)


def _asked(tried: WallLayers, error: UnitAsked) -> WallLayers:
    """A trial in the most probable unit; if it gives a floor, the user must name the unit."""
    if tried.refusal:
        return tried
    refusal = str(error).partition(": ")[2]
    return replace(
        tried, weight=min(tried.weight, ENOUGH - 1), refusal=refusal, units=error.choices, sheet=None
    )


def _weighed(found: WallLayers, made: Derived, words: Sequence[Word]) -> WallLayers:
    """The layers with the evidence that their lines are walls."""
    shown, told = made.shown, []
    seen = _labels(shown.rooms, words)
    if seen.true and not seen.contradict:
        are = "are" if seen.true > 1 else "is"
        told.append((2, f"{counted(seen.true, 'written area')} {are} true of the rooms"))
    if shown.doors:
        told.append((2 if shown.doors >= _MANY else 1, f"{counted(shown.doors, 'door swing')} in gaps"))
    if shown.double >= _DOUBLE:
        told.append((1, f"{shown.double:.0%} of the lines are walls of two lines"))
    if seen.known >= _MANY and shown.doors + shown.passages:
        told.append((2, f"{seen.known} rooms have the name of a room in them"))
    elif seen.named > 1:
        told.append((1, f"{seen.named} rooms have a name in them"))
    if shown.passages > 1 and shown.double >= _DOUBLE and shown.component >= _CONNECTED:
        told.append((1, f"{shown.passages} passages lie between facing ends of walls"))
    weight = sum(item for item, _ in told)
    is_doubted = seen.contradict or _is_no_storey(made, words)
    return replace(
        found,
        weight=min(weight, ENOUGH - 1) if is_doubted else weight,
        is_doubted=is_doubted,
        evidence=tuple(text for _, text in told),
        count=seen.true + seen.named + shown.doors + shown.passages,
    )


def _is_no_storey(made: Derived, words: Sequence[Word]) -> bool:
    """Return True if a title names a view that is no storey, or other lines lie among the walls."""
    shown = made.shown
    if shown.closed_over > WIDEST_GAP or shown.stray > MOST_STRAY:
        return True
    return any(_NO_PLAN.search(word.text) for word in words)


@dataclass(frozen=True)
class _Labels:
    """Numbers of rooms by the texts in them."""

    true: int
    """Rooms with a written area that is true of them."""
    named: int
    """Rooms with a name."""
    known: int
    """Rooms whose name is a room's, such as kitchen."""
    contradict: bool
    """True if most of the written area is false of its rooms."""


def _labels(rooms: Sequence[shapely.Polygon], words: Sequence[Word]) -> _Labels:
    """Numbers of rooms by what texts in them say."""
    tree = shapely.STRtree(list(rooms))
    areas: dict[int, list[float]] = {}
    texts: dict[int, list[str]] = {}
    for word in words:
        if word.role == "names" and word.at:
            for room in tree.query(shapely.Point(word.at[0]), predicate="within").tolist()[:1]:
                texts.setdefault(room, []).append(word.text)
                if (area := area_in(word.text)) is not None:
                    areas.setdefault(room, []).append(area)
    true = [room for room, said in areas.items() if any(_is_true(one, rooms[room].area) for one in said)]
    false = sum(max(said) for room, said in areas.items() if room not in true)
    known = [room for room, said in texts.items() if any(map(names_a_room, said))]
    sizes = [rooms[room].area for room in known]
    is_table = bool(sizes) and min(sizes) > _ROWS * max(sizes)
    return _Labels(
        true=len(true),
        named=sum(any(map(_NAME.search, said)) for said in texts.values()),
        known=0 if is_table else len(known),
        contradict=false > sum(rooms[room].area for room in true),
    )


def _is_true(said: float, area: float) -> bool:
    return abs(said - area) <= max(_ALIKE * area, _ROUNDED)


def _best(trials: Sequence[WallLayers]) -> WallLayers | None:
    """Return the trial with most evidence and fewest layers; untold if others show another floor as well."""
    if not trials:
        return None
    first, *others = sorted(trials, key=_rank)
    rivals = [item for item in others if _rank(item)[:2] == _rank(first)[:2] and item.is_told]
    apart = [item for item in rivals if not set(first.layers) < set(item.layers)]
    if all(min(item.area, first.area) >= _LIKE_FLOOR * max(item.area, first.area) for item in apart):
        return first
    return replace(first, weight=ENOUGH - 1)


def _rank(trial: WallLayers) -> tuple[int, int, int, int, float]:
    """Sort key: the most probable walls first; of equal ones, those with most lines."""
    return (
        *(-trial.weight, -trial.count, bool(trial.refusal) + (bool(trial.refusal) and not trial.units)),
        *(len(trial.layers), -trial.area),
    )
