"""Walks a drawing's model space, blocks and all, to the shapes on each layer and where they are placed."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from ezdxf import disassemble
from ezdxf.document import Drawing
from ezdxf.entities import DXFEntity, Insert
from ezdxf.math import Matrix44

from mission.errors import InputError
from mission.floor import KINDS, Finding

ROLES: dict[str, str] = {
    "FLOOR": "floor",
    "ROOMS": "rooms",
    "DOORS": "doors",
    "PASSAGES": "passages",
    **{kind.upper(): kind for kind in KINDS if kind != "other"},
}
"""What the shapes of a layer are; a layer that is not here is `other`."""

_PREFIX = re.compile(r"^.*(\$\d+\$|\|)")
_NOT_DRAWN = {"ATTDEF", "VIEWPORT", "SEQEND", "POINT", "WIPEOUT", "XLINE", "RAY"}
_TEXTS = {"TEXT", "MTEXT", "ATTRIB"}
_NOTES = {
    *("DIMENSION", "ARC_DIMENSION", "LARGE_RADIAL_DIMENSION", "LEADER", "MULTILEADER", "MLEADER"),
    *("TOLERANCE", "ACAD_TABLE", "IMAGE", "PDFUNDERLAY", "DWFUNDERLAY", "DGNUNDERLAY", "OLE2FRAME"),
}
_DEEPEST = 32
_MOST_SHAPES = 1_000_000
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

    @property
    def is_text(self) -> bool:
        return self.entity.dxftype() in _TEXTS

    @property
    def is_note(self) -> bool:
        """Annotation: it stands for nothing that is built."""
        return self.entity.dxftype() in _NOTES

    @property
    def name(self) -> str:
        """How a finding calls it: kind, handle and layer."""
        return f"{self.entity.dxftype()} #{self.entity.dxf.get('handle') or '?'} on {self.layer}"


@dataclass(frozen=True, eq=False)
class _Placement:
    """What a block's content takes over from the inserts around it."""

    matrix: Matrix44 | None = None
    layer: str = "0"
    global_id: str | None = None
    frozen: bool = False
    depth: int = 0


def shapes_of(drawing: Drawing, *, source: Path) -> tuple[list[Shape], list[Finding]]:
    """All shapes of the model space, and a finding for each hidden layer and each thing not followed.

    Content of a block on layer 0 lies on its insert's layer. A hidden layer counts only if its name is known.
    """
    walk = _Walk(drawing)
    shapes: list[Shape] = []
    for shape in walk.through(drawing.modelspace(), _Placement()):
        shapes.append(shape)
        if len(shapes) > _MOST_SHAPES:
            raise InputError(f"{source}: more than {_MOST_SHAPES} shapes; export one floor without furniture")
    return shapes, walk.findings()


class _Walk:
    """One pass over a drawing, with what it met on the way."""

    def __init__(self, drawing: Drawing) -> None:
        self._hidden = {layer.dxf.name.upper(): layer.is_frozen() for layer in _hidden_layers(drawing)}
        self._used: Counter[str] = Counter()
        self._odd: Counter[tuple[str, str]] = Counter()

    def through(self, entities: Iterable[DXFEntity], placed: _Placement) -> Iterator[Shape]:
        for entity in entities:
            if entity.dxftype() in _NOT_DRAWN or entity.dxf.get("invisible", 0):
                continue
            if isinstance(entity, Insert):
                yield from self._insert(entity, placed)
            elif entity.dxftype() == "MLINE":
                yield from self.through(disassemble.recursive_decompose([entity]), placed)
            else:
                yield from self._shape(entity, placed)

    def _insert(self, insert: Insert, placed: _Placement) -> Iterator[Shape]:
        block = insert.block()
        name = insert.dxf.get("name", "?")
        if block is None or block.block is None or block.block.is_xref:
            self._odd["missing_block", f"block {name} is not in the file; bind external references"] += 1
            return
        if placed.depth >= _DEEPEST or insert.mcount > _MOST_COPIES:
            self._odd["endless_block", f"block {name} holds itself or {insert.mcount} copies; not read"] += 1
            return
        layer = _layer(insert, placed)
        inside = replace(
            placed,
            layer=layer,
            global_id=_global_id(insert) or placed.global_id,
            frozen=placed.frozen or self._hidden.get(layer.upper(), False),
            depth=placed.depth + 1,
        )
        yield from self.through(insert.attribs, placed)
        for copy in insert.multi_insert() if insert.mcount > 1 else [insert]:
            yield from self.through(block, replace(inside, matrix=_within(copy, placed.matrix)))

    def _shape(self, entity: DXFEntity, placed: _Placement) -> Iterator[Shape]:
        layer = _layer(entity, placed)
        plain = _PREFIX.sub("", layer)
        role = ROLES.get(plain.upper(), "other")
        if plain.upper() == "DEFPOINTS":
            return
        if placed.frozen or layer.upper() in self._hidden:
            if role == "other":
                return
            self._used[layer] += 1
        global_id = _global_id(entity) or placed.global_id
        yield Shape(entity, plain, role, matrix=placed.matrix, global_id=global_id)

    def findings(self) -> list[Finding]:
        hidden = [
            Finding(
                "hidden_layer", f"layer {layer} is frozen or off; its {count} entities are used all the same"
            )
            for layer, count in self._used.items()
        ]
        odd = [Finding(code, f"{text} ({count} times)") for (code, text), count in self._odd.items()]
        return hidden + odd


def _hidden_layers(drawing: Drawing) -> list:
    return [layer for layer in drawing.layers if layer.is_off() or layer.is_frozen()]


def _layer(entity: DXFEntity, placed: _Placement) -> str:
    layer = str(entity.dxf.get("layer", "0"))
    return placed.layer if layer == "0" else layer


def _within(insert: Insert, outer: Matrix44 | None) -> Matrix44:
    inner = insert.matrix44()
    return inner if outer is None else inner * outer


def _global_id(entity: DXFEntity) -> str | None:
    """The IFC GlobalId: XDATA of application IFC, group 1000."""
    if not entity.has_xdata("IFC"):
        return None
    return next((str(tag.value) for tag in entity.get_xdata("IFC") if tag.code == 1000), None)
