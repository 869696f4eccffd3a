"""Shapes of a drawing's model space and its blocks, each with its layer and placement."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ezdxf import disassemble
from ezdxf.document import Drawing
from ezdxf.entities import DXFEntity, DXFTagStorage, Insert, MLine
from ezdxf.math import Matrix44
from ezdxf.xclip import XClip

from stopgo.mission.console.table import counted
from stopgo.mission.errors import InputError
from stopgo.mission.floor import Finding
from stopgo.planner.floors.drawing import BROKEN_INPUT
from stopgo.planner.floors.layer_names import LayerReading
from stopgo.planner.floors.layers import IGNORE, ROLES, Layers
from stopgo.planner.floors.legible_text import legible
from stopgo.planner.geometry.instance_cache import instance_cached

_PREFIX = re.compile(r"^.*(\$\d+\$|\|)")
_NOT_DRAWN = {"ATTDEF", "VIEWPORT", "SEQEND", "POINT", "WIPEOUT", "XLINE", "RAY"}
_TEXTS = {"TEXT", "MTEXT", "ATTRIB"}
_NOTES = {
    *("DIMENSION", "ARC_DIMENSION", "LARGE_RADIAL_DIMENSION", "LEADER", "MULTILEADER", "MLEADER"),
    *("TOLERANCE", "ACAD_TABLE", "IMAGE", "PDFUNDERLAY", "DWFUNDERLAY", "DGNUNDERLAY", "OLE2FRAME"),
}
_MOST = 1_000_000
_MOST_COPIES = 10_000


@dataclass(frozen=True, eq=False)
class Shape:
    """An entity on a layer, placed in the world by `matrix` (None: where it is drawn)."""

    entity: DXFEntity
    layer: str
    """The layer's name without the prefix of an external reference."""
    role: str
    matrix: Matrix44 | None = None
    global_id: str | None = None
    why: str = ""
    """Source of this role."""
    memo: dict[str, Any] = field(default_factory=dict, repr=False)
    """Curves of the entity once they were computed, whatever its role is."""

    @property
    def is_text(self) -> bool:
        return self.entity.dxftype() in _TEXTS

    @property
    def is_note(self) -> bool:
        """True for an annotation: it shows nothing that is built."""
        return self.entity.dxftype() in _NOTES

    @property
    def name(self) -> str:
        """Name in findings: kind, handle and layer."""
        return f"{self.kind} #{legible(str(self.entity.dxf.get('handle')))} on {self.layer}"

    @property
    def kind(self) -> str:
        """The entity's kind as the format calls it, such as LWPOLYLINE."""
        return legible(self.entity.dxftype())


@dataclass(frozen=True, eq=False)
class _Placement:
    """Properties that a block's content inherits from the inserts around it."""

    matrix: Matrix44 | None = None
    layer: str = "0"
    global_id: str | None = None
    frozen: bool = False
    blocks: tuple[str, ...] = ()
    """Names of the blocks it is in, outermost first."""


@dataclass(frozen=True, eq=False)
class _Met:
    """An entity as the walk meets it, before its layer has a meaning."""

    entity: DXFEntity
    layer: str
    """The layer's whole name."""
    plain: str
    """The name without the prefix of an external reference."""
    placed: _Placement
    hidden: bool
    memo: dict[str, Any] = field(default_factory=dict)


def shapes_of(
    drawing: Drawing, *, source: Path, layers: Layers | None = None
) -> tuple[list[Shape], list[Finding]]:
    """Return all shapes of the model space, and a finding for each hidden layer and each block left out.

    Shapes of layers to ignore are left out.

    Content of a block on layer 0 lies on its insert's layer. A hidden layer counts only if its name is known.
    The drawing is walked once, however many meanings its layers are tried with.
    """
    walk = _walked(drawing, source)
    meanings = _Meanings(layers or Layers())
    shapes = [shape for met in walk.met if (shape := meanings.shape(met)) is not None]
    return shapes, [*meanings.findings(), *walk.findings()]


def ignored_in(drawing: Drawing, *, source: Path, layers: Layers) -> list[tuple[str, LayerReading, int]]:
    """Return each ignored layer with the source of that meaning, and its number of entities."""
    meanings = _Meanings(layers)
    for met in _walked(drawing, source).met:
        meanings.shape(met)
    return [(layer, reading, count) for (layer, reading), count in sorted(meanings.left_out.items(), key=str)]


def _walked(drawing: Drawing, source: Path) -> _OutlineWalk:
    try:
        return _walk_of(drawing)
    except _TooMany:
        raise InputError(
            f"{source}: more than {_MOST} entities; export one floor without furniture"
        ) from None
    except RecursionError:
        raise InputError(f"{source}: blocks lie too deep in one another; explode or purge them") from None


class _TooMany(Exception):
    """A drawing has more entities than a floor."""


@instance_cached
def _walk_of(drawing: Drawing) -> _OutlineWalk:
    """The one pass over a drawing."""
    if entities_with_copies(drawing) > _MOST:
        raise _TooMany
    return _OutlineWalk(drawing)


_BUILT = frozenset({*ROLES.values(), "openings"})
"""Roles for which a hidden layer counts too."""


class _OutlineWalk:
    """One pass over a drawing, with its anomalies."""

    def __init__(self, drawing: Drawing) -> None:
        self._count = 0
        self._hidden = {layer.dxf.name.upper(): layer.is_frozen() for layer in _hidden_layers(drawing)}
        self._plain: dict[str, str] = {}
        self._found: Counter[tuple[str, str]] = Counter()
        self._unseen: Counter[str] = Counter()
        self.met: list[_Met] = list(self._through(drawing.modelspace(), _Placement()))

    def _through(self, entities: Iterable[DXFEntity], placed: _Placement) -> Iterator[_Met]:
        for entity in entities:
            self._count += 1
            if self._count > _MOST:
                raise _TooMany
            if entity.dxftype() in _NOT_DRAWN:
                continue
            if _attribute(entity, "invisible", 0):
                if not placed.blocks:  # else most are of another state of a dynamic block
                    self._unseen[legible(_layer(entity, placed))] += 1
                continue
            if isinstance(entity, Insert):
                yield from self._insert(entity, placed)
            elif isinstance(entity, MLine):
                yield from self._through(self._strands(entity), placed)
            else:
                yield self._met(entity, placed)

    def _strands(self, multiline: MLine) -> list[DXFEntity]:
        try:
            return list(disassemble.recursive_decompose([multiline]))
        except BROKEN_INPUT as error:
            self._found["bad_coordinates", f"an MLINE is skipped: {legible(str(error))}"] += 1
            return []

    def _insert(self, insert: Insert, placed: _Placement) -> Iterator[_Met]:
        name = legible(str(insert.dxf.get("name")))
        try:
            block, places = insert.block(), _places(insert, placed)
            clipped = XClip(insert).has_clipping_path
        except BROKEN_INPUT as error:
            self._found["bad_coordinates", f"block {name} is skipped: {legible(str(error))}"] += 1
            return
        if block is None or block.block is None or block.block.is_xref:
            self._found["missing_block", f"block {name} is not in the file; bind external references"] += 1
        elif name in placed.blocks:
            self._found["endless_block", f"block {name} holds itself and is not followed"] += 1
        else:
            if clipped:
                self._found["clipped_block", f"block {name} is clipped in the drawing and read whole"] += 1
            yield from self._through(insert.attribs, placed)
            inside = self._inside(insert, placed, name=name)
            for matrix in places:
                yield from self._through(block, replace(inside, matrix=matrix))

    def _inside(self, insert: Insert, placed: _Placement, *, name: str) -> _Placement:
        layer = _layer(insert, placed)
        return replace(
            placed,
            layer=layer,
            global_id=_global_id(insert) or placed.global_id,
            frozen=placed.frozen or self._hidden.get(layer.upper(), False),
            blocks=(*placed.blocks, name),
        )

    def _met(self, entity: DXFEntity, placed: _Placement) -> _Met:
        layer = _layer(entity, placed)
        if layer not in self._plain:
            self._plain[layer] = legible(_PREFIX.sub("", layer))
        hidden = placed.frozen or layer.upper() in self._hidden
        return _Met(entity, layer, self._plain[layer], placed, hidden)

    def findings(self) -> list[Finding]:
        """Findings on blocks, multilines and invisible entities."""
        found = [Finding(code, text) for (code, text), count in self._found.items() for _ in range(count)]
        for layer, count in sorted(self._unseen.items()):
            left_out = f"{counted(count, 'invisible entity', 'invisible entities')} left out"
            remedy = "show all objects in CAD if they belong to the floor (UNISOLATEOBJECTS)"
            found.append(Finding("invisible", f"layer {layer}: {left_out}; {remedy}"))
        return found


class _Meanings:
    """Shapes of what was met, by the meanings of layers, with the counts of their uses."""

    def __init__(self, layers: Layers) -> None:
        self._layers = layers
        self._readings: dict[tuple[str, tuple[str, ...]], LayerReading] = {}
        self._given_uses: Counter[tuple[str, str]] = Counter()
        self._used: Counter[str] = Counter()
        self.left_out: Counter[tuple[str, LayerReading]] = Counter()

    def shape(self, met: _Met) -> Shape | None:
        """Return the shape; None if its layer is ignored."""
        reading = self._reading(met.plain, met.placed.blocks)
        if reading.role == IGNORE or met.plain.upper() == "DEFPOINTS":
            self.left_out[met.plain, reading] += 1
            return None
        if met.hidden:
            if reading.role not in _BUILT:
                self.left_out[met.plain, LayerReading(reading.role, "frozen or off")] += 1
                return None
            self._used[met.layer] += 1
        global_id = _global_id(met.entity) or met.placed.global_id
        return Shape(
            *(met.entity, met.plain, reading.role, met.placed.matrix, global_id, reading.why, met.memo)
        )

    def _reading(self, layer: str, blocks: tuple[str, ...]) -> LayerReading:
        """Return the meaning of a layer, and count its use if the user gave it."""
        key = (layer, blocks)
        if key not in self._readings:
            self._readings[key] = self._layers.reading(layer, blocks)
        reading = self._readings[key]
        if layer.upper() in self._layers.given:
            self._given_uses[layer, reading.role] += 1
        return reading

    def findings(self) -> list[Finding]:
        """Findings on layers that the user named, and on hidden ones."""
        given = [
            Finding("layer_as_told", f"layer {layer} is taken for {role}, as given: {count} entities")
            for (layer, role), count in self._given_uses.items()
        ]
        hidden = [
            Finding("hidden_layer", f"layer {legible(layer)} is frozen or off; its {count} entities are used")
            for layer, count in self._used.items()
        ]
        return [*given, *self._absent(), *hidden]

    def _absent(self) -> list[Finding]:
        """Findings on layers that the user named and the drawing does not have."""
        absent = set(self._layers.given) - {layer.upper() for layer, _ in self._given_uses}
        return [
            Finding("no_such_layer", f"layer {legible(name)} is not in the drawing")
            for name in sorted(absent)
        ]


def entities_with_copies(drawing: Drawing) -> int:
    """Return the number of entities in the model space with all copies of blocks; no block is expanded."""
    sizes: dict[str, int] = {}

    def size_of(entities: Iterable[DXFEntity]) -> int:
        return sum(1 if not isinstance(item, Insert) else 1 + copies_in(item) for item in entities)

    def copies_in(insert: Insert) -> int:
        name = str(insert.dxf.get("name")).casefold()
        try:
            block, copies = insert.block(), max(insert.mcount, 1)
        except RecursionError:
            raise
        except BROKEN_INPUT:
            return 0  # the walk reports it
        if name not in sizes:
            sizes[name] = 0  # a block inside itself is not followed
            sizes[name] = 0 if block is None else size_of(block)
        return copies * sizes[name] if copies <= _MOST_COPIES else 0

    return size_of(drawing.modelspace())


def _hidden_layers(drawing: Drawing) -> list:
    return [layer for layer in drawing.layers if layer.is_off() or layer.is_frozen()]


def _layer(entity: DXFEntity, placed: _Placement) -> str:
    layer = str(_attribute(entity, "layer", "0"))
    return placed.layer if layer == "0" else layer


def _attribute(entity: DXFEntity, name: str, default: object) -> object:
    """Return an attribute; for entities unknown to ezdxf, from their raw tags."""
    if isinstance(entity, DXFTagStorage):
        return entity.graphic_properties().get(name, default)
    return entity.dxf.get(name, default) if entity.dxf.is_supported(name) else default


def _places(insert: Insert, placed: _Placement) -> list[Matrix44]:
    """Placements of the block: one, or rows and columns."""
    if insert.mcount > _MOST_COPIES:
        raise ValueError(f"{insert.mcount} copies are no building's")
    copies = insert.multi_insert() if insert.mcount > 1 else [insert]
    inner = [copy.matrix44() for copy in copies]
    return inner if placed.matrix is None else [matrix * placed.matrix for matrix in inner]


def _global_id(entity: DXFEntity) -> str | None:
    """The IFC GlobalId: XDATA of application IFC, group 1000."""
    if not entity.has_xdata("IFC"):
        return None
    return next((legible(str(tag.value)) for tag in entity.get_xdata("IFC") if tag.code == 1000), None)
