"""Kinds that the user gives classes of a model: `IfcFurniture=ignore`, `IfcWall.PARTITIONING=walls`."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from stopgo.mission.errors import InputError
from stopgo.mission.floor import Finding
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.planner.floors.ifc.model import Model, Product
from stopgo.planner.floors.reader import FloorOptions

IGNORED = "ignore"
"""Role of products that the user leaves out."""
ROLE_OF_KIND = {
    **{kind: kind for kind in KINDS},
    **{"floor": "slabs", "rooms": "spaces", "objects": "furniture", "furniture": "furniture"},
    IGNORED: IGNORED,
}
"""Role in a plan of each kind that a class can be given; a door needs what only IfcDoor has."""


def with_given_kinds(model: Model, options: FloorOptions, path: Path) -> Model:
    """Return the model whose products have the roles that the options give their classes.

    Raises
    ------
    InputError
        When an option names no class of the model, or a kind that a class cannot be given.
    """
    given = {**options.layer_map, **options.layers}
    if not given and options.furniture != IGNORED:
        return model
    products = model.described.products
    unknown = sorted(set(given) - {name for item in products for name in _names(item)})
    if unknown:
        raise InputError(
            f"{path}: --layer {unknown[0]}: no element of this class; classes: "
            f"{', '.join(sorted({item.ifc_class for item in products}))}"
        )
    for name, kind in given.items():
        if kind not in ROLE_OF_KIND:
            known = ", ".join(ROLE_OF_KIND)
            raise InputError(
                f"{path}: --layer {name}={kind}: not a kind for a class of a model; known: {known}"
            )
    changed = tuple(_with_kind(item, given, options) for item in products)
    return Model(replace(model.described, products=changed), model.vertices, model.faces)


def _names(product: Product) -> tuple[str, ...]:
    """Names that choose a product, the narrowest first, in capitals."""
    name = product.ifc_class.upper()
    whole = name.removesuffix("STANDARDCASE")
    return tuple(
        dict.fromkeys(
            (f"{name}.{product.predefined.upper()}", f"{whole}.{product.predefined.upper()}", name, whole)
        )
    )


def _with_kind(product: Product, given: dict[str, str], options: FloorOptions) -> Product:
    kind = next((given[name] for name in _names(product) if name in given), None)
    if kind is not None:
        clear = product.transparent or kind == "other"
        return replace(product, role=ROLE_OF_KIND[kind], transparent=clear)
    if product.role == "furniture" and options.furniture == IGNORED:
        return replace(product, role=IGNORED)
    return product


def furniture_findings(model: Model, on_floor: set[str]) -> list[Finding]:
    """Findings on furniture of a floor: obstacles that may not stand there yet."""
    names = [
        item.ifc_class
        for item in model.described.products
        if item.global_id in on_floor and item.role == "furniture"
    ]
    if not names:
        return []
    counts = ", ".join(f"{names.count(name)} {name}" for name in sorted(set(names)))
    text = (
        f"{len(names)} objects of furniture and equipment are obstacles as modelled ({counts}); "
        "if they are not there yet: --furniture ignore, or --layer CLASS=ignore"
    )
    return [Finding("furniture", text)]
