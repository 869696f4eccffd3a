"""Shapes of entities as a geometry kernel makes them, in the world and in metres."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

import ifcopenshell
import ifcopenshell.geom
import numpy as np

Kernel = Literal["hybrid-cgal-simple-opencascade", "opencascade", "manifold"]
KERNEL: Final = "hybrid-cgal-simple-opencascade"
CUTTER: Final = "manifold"
"""Cuts openings at a tenth of the time; makes some other shapes wrong, and may crash on open surfaces."""
CLEAR = 0.3
"""A style that lets more than this share of light through is glass."""
LARGEST = 1e7
"""Metres from the origin beyond which nothing is built."""


@dataclass(frozen=True, eq=False)
class Made:
    """The shape of one entity, in the world, metres."""

    number: int
    """The entity's number in the file."""
    points: np.ndarray
    corners: np.ndarray
    transparent: bool = False
    way: str = ""
    """Empty if the kernel made it at once, else a key of WAYS or BOX."""


def settings_of(*, with_openings: bool = True, with_cuts: bool = True, in_world: bool = True) -> Any:
    """Settings of a kernel."""
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", in_world)
    settings.set("disable-opening-subtractions", not with_openings)
    settings.set("disable-boolean-result", not with_cuts)
    return settings


def iterated(
    model: ifcopenshell.file, entities: list[Any], settings: Any, kernel: Kernel = KERNEL
) -> Iterator[Made]:
    """The sound shapes of entities by a kernel."""
    if not entities:
        return
    iterator = ifcopenshell.geom.iterator(settings, model, 1, include=entities, geometry_library=kernel)
    there = bool(iterator.initialize())
    while there:
        show_progress(iterator.progress())
        shape = iterator.get()
        made = made_of(shape.id, shape)
        if is_sound(made):
            yield made
        there = bool(iterator.next())


def made_of(number: int, shape: Any) -> Made:
    """An entity's shape in the world."""
    geometry = shape.geometry
    local = np.frombuffer(geometry.verts_buffer, dtype=np.float64).reshape(-1, 3)
    placement = np.array(shape.transformation.matrix).reshape(4, 4).T  # the identity for shapes in the world
    points = np.einsum("ij,nj->ni", placement[:3, :3], local) + placement[:3, 3]
    corners = np.frombuffer(geometry.faces_buffer, dtype=np.int32).reshape(-1, 3).astype(np.int64)
    clear = bool(geometry.materials) and all(item.transparency > CLEAR for item in geometry.materials)
    return Made(number, points, corners, transparent=clear)


def show_progress(percent: int) -> None:
    """Show on a terminal how much of a model is made."""
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\033[Kmodel {percent} %" if percent < 100 else "\r\033[K")
        sys.stderr.flush()


def is_sound(made: Made) -> bool:
    """True if a shape has triangles, none of them farther away than anything built."""
    points = made.points
    return bool(len(made.corners)) and bool(np.isfinite(points).all()) and np.abs(points).max() <= LARGEST
