"""The kinds of elements of a floor: roles for the laser and the robot, and looks in every picture."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Kind:
    """Role of an element for the laser and the robot, and its looks."""

    name: str
    occludes: bool
    obstacle: bool
    target: bool
    colour: str
    """Colour of its lines and its faces, `#rrggbb`: readable on white paper and on a dark screen."""
    fill: str
    """Colour of its area on white paper; `none` for what is overhead, which is drawn dashed."""

    @property
    def rgb(self) -> tuple[int, int, int]:
        red, green, blue = bytes.fromhex(self.colour[1:])
        return (red, green, blue)


KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind("walls", True, True, True, "#7d828c", "#a9acb3"),
        Kind("columns", True, True, True, "#c26a1b", "#c26a1b"),
        Kind("beams", False, False, True, "#a065d6", "none"),
        Kind("stairs", True, True, False, "#178f82", "#d3eae7"),
        Kind("windows", False, True, False, "#3c8bd0", "#d4e6f6"),
        Kind("railings", False, True, False, "#6a70cc", "#e1e3f6"),
        Kind("objects", True, True, False, "#a5813c", "#efe6d3"),
        Kind("other", False, True, False, "#8f7a63", "#ebe5de"),
    )
}
"""Every element kind with its defaults: name, occludes, obstacle, target, colour, fill.

`objects` is furniture, equipment and the like of a model, as high as the scanner; `other` is a closed shape
on an unknown layer, and an object that the scanner sees over.
"""


def kind_of(name: str) -> Kind:
    """Return the kind; an unknown name counts as `other`."""
    return KINDS.get(name, KINDS["other"])
