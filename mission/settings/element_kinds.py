"""The kinds of elements of a floor, and their roles for the laser and the robot."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Kind:
    """Role of an element for the laser and the robot."""

    name: str
    occludes: bool
    obstacle: bool
    target: bool


KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind("walls", occludes=True, obstacle=True, target=True),
        Kind("columns", occludes=True, obstacle=True, target=True),
        Kind("beams", occludes=False, obstacle=False, target=True),
        Kind("stairs", occludes=True, obstacle=True, target=False),
        Kind("windows", occludes=False, obstacle=True, target=False),
        Kind("railings", occludes=False, obstacle=True, target=False),
        Kind("objects", occludes=True, obstacle=True, target=False),
        Kind("other", occludes=False, obstacle=True, target=False),
    )
}
"""Every element kind with its defaults.

`objects` is furniture, equipment and the like of a model, as high as the scanner; `other` is a closed shape
on an unknown layer, and an object that the scanner sees over.
"""
