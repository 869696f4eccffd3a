"""IFC file -> model, in a process of its own, with the arguments MODEL and OUT.

The geometry kernel is compiled code that may crash on a bad solid: a crash ends only this process. Progress
goes to stderr where that is a terminal. What it was working on last is in the file OUT.at.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final, cast

import ifcopenshell
import ifcopenshell.geom
import ifcopenshell.util.element
import ifcopenshell.util.placement
import ifcopenshell.util.unit
import numpy as np

from stopgo.planner.floors.ifc.construction_dates import phases_of, tasks_by_product
from stopgo.planner.floors.ifc.earth_placement import place_of
from stopgo.planner.floors.ifc.model import Described, Model, Placement, Product, Storey, packed

KERNEL: Final = "hybrid-cgal-simple-opencascade"
ROLES = {
    "IfcWall": "walls",
    "IfcColumn": "columns",
    "IfcPile": "columns",
    "IfcChimney": "columns",
    "IfcBeam": "beams",
    "IfcMember": "members",
    "IfcPlate": "plates",
    "IfcCurtainWall": "windows",
    "IfcWindow": "windows",
    "IfcDoor": "doors",
    "IfcSlab": "slabs",
    "IfcRoof": "roofs",
    "IfcStair": "stairs",
    "IfcStairFlight": "stairs",
    "IfcRamp": "stairs",
    "IfcRampFlight": "stairs",
    "IfcRailing": "railings",
    "IfcCovering": "coverings",
    "IfcFooting": "footings",
    "IfcBuildingElementProxy": "other",
    "IfcSpace": "spaces",
    "IfcOpeningElement": "openings",
}
"""Role of each class of a model in a plan; all other classes are left out and counted."""
UNSEEN = (
    "IfcSpatialStructureElement",
    "IfcSpatialElement",
    "IfcAnnotation",
    "IfcGrid",
    "IfcPort",
    "IfcVirtualElement",
)
CLEAR = 0.3
"""A style that lets more than this share of light through is glass."""
MOST_COMPLAINTS = 5
"""Lines of the library's log that are handed on."""
LARGEST = 1e7
"""Metres from the origin beyond which nothing is built."""


def main(arguments: list[str]) -> int:
    """Read MODEL and write OUT; `--one-by-one` makes each shape alone, without the GlobalIds that follow."""
    path, out, *rest = arguments
    ifcopenshell.get_log()  # forgets what it hands out
    try:
        model = ifcopenshell.open(path)
    except (ifcopenshell.Error, RuntimeError, OSError, ValueError, LookupError) as error:
        said = "; ".join(_complaints()) or " ".join(str(error).split()) or type(error).__name__
        Path(f"{out}.why").write_text(f"cannot be read as IFC ({said}); export it again", encoding="utf-8")
        return 2
    damage = tuple(_complaints())
    alone = frozenset(rest[1:])
    shapes = _one_by_one(model, alone, Path(f"{out}.at")) if rest else _all_at_once(model)
    Path(out).write_bytes(packed(extracted(model, shapes, damage=damage)))
    return 0


def _complaints() -> Iterator[str]:
    """Lines of the library's log so far, without dates: at most a few."""
    log = str(ifcopenshell.get_log())
    lines = [re.sub(r"^(\[[^]]*\]\s*)+", "", line) for line in log.splitlines()]
    yield from [line for line in lines if line][:MOST_COMPLAINTS]


Made = tuple[int, Any]
"""A product's number in the file, and its geometry."""


def extracted(model: ifcopenshell.file, shapes: Iterable[Made], *, damage: tuple[str, ...] = ()) -> Model:
    """All of a model that a plan needs."""
    unit = ifcopenshell.util.unit.calculate_unit_scale(model)
    vertices, faces, where, clear = _arrays(shapes)
    tasks = tasks_by_product(model)
    products = [
        _product(entity, role, unit, where.get(entity.id()), clear.get(entity.id(), False), tasks)
        for entity, role in _chosen(model)
    ]
    failed = tuple(
        f"{entity.is_a()} {entity.GlobalId} '{entity.Name or ''}'"
        for entity, role in _chosen(model)
        if entity.Representation and entity.id() not in where and _has_body(entity)
    )
    described = Described(
        schema=model.schema_identifier,
        unit_m=unit,
        application=_application(model),
        storeys=tuple(_storeys(model, unit)),
        products=tuple(products),
        place=place_of(model, unit),
        left_out=_left_out(model),
        failed=failed,
        damage=damage,
    )
    return Model(described, vertices, faces)


def _chosen(model: ifcopenshell.file) -> list[tuple[Any, str]]:
    """Products that a plan is made of, with their roles, each once."""
    found: dict[int, tuple[Any, str]] = {}
    for name, role in ROLES.items():
        for entity in _by_type(model, name):
            if role != "openings" or _holds_a_door(entity):
                found.setdefault(entity.id(), (entity, role))
    return [found[key] for key in sorted(found)]


def _holds_a_door(opening: Any) -> bool:
    """Other openings are seen by what they cut out of their walls."""
    fillings = [item.RelatedBuildingElement for item in opening.HasFillings]
    return any(item is not None and item.is_a("IfcDoor") for item in fillings)


def _by_type(model: ifcopenshell.file, name: str) -> list[Any]:
    """Entities of a class; none where the schema has no such class."""
    try:
        return list(model.by_type(name))
    except RuntimeError:
        return []


def _settings() -> Any:
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    return settings


def _all_at_once(model: ifcopenshell.file) -> Iterator[Made]:
    entities = [entity for entity, _ in _chosen(model) if entity.Representation]
    if not entities:
        return
    iterator = ifcopenshell.geom.iterator(_settings(), model, 1, include=entities, geometry_library=KERNEL)
    if not iterator.initialize():
        return
    while True:
        _show_progress(iterator.progress())
        shape = iterator.get()
        yield shape.id, shape.geometry
        if not iterator.next():
            return


def _one_by_one(model: ifcopenshell.file, without: frozenset[str], at: Path) -> Iterator[Made]:
    """Each shape alone; before each its GlobalId is written down, for whoever reads the crash."""
    chosen = [entity for entity, _ in _chosen(model) if entity.Representation]
    for number, entity in enumerate(chosen):
        if entity.GlobalId in without:
            continue
        _show_progress(100 * number // len(chosen))
        at.write_text(entity.GlobalId)
        try:
            made = ifcopenshell.geom.create_shape(_settings(), entity, geometry_library=KERNEL)
        except RuntimeError:
            continue  # reported as failed
        yield entity.id(), cast(Any, made).geometry


def _show_progress(percent: int) -> None:
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\033[Kmodel {percent} %" if percent < 100 else "\r\033[K")
        sys.stderr.flush()


def _arrays(
    shapes: Iterable[Made],
) -> tuple[np.ndarray, np.ndarray, dict[int, tuple[int, int, int, int]], dict[int, bool]]:
    """All vertices and faces, the rows of each product in them, and which products are glass."""
    vertices: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    where: dict[int, tuple[int, int, int, int]] = {}
    clear: dict[int, bool] = {}
    first_vertex = first_face = 0
    for number, geometry in shapes:
        points = np.frombuffer(geometry.verts_buffer, dtype=np.float64).reshape(-1, 3).copy()
        corners = np.frombuffer(geometry.faces_buffer, dtype=np.int32).reshape(-1, 3).astype(np.int64)
        if not len(corners) or not np.isfinite(points).all() or np.abs(points).max() > LARGEST:
            continue
        where[number] = (first_vertex, first_vertex + len(points), first_face, first_face + len(corners))
        clear[number] = bool(geometry.materials) and all(
            item.transparency > CLEAR for item in geometry.materials
        )
        first_vertex, first_face = first_vertex + len(points), first_face + len(corners)
        vertices.append(points)
        faces.append(corners)
    if not faces:
        return np.empty((0, 3)), np.empty((0, 3), np.int64), where, clear
    return np.vstack(vertices), np.vstack(faces), where, clear


def _product(
    entity: Any, role: str, unit: float, rows: tuple[int, int, int, int] | None, clear: bool, tasks: dict
) -> Product:
    first, last, low, high = rows or (0, 0, 0, 0)
    container = ifcopenshell.util.element.get_container(entity, ifc_class="IfcBuildingStorey")
    opening = next(iter(getattr(entity, "FillsVoids", ())), None)
    host = next(iter(getattr(entity, "VoidsElements", ())), None)
    return Product(
        global_id=entity.GlobalId,
        name=_name(entity),
        ifc_class=entity.is_a(),
        role=_role(entity, role),
        predefined=str(getattr(entity, "PredefinedType", None) or ""),
        storey=container.GlobalId if container is not None else None,
        placement=_placement(entity, unit) if role == "doors" else None,
        vertices=(first, last),
        faces=(low, high),
        transparent=clear,
        opening=opening.RelatingOpeningElement.GlobalId if opening else None,
        host=host.RelatingBuildingElement.GlobalId if host else None,
        parts=tuple(part.GlobalId for part in ifcopenshell.util.element.get_parts(entity)),
        overall_width=_metres(getattr(entity, "OverallWidth", None), unit) if role == "doors" else None,
        lining=_lining(entity, unit) if role == "doors" else None,
        tasks=tasks.get(entity.id(), ()),
        phases=phases_of(entity),
    )


def _name(entity: Any) -> str:
    """A space is called by its number and its long name; anything else by its name."""
    long = getattr(entity, "LongName", None) if entity.is_a("IfcSpace") else None
    return " ".join(dict.fromkeys(part for part in (entity.Name, long) if part))


def _role(entity: Any, role: str) -> str:
    """Members, plates and railings of a curtain wall, a stair or a roof are part of that."""
    if role not in ("members", "plates", "slabs", "other", "beams"):
        return role
    whole = ifcopenshell.util.element.get_aggregate(entity)
    if whole is None:
        return role
    if whole.is_a("IfcCurtainWall"):
        return "windows"
    if whole.is_a("IfcStair") or whole.is_a("IfcRamp"):
        return "stairs"
    return "railings" if whole.is_a("IfcRailing") else role


def _placement(entity: Any, unit: float) -> Placement | None:
    if entity.ObjectPlacement is None:
        return None
    matrix = np.array(ifcopenshell.util.placement.get_local_placement(entity.ObjectPlacement), dtype=float)
    matrix[:3, 3] *= unit
    return tuple(matrix.ravel().tolist())


def _metres(value: Any, unit: float) -> float | None:
    return float(value) * unit if isinstance(value, int | float) and value > 0 else None


def _lining(entity: Any, unit: float) -> float | None:
    """LiningThickness of the door's style or type."""
    kind = ifcopenshell.util.element.get_type(entity)
    for owner in (entity, kind):
        for item in getattr(owner, "HasPropertySets", None) or ():
            if item.is_a("IfcDoorLiningProperties"):
                return _metres(item.LiningThickness, unit)
        for relation in getattr(owner, "IsDefinedBy", None) or ():
            item = getattr(relation, "RelatingPropertyDefinition", None)
            if item is not None and item.is_a("IfcDoorLiningProperties"):
                return _metres(item.LiningThickness, unit)
    return None


def _has_body(entity: Any) -> bool:
    """True if a product has a body, and not only a line or a symbol."""
    kinds = {item.RepresentationIdentifier for item in entity.Representation.Representations}
    return bool(kinds & {"Body", "Facetation", None, ""})


def _storeys(model: ifcopenshell.file, unit: float) -> Iterator[Storey]:
    for entity in _by_type(model, "IfcBuildingStorey"):
        placement = _placement(entity, unit)
        elevation = placement[11] if placement else (_metres(entity.Elevation, unit) or 0.0)
        yield Storey(entity.GlobalId, entity.Name or entity.LongName or "", elevation)


def _application(model: ifcopenshell.file) -> str:
    names = (item.ApplicationFullName for item in _by_type(model, "IfcApplication"))
    return next((str(name) for name in names if name), "")


def _left_out(model: ifcopenshell.file) -> dict[str, int]:
    chosen = {entity.id() for entity, _ in _chosen(model)}
    chosen |= {entity.id() for entity in _by_type(model, "IfcOpeningElement")}
    counts = Counter(
        entity.is_a()
        for entity in _by_type(model, "IfcProduct")
        if entity.id() not in chosen and not any(_is(entity, name) for name in UNSEEN)
    )
    return dict(sorted(counts.items()))


def _is(entity: Any, name: str) -> bool:
    try:
        return bool(entity.is_a(name))
    except RuntimeError:
        return False
