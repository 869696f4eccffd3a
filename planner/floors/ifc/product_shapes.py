"""Shapes of a model's entities: by the fast kernel, else in other ways, else as a box."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, cast

import ifcopenshell
import ifcopenshell.geom
import ifcopenshell.util.placement
import ifcopenshell.util.unit
import numpy as np

from stopgo.planner.floors.ifc.kernel_shapes import (
    KERNEL,
    Kernel,
    Made,
    is_sound,
    iterated,
    made_of,
    settings_of,
    show_progress,
)
from stopgo.planner.floors.ifc.model import Placement
from stopgo.planner.floors.ifc.opening_cuts import cut_bodies

BODIES = ("Body", "Facetation", None, "")
"""Identifiers of the representations that are bodies."""
WAYS: Final[dict[str, tuple[Kernel, dict[str, bool]]]] = {
    "other kernel": ("opencascade", {}),
    "no openings": (KERNEL, {"with_openings": False}),
    "no openings, other kernel": ("opencascade", {"with_openings": False}),
    "no cuts": ("opencascade", {"with_openings": False, "with_cuts": False}),
}
"""Kernels and settings by which a shape is tried that the fast kernel cannot make, in this order."""
UNCUT = tuple(name for name, (_, said) in WAYS.items() if said)
BOX: Final = "box"
POINTWISE = (
    "IfcManifoldSolidBrep",
    "IfcTessellatedItem",
    "IfcShellBasedSurfaceModel",
    "IfcFaceBasedSurfaceModel",
)
"""Items whose points the file gives in the coordinates of their product."""
CORNERS = tuple((i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1))
BOX_FACES = (
    *((0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4)),
    *((2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5)),
)
"""Triangles of a box by its CORNERS; they look outwards."""


def all_at_once(model: ifcopenshell.file, entities: list[Any]) -> Iterator[Made]:
    """Every shape by the fast kernel; the few that it cannot make, one by one in other ways.

    Most bodies with openings are cut by another kernel, at a tenth of the time. Products of one type have one
    shape. The kernel makes it once, where it need not place it in the world.
    """
    typed = _with_shared_shapes(entities)
    shared = {entity.id() for entity in typed}
    done = set()
    for made in cut_bodies(model, [item for item in entities if item.id() not in shared]):
        done.add(made.number)
        yield made
    alone = [item for item in entities if item.id() not in shared | done]
    for in_world, chosen in ((True, alone), (False, typed)):
        for made in iterated(model, chosen, settings_of(in_world=in_world)):
            done.add(made.number)
            yield made
    for entity in entities:
        other = None if entity.id() in done else _in_another_way(model, entity)
        if other is not None:
            yield other


def _with_shared_shapes(entities: list[Any]) -> list[Any]:
    """Entities of which the shape, or a part of it, is that of others too."""
    sources = {
        entity.id(): {item.MappingSource.id() for item in _items(entity) if item.is_a("IfcMappedItem")}
        for entity in entities
    }
    counts = Counter(source for own in sources.values() for source in own)
    return [entity for entity in entities if any(counts[source] > 1 for source in sources[entity.id()])]


def one_by_one(
    model: ifcopenshell.file, entities: list[Any], without: frozenset[str], at: Path
) -> Iterator[Made]:
    """Each shape alone; before each its GlobalId is written down, for whoever reads the crash."""
    for number, entity in enumerate(entities):
        if entity.GlobalId in without:
            continue
        show_progress(100 * number // len(entities))
        at.write_text(entity.GlobalId)
        made = _created(entity, settings_of(), KERNEL)
        if made is None:
            made = _in_another_way(model, entity)
        if made is not None:
            yield made


def _in_another_way(model: ifcopenshell.file, entity: Any) -> Made | None:
    """A shape that the fast kernel cannot make: by another kernel, without openings or cuts, as a box."""
    if not has_body(entity):
        return None
    for way, (kernel, said) in WAYS.items():
        made = _created(entity, settings_of(**said), kernel)
        if made is not None:
            return replace(made, way=way)
    return _as_box(model, entity)


def _created(entity: Any, settings: Any, kernel: Kernel) -> Made | None:
    try:
        shape = ifcopenshell.geom.create_shape(settings, entity, geometry_library=kernel)
    except RuntimeError:
        return None
    made = made_of(entity.id(), cast(Any, shape))
    return made if is_sound(made) else None


def _as_box(model: ifcopenshell.file, entity: Any) -> Made | None:
    """The box around the points of a body that are given as they are; None without such points."""
    unit = ifcopenshell.util.unit.calculate_unit_scale(model)
    points = [point for item in _items(entity) for point in _points(item, model)]
    placement = placement_of(entity, unit)
    if len(points) < 2 or placement is None:
        return None
    local = np.array(points, dtype=float) * unit
    low, high = local.min(axis=0), local.max(axis=0)
    if (high - low).min() <= 0:
        return None
    corners = np.array([[(low, high)[k][axis] for axis, k in enumerate(ijk)] for ijk in CORNERS])
    matrix = np.array(placement).reshape(4, 4)
    made = Made(entity.id(), corners @ matrix[:3, :3].T + matrix[:3, 3], np.array(BOX_FACES), way=BOX)
    return made if is_sound(made) else None


def _items(entity: Any) -> Iterator[Any]:
    for shape in entity.Representation.Representations:
        if shape.RepresentationIdentifier in (*BODIES, "Box"):
            yield from shape.Items


def _points(item: Any, model: ifcopenshell.file) -> Iterator[tuple[float, ...]]:
    """Points of an item in the coordinates of its entity, where the file gives them so."""
    if item.is_a("IfcBoundingBox"):
        corner = item.Corner.Coordinates
        yield from (corner, tuple(np.add(corner, (item.XDim, item.YDim, item.ZDim))))
    elif any(is_a(item, name) for name in POINTWISE):
        for part in model.traverse(item):
            if part.is_a("IfcCartesianPoint") and len(part.Coordinates) == 3:
                yield part.Coordinates
            elif is_a(part, "IfcCartesianPointList3D"):
                yield from part.CoordList


def has_body(entity: Any) -> bool:
    """True if a product has a body, and not only a line or a symbol."""
    if entity.Representation is None:
        return False
    return any(item.RepresentationIdentifier in BODIES for item in entity.Representation.Representations)


def placement_of(entity: Any, unit: float) -> Placement | None:
    if entity.ObjectPlacement is None:
        return None
    matrix = np.array(ifcopenshell.util.placement.get_local_placement(entity.ObjectPlacement), dtype=float)
    matrix[:3, 3] *= unit
    return tuple(matrix.ravel().tolist())


def is_a(entity: Any, name: str) -> bool:
    try:
        return bool(entity.is_a(name))
    except RuntimeError:
        return False
