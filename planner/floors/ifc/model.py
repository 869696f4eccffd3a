"""A building model without its schema: products with their meshes, storeys, and what is dated in it."""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from functools import cached_property

import msgspec
import numpy as np

from stopgo.mission.document.decoding import decoded
from stopgo.mission.geometry import FloatArray, IntArray

Placement = tuple[float, ...]
"""A local placement in the world, metres: 4 × 4 numbers, row by row."""


class Storey(msgspec.Struct, frozen=True):
    """A storey as the model names it."""

    global_id: str
    name: str
    elevation: float
    """Of its placement, metres."""


class Task(msgspec.Struct, frozen=True):
    """Days of work on a product, as YYYY-MM-DD."""

    name: str
    start: str | None = None
    finish: str | None = None
    removes: bool = False
    """Demolition or removal: the product is there until then."""
    source: str = ""
    """Where the model says so, such as `IfcTask`."""


class Product(msgspec.Struct, frozen=True, kw_only=True):
    """A thing in a model: where its mesh lies in the arrays, and what it says of itself."""

    global_id: str
    name: str
    ifc_class: str
    role: str
    """Role in a plan: a kind, or slabs, roofs, coverings, members, spaces, doors, openings."""
    predefined: str = ""
    storey: str | None = None
    """GlobalId of the storey it is contained in."""
    placement: Placement | None = None
    vertices: tuple[int, int] = (0, 0)
    """First and last + 1 of its rows in `Model.vertices`."""
    faces: tuple[int, int] = (0, 0)
    transparent: bool = False
    opening: str | None = None
    """Of a door or window: GlobalId of the opening it fills."""
    host: str | None = None
    """Of an opening: GlobalId of what it is cut out of."""
    parts: tuple[str, ...] = ()
    """GlobalIds of what it is assembled of."""
    overall_width: float | None = None
    """Of a door, metres; nominal, with the frame."""
    lining: float | None = None
    """Of a door: thickness of the frame on one side, metres."""
    tasks: tuple[Task, ...] = ()
    phases: tuple[str, str] = ("", "")
    """The phases that make and remove it; they have no days of their own."""


class OnEarth(msgspec.Struct, frozen=True, kw_only=True):
    """Georeference data of a model, unchanged."""

    eastings: float | None = None
    northings: float | None = None
    height: float | None = None
    abscissa: float | None = None
    """East part of the direction of the model's +x in the map's grid."""
    ordinate: float | None = None
    scale: float | None = None
    crs: str | None = None
    map_unit_m: float | None = None
    """Metres in the map's unit, where the model names it."""
    said_by: str = ""
    """The entity or property set that holds the map conversion."""
    latitude: float | None = None
    longitude: float | None = None
    elevation: float | None = None
    true_north: tuple[float, float] | None = None
    """Direction of north in the model's plane."""
    site: Placement | None = None


class Described(msgspec.Struct, frozen=True, kw_only=True):
    """All of a model but its meshes."""

    schema: str
    unit_m: float
    application: str
    storeys: tuple[Storey, ...]
    products: tuple[Product, ...]
    place: OnEarth
    left_out: dict[str, int]
    """Products by class that no plan is made of, such as furniture."""
    failed: tuple[str, ...] = ()
    """Products whose geometry could not be made, in words."""
    bodiless: tuple[str, ...] = ()
    """Products that the model gives no body, in words."""
    boxed: tuple[str, ...] = ()
    """Products that are shown as the box around their points, in words."""
    uncut: tuple[str, ...] = ()
    """Products whose shape could be made only without the openings cut out of it, in words."""
    damage: tuple[str, ...] = ()
    """Parts of the file that could not be read, in the library's words."""
    crashed: tuple[str, ...] = ()
    """Products at which the geometry kernel crashed, in words."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of one product in the world, metres."""

    vertices: FloatArray
    """(n, 3)."""
    faces: IntArray
    """(m, 3)."""

    @cached_property
    def triangles(self) -> FloatArray:
        """(m, 3, 3)."""
        return np.asarray(self.vertices)[np.asarray(self.faces)]

    @cached_property
    def z(self) -> tuple[float, float]:
        """Lowest and highest point."""
        if not len(self.vertices):
            return (np.inf, -np.inf)
        heights = self.vertices[:, 2]
        return (float(heights.min()), float(heights.max()))


@dataclass(frozen=True, eq=False)
class Model:
    """A building model: what it says, and the meshes of its products."""

    described: Described
    vertices: FloatArray
    faces: IntArray

    @cached_property
    def products(self) -> dict[str, Product]:
        """Products by GlobalId."""
        return {product.global_id: product for product in self.described.products}

    @cached_property
    def meshes(self) -> dict[str, Surface]:
        """Meshes by GlobalId of the products that have one."""
        return {item.global_id: self._mesh(item) for item in self.described.products if item.faces[1]}

    def _mesh(self, product: Product) -> Surface:
        return Surface(self.vertices[slice(*product.vertices)], self.faces[slice(*product.faces)])

    def of_role(self, *roles: str) -> list[tuple[Product, Surface]]:
        """Products of these roles that have a mesh, with it, in the order of their GlobalIds."""
        return [(item, self.meshes[item.global_id]) for item in self._by_role(roles)]

    def _by_role(self, roles: tuple[str, ...]) -> list[Product]:
        found = [item for item in self.described.products if item.role in roles and item.faces[1]]
        return sorted(found, key=lambda item: item.global_id)


def packed(model: Model) -> bytes:
    """A model as bytes that `unpacked` reads."""
    out = io.BytesIO()
    said = np.frombuffer(msgspec.json.encode(model.described), np.uint8)
    np.savez(out, said=said, vertices=model.vertices, faces=model.faces)
    return out.getvalue()


def unpacked(data: bytes) -> Model:
    """The model in bytes of `packed`.

    Raises
    ------
    ValueError
        When they are not whole, or of another version.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            said = decoded(arrays["said"].tobytes(), Described)
            return Model(said, arrays["vertices"], arrays["faces"])
    except (OSError, EOFError, KeyError, zipfile.BadZipFile, msgspec.MsgspecError) as error:
        raise ValueError(f"no packed model: {error}") from None
