"""IFC file -> model, in a process of its own, with the arguments MODEL and OUT.

The geometry kernel is compiled code that may crash on a bad solid: a crash ends only this process. Progress
goes to stderr where that is a terminal. What it was working on last is in the file OUT.at.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.geom
import ifcopenshell.util.element
import ifcopenshell.util.placement
import ifcopenshell.util.unit
import msgspec
import numpy as np

from stopgo.planner.floors.ifc.construction_dates import phases_by_product, tasks_by_product
from stopgo.planner.floors.ifc.earth_placement import place_of
from stopgo.planner.floors.ifc.kernel_shapes import Made, is_sound
from stopgo.planner.floors.ifc.model import Described, Model, Product, Storey, packed
from stopgo.planner.floors.ifc.outlines import too_many_vertices
from stopgo.planner.floors.ifc.product_shapes import (
    BOX,
    UNCUT,
    all_at_once,
    has_body,
    is_a,
    one_by_one,
    placement_of,
)

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
    "IfcFurnishingElement": "furniture",
    "IfcDistributionElement": "furniture",
    "IfcTransportElement": "furniture",
    "IfcTransportationDevice": "furniture",
    "IfcSpace": "spaces",
    "IfcOpeningElement": "openings",
    "IfcElement": "other",
}
"""Role of each class in a plan; the first that fits counts. Other classes are left out and counted."""
NO_BODY = (
    *("IfcFeatureElement", "IfcVirtualElement", "IfcReinforcingElement", "IfcFastener"),
    *("IfcMechanicalFastener", "IfcGeographicElement", "IfcCivilElement", "IfcBuildingElementPart"),
)
"""Elements that stand for no body of their own in the robot's way, or only as part of another."""
NO_SOLID = ("PROVISIONFORVOID", "PROVISIONFORSPACE")
"""Predefined types of proxies that reserve room and fill none."""
UNSEEN = (
    "IfcSpatialStructureElement",
    "IfcSpatialElement",
    "IfcAnnotation",
    "IfcGrid",
    "IfcPort",
    "IfcVirtualElement",
)
COUNTED_APART = ("doors", "windows", "spaces", "openings")
"""Roles that count beside the whole that encloses them."""
SAME_BOX = 0.02
"""A part lies in its whole's body up to this much outside its box, metres."""
MOST_COMPLAINTS = 5
"""Lines of the library's log that are handed on."""


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
    try:
        entities = _shaped_entities(model)
        if fault := too_many_vertices(model, Path(path), entities):
            Path(f"{out}.why").write_text(fault, encoding="utf-8")
            return 2
        shapes = (
            one_by_one(model, entities, alone, Path(f"{out}.at")) if rest else all_at_once(model, entities)
        )
        Path(out).write_bytes(packed(extracted(model, shapes, damage=damage)))
    except Exception as error:  # noqa: BLE001 (the end of a process)
        Path(out).unlink(missing_ok=True)  # on a full disk it leaves room for the reason
        Path(f"{out}.why").write_text(_why_unread(model, error), encoding="utf-8")
        return 2
    return 0


def _why_unread(model: ifcopenshell.file, error: Exception) -> str:
    """The reason why a model that was opened is not read: what its schema requires and it lacks, if so."""
    if isinstance(error, MemoryError):
        return "takes more memory than there is; export one building or storey"
    if isinstance(error, OSError):
        return f"cannot be read ({error.strerror or error}); free space for temporary files"
    if isinstance(error, RecursionError):
        return "is damaged (what it has refers to itself, as a placement relative to itself); export it again"
    lacking = _lacking(model)
    if lacking:
        return f"is damaged ({'; '.join(lacking[:MOST_COMPLAINTS])}); export it again"
    said = " ".join(f"{type(error).__name__}: {error}".split())[:200]
    return f"cannot be read ({said}), which is a defect of stopgo; please report it with the model"


def _lacking(model: ifcopenshell.file) -> list[str]:
    """One entity of each class that lacks an attribute which its schema requires, for each such attribute."""
    schema = ifcopenshell.ifcopenshell_wrapper.schema_by_name(model.schema_identifier)
    found: dict[tuple[str, str], str] = {}
    for entity in model:
        declared: Any = schema.declaration_by_name(entity.is_a()).as_entity()
        attributes = zip(declared.all_attributes(), declared.derived(), strict=True)
        for number, (attribute, derived) in enumerate(attributes):
            if not derived and not attribute.optional() and _is_missing(attribute, entity[number]):
                words = f"#{entity.id()} {entity.is_a()} has no {attribute.name()}"
                found.setdefault((entity.is_a(), attribute.name()), words)
    return list(found.values())


def _is_missing(attribute: Any, value: Any) -> bool:
    """True if an attribute has no value, or an empty one where its schema requires an item."""
    several = attribute.type_of_attribute().as_aggregation_type()
    return value is None or (value == () and several is not None and several.bound1() > 0)


def _complaints() -> Iterator[str]:
    """Lines of the library's log so far, without dates: at most a few."""
    log = str(ifcopenshell.get_log())
    lines = [re.sub(r"^(\[[^]]*\]\s*)+", "", line) for line in log.splitlines()]
    yield from [line for line in lines if line][:MOST_COMPLAINTS]


def extracted(model: ifcopenshell.file, shapes: Iterable[Made], *, damage: tuple[str, ...] = ()) -> Model:
    """All of a model that a plan needs."""
    unit = ifcopenshell.util.unit.calculate_unit_scale(model)
    chosen = _chosen(model)
    owners = _owners(model, chosen)
    made = [item for item in shapes if item.number in owners and is_sound(item)]
    by_owner: dict[int, list[Made]] = {}
    for item in made:
        by_owner.setdefault(owners[item.number], []).append(item)
    own = _without_repeated_parts(chosen, by_owner)
    vertices, faces, where = _arrays(own)
    tasks, phases = tasks_by_product(model), phases_by_product(model)
    products = [
        msgspec.structs.replace(
            _product(entity, role, unit, where.get(entity.id()), own.get(entity.id(), ())),
            tasks=tasks.get(entity.id(), ()),
            phases=phases.get(entity.id(), ("", "")),
        )
        for entity, role in chosen
    ]
    entities = {number: model.by_id(number) for number in owners}
    shaped = {item.number for item in made}
    failed = [entity for number, entity in entities.items() if number not in shaped and has_body(entity)]
    described = Described(
        schema=model.schema_identifier,
        unit_m=unit,
        application=_application(model),
        storeys=tuple(_storeys(model, unit)),
        products=tuple(products),
        place=place_of(model, unit),
        left_out=_left_out(model, owners),
        failed=tuple(map(_in_words, failed)),
        bodiless=tuple(_in_words(entity) for entity, role in chosen if _is_bodiless(entity, role, own)),
        boxed=tuple(_in_words(entities[item.number]) for item in made if item.way == BOX),
        uncut=tuple(_in_words(entities[item.number]) for item in made if item.way in UNCUT),
        damage=damage,
    )
    return Model(described, vertices, faces)


def _is_bodiless(entity: Any, role: str, made: Mapping[int, Sequence[Made]]) -> bool:
    """True for a product that has no body, no shape of its parts, and no parts that may have one.

    A door or a window without a body is known by its opening.
    """
    if role == "openings" or has_body(entity) or made.get(entity.id()) or getattr(entity, "FillsVoids", ()):
        return False
    return not ifcopenshell.util.element.get_parts(entity)


def _in_words(entity: Any) -> str:
    return f"{entity.is_a()} {entity.GlobalId} '{entity.Name or ''}'"


def _owners(model: ifcopenshell.file, chosen: list[tuple[Any, str]]) -> dict[int, int]:
    """The product whose shape each entity makes: itself, or the whole without a body that it is a part of."""
    owners = {entity.id(): entity.id() for entity, _ in chosen}
    for part in _by_type(model, "IfcBuildingElementPart"):
        whole = ifcopenshell.util.element.get_aggregate(part)
        while whole is not None and whole.id() not in owners:
            whole = ifcopenshell.util.element.get_aggregate(whole)
        if whole is not None and part.id() not in owners and not has_body(whole):
            owners[part.id()] = whole.id()
    return dict(sorted(owners.items()))


def _without_repeated_parts(
    chosen: list[tuple[Any, str]], made: dict[int, list[Made]]
) -> dict[int, list[Made]]:
    """Shapes by product, without the parts that the body of their whole encloses: a thing counts once."""
    repeated = set()
    for entity, role in chosen:
        whole = ifcopenshell.util.element.get_aggregate(entity)
        if role in COUNTED_APART or whole is None or entity.id() not in made:
            continue
        around = made.get(whole.id(), [])
        if around and _is_within(made[entity.id()], around):
            repeated.add(entity.id())
    return {number: shapes for number, shapes in made.items() if number not in repeated}


def _is_within(inner: list[Made], outer: list[Made]) -> bool:
    """True if a box around shapes lies within the box around others."""
    low, high = _box(inner)
    around_low, around_high = _box(outer)
    return bool((low >= around_low - SAME_BOX).all() and (high <= around_high + SAME_BOX).all())


def _box(shapes: list[Made]) -> tuple[np.ndarray, np.ndarray]:
    points = np.vstack([item.points for item in shapes])
    return points.min(axis=0), points.max(axis=0)


def _chosen(model: ifcopenshell.file) -> list[tuple[Any, str]]:
    """Products that a plan is made of, with their roles, each once."""
    found: dict[int, tuple[Any, str]] = {}
    for name, role in ROLES.items():
        for entity in _by_type(model, name):
            if entity.id() not in found and _is_of_role(entity, name, role):
                found[entity.id()] = (entity, role)
    return [found[key] for key in sorted(found)]


def _is_of_role(entity: Any, name: str, role: str) -> bool:
    """True if an entity found by its class has the role of that class in a plan."""
    if role == "openings":
        return _holds_a_door(entity)
    if name == "IfcElement" and any(is_a(entity, other) for other in NO_BODY):
        return False
    return str(getattr(entity, "PredefinedType", None)) not in NO_SOLID


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


def _shaped_entities(model: ifcopenshell.file) -> list[Any]:
    """Entities of which shapes are made, by their numbers."""
    entities = map(model.by_id, _owners(model, _chosen(model)))
    return [entity for entity in entities if entity.Representation]


Rows = tuple[int, int, int, int]
"""First and last + 1 row of a product's vertices, and of its faces."""


def _arrays(made: dict[int, list[Made]]) -> tuple[np.ndarray, np.ndarray, dict[int, Rows]]:
    """All vertices and faces, and the rows of each product in them."""
    vertices: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    where: dict[int, Rows] = {}
    first_vertex = first_face = 0
    for number, shapes in made.items():
        last_vertex, last_face = 0, first_face
        for item in shapes:
            vertices.append(item.points)
            faces.append(item.corners + last_vertex)
            last_vertex, last_face = last_vertex + len(item.points), last_face + len(item.corners)
        where[number] = (first_vertex, first_vertex + last_vertex, first_face, last_face)
        first_vertex, first_face = first_vertex + last_vertex, last_face
    if not faces:
        return np.empty((0, 3)), np.empty((0, 3), np.int64), where
    return np.vstack(vertices), np.vstack(faces), where


def _product(entity: Any, role: str, unit: float, rows: Rows | None, shapes: Sequence[Made]) -> Product:
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
        placement=placement_of(entity, unit) if role == "doors" else None,
        vertices=(first, last),
        faces=(low, high),
        transparent=bool(shapes) and all(item.transparent for item in shapes),
        opening=opening.RelatingOpeningElement.GlobalId if opening else None,
        host=host.RelatingBuildingElement.GlobalId if host else None,
        parts=tuple(part.GlobalId for part in ifcopenshell.util.element.get_parts(entity)),
        overall_width=_metres(getattr(entity, "OverallWidth", None), unit) if role == "doors" else None,
        lining=_lining(entity, unit) if role == "doors" else None,
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


def _storeys(model: ifcopenshell.file, unit: float) -> Iterator[Storey]:
    for entity in _by_type(model, "IfcBuildingStorey"):
        placement = placement_of(entity, unit)
        elevation = placement[11] if placement else (_metres(entity.Elevation, unit) or 0.0)
        yield Storey(entity.GlobalId, entity.Name or entity.LongName or "", elevation)


def _application(model: ifcopenshell.file) -> str:
    names = (item.ApplicationFullName for item in _by_type(model, "IfcApplication"))
    return next((str(name) for name in names if name), "")


def _left_out(model: ifcopenshell.file, owners: dict[int, int]) -> dict[str, int]:
    chosen = {*owners, *(item.id() for item in _by_type(model, "IfcOpeningElement"))}
    counts = Counter(
        entity.is_a()
        for entity in _by_type(model, "IfcProduct")
        if entity.id() not in chosen and not any(is_a(entity, name) for name in UNSEEN)
    )
    return dict(sorted(counts.items()))
