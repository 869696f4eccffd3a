"""Small building models, made box by box: every number of the tests can be checked on paper."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import ifcopenshell.api.aggregate
import ifcopenshell.api.context
import ifcopenshell.api.feature
import ifcopenshell.api.geometry
import ifcopenshell.api.owner
import ifcopenshell.api.owner.settings
import ifcopenshell.api.project
import ifcopenshell.api.root
import ifcopenshell.api.spatial
import ifcopenshell.api.unit
import ifcopenshell.guid
import ifcopenshell.util.shape_builder
import numpy as np

Box = tuple[float, float, float, float, float, float]
"""x0, y0, z0, x1, y1, z1 in metres."""


@dataclass
class House:
    """A model under construction; lengths in metres."""

    schema: str = "IFC4"
    written: str = ""
    """A model that was built before, as text, to go on from; its products are in `things` again."""
    model: Any = field(init=False)
    things: dict[str, Any] = field(default_factory=dict)
    """Products by the names that the tests give them."""

    def __post_init__(self) -> None:
        if self.written:
            self._go_on()
        else:
            self._begin()

    def _go_on(self) -> None:
        """Parse the model, which takes a hundredth of building it; its project is a new one."""
        self.model = ifcopenshell.file.from_string(self.written)
        (project,) = self.model.by_type("IfcProject")
        project.GlobalId = ifcopenshell.guid.new()
        self._signed_by(
            *self.model.by_type("IfcPersonAndOrganization"), *self.model.by_type("IfcApplication")
        )
        (self._body,) = self.model.by_type("IfcGeometricRepresentationSubContext")
        self._context = self._body.ParentContext
        (self.site,), (self.building,) = self.model.by_type("IfcSite"), self.model.by_type("IfcBuilding")
        self.things = {thing.Name: thing for thing in self.model.by_type("IfcProduct")}

    def _begin(self) -> None:
        self.model = ifcopenshell.api.project.create_file(version=self.schema)
        self._sign()
        project = self._make("IfcProject", "project")
        length = ifcopenshell.api.unit.add_si_unit(self.model, unit_type="LENGTHUNIT")
        ifcopenshell.api.unit.assign_unit(self.model, units=[length])
        self._context = ifcopenshell.api.context.add_context(self.model, context_type="Model")
        self._body = ifcopenshell.api.context.add_context(
            self.model,
            context_type="Model",
            context_identifier="Body",
            target_view="MODEL_VIEW",
            parent=self._context,
        )
        self.site, self.building = self._make("IfcSite", "site"), self._make("IfcBuilding", "building")
        for whole, part in ((project, self.site), (self.site, self.building)):
            ifcopenshell.api.aggregate.assign_object(self.model, relating_object=whole, products=[part])

    def _sign(self) -> None:
        """IFC2X3 asks who has made it."""
        model, owner = self.model, ifcopenshell.api.owner
        person, firm = owner.add_person(model), owner.add_organisation(model)
        user = owner.add_person_and_organisation(model, person=person, organisation=firm)
        self._signed_by(user, owner.add_application(model, application_developer=firm))

    def _signed_by(self, user: Any, application: Any) -> None:
        model, owner = self.model, ifcopenshell.api.owner
        owner.settings.get_user = lambda file: user if file is model else None
        owner.settings.get_application = lambda file: application if file is model else None

    def _make(self, kind: str, name: str) -> Any:
        return ifcopenshell.api.root.create_entity(self.model, ifc_class=kind, name=name)

    def storey(self, name: str, z: float) -> Any:
        """A storey whose level is at z."""
        storey = self._make("IfcBuildingStorey", name)
        storey.Elevation = z
        self._place(storey, (0, 0, z))
        ifcopenshell.api.aggregate.assign_object(self.model, relating_object=self.building, products=[storey])
        return storey

    def box(
        self, kind: str, name: str, box: Box, storey: Any = None, *, aside: float = 0.0, **said: Any
    ) -> Any:
        """A box, placed at its lowest corner; its top is moved by `aside` metres along x."""
        thing = self._make(kind, name)
        for key, value in said.items():
            setattr(thing, key, value)
        self._place(thing, box[:3])
        size = np.subtract(box[3:], box[:3])
        self._shape(thing, size, aside)
        if kind == "IfcSpace":
            ifcopenshell.api.aggregate.assign_object(self.model, relating_object=storey, products=[thing])
        elif storey is not None:
            ifcopenshell.api.spatial.assign_container(self.model, relating_structure=storey, products=[thing])
        self.things[name] = thing
        return thing

    def _place(self, thing: Any, at: Any) -> None:
        matrix = np.eye(4)
        matrix[:3, 3] = at
        ifcopenshell.api.geometry.edit_object_placement(self.model, product=thing, matrix=matrix)

    def _shape(self, thing: Any, size: Any, aside: float = 0.0) -> None:
        x, y, z = (float(value) for value in size)
        corners = [(i * x + k * aside, j * y, k * z) for k in (0, 1) for j in (0, 1) for i in (0, 1)]
        faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
        made = ifcopenshell.api.geometry.add_mesh_representation(
            self.model, context=self._body, vertices=[corners], faces=[faces]
        )
        ifcopenshell.api.geometry.assign_representation(self.model, product=thing, representation=made)

    def door(self, name: str, wall: Any, box: Box, storey: Any) -> Any:
        """A door that fills a box-shaped opening in a wall; it hangs in the middle of the opening's depth."""
        opening = self._make("IfcOpeningElement", f"opening of {name}")
        self._place(opening, box[:3])
        self._shape(opening, np.subtract(box[3:], box[:3]))
        ifcopenshell.api.feature.add_feature(self.model, feature=opening, element=wall)
        x0, y0, z0, x1, y1, z1 = box
        wide = x1 - x0 > y1 - y0
        middle = ((y0 + y1) if wide else (x0 + x1)) / 2
        leaf = (x0, middle - 0.02, z0, x1, middle + 0.02, z1)
        across = (middle - 0.02, y0, z0, middle + 0.02, y1, z1)
        door = self.box("IfcDoor", name, leaf if wide else across, storey)
        door.OverallWidth = max(x1 - x0, y1 - y0)
        ifcopenshell.api.feature.add_filling(self.model, opening=opening, element=door)
        return door

    def write(self, path: Path) -> Path:
        """The model as a file."""
        self.model.write(str(path))
        return path


def two_rooms(schema: str = "IFC4", *, spaces: bool = True, slab: bool = True) -> House:
    """The house of `_two_rooms`, for a test to change; it is built once."""
    return House(schema, _two_rooms(schema, spaces, slab))


@cache
def _two_rooms(schema: str, spaces: bool, slab: bool) -> str:
    """A storey `EG` of 8.2 × 4.4 m at z = 0: two rooms of 3.8 × 4 m, a wall between with a door of 0.9 m.

    Outer walls are 0.2 m thick and 2.8 m high, a column of 0.4 m stands in the left room, a beam hangs over
    the right one, the south wall has a window sill 0.9 m high from x = 5 to 7. `OG` lies at z = 3.
    """
    house = House(schema)
    ground, upper = house.storey("EG", 0.0), house.storey("OG", 3.0)
    if slab:
        house.box("IfcSlab", "slab", (0, 0, -0.2, 8.2, 4.4, 0), ground)
        house.box("IfcSlab", "ceiling", (0, 0, 2.8, 8.2, 4.4, 3), upper)
    for name, box in (
        ("south", (0, 0, 0, 8.2, 0.2, 2.8)),
        ("north", (0, 4.2, 0, 8.2, 4.4, 2.8)),
        ("west", (0, 0.2, 0, 0.2, 4.2, 2.8)),
        ("east", (8.0, 0.2, 0, 8.2, 4.2, 2.8)),
        ("middle", (4.0, 0.2, 0, 4.2, 4.2, 2.8)),
    ):
        house.box("IfcWall", name, box, ground)
    opening = (5, -0.1, 0.9, 7, 0.3, 2.1)
    hole = house.box("IfcOpeningElement", "window opening", opening)
    ifcopenshell.api.feature.add_feature(house.model, feature=hole, element=house.things["south"])
    house.box("IfcWindow", "window", (5, 0.08, 0.9, 7, 0.12, 2.1), ground)
    house.box("IfcColumn", "column", (1.8, 2.0, 0, 2.2, 2.4, 2.8), ground)
    house.box("IfcBeam", "beam", (4.2, 2.0, 2.4, 8.0, 2.3, 2.8), ground)
    house.door("door", house.things["middle"], (3.9, 1.0, 0, 4.3, 1.9, 2.1), ground)
    if spaces:
        house.box("IfcSpace", "left", (0.2, 0.2, 0, 4.0, 4.2, 2.8), ground)
        house.box("IfcSpace", "right", (4.2, 0.2, 0, 8.0, 4.2, 2.8), ground)
    return str(house.model.to_string())
