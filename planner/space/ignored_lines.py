"""Lines of a drawing that are not read, where legs cross them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.floor import Finding, FloorPlan
from stopgo.mission.settings.layer_kinds import layer_option
from stopgo.mission.stages.figures import LEG_OVER_IGNORED
from stopgo.planner.geometry.shapes import first_corner, local_origin


def over_ignored(
    floor: FloorPlan, legs: Sequence[BaseGeometry], *, stops: int, radius: float
) -> Iterator[Finding]:
    """Layers with lines that are not read, where a robot of this radius would drive over or into them.

    Legs are in the local frame; those beyond the first `stops` lead back.
    """
    origin = local_origin(floor)
    swept = [leg.buffer(radius) for leg in legs]
    tree = shapely.STRtree(swept)
    by_layer: dict[str, list[BaseGeometry]] = {}
    for line in floor.ignored:
        by_layer.setdefault(line.layer, []).append(shapely.LineString(line.points - origin))
    for layer, lines in sorted(by_layer.items()):
        line, leg = tree.query(lines, predicate="intersects")
        if len(leg):
            first = int(np.lexsort((line, leg))[0])
            at = first_corner(lines[line[first]].intersection(swept[leg[first]]), origin)
            names = _named(sorted(set(leg.tolist())), stops)
            message = (
                f"the robot drives over lines on layer {layer}, which are not read: {names} "
                f"(first at {at[0]:.2f}, {at[1]:.2f}); state their kind: {layer_option(layer)}, "
                f"or {layer_option(layer, 'ignore')} if nothing is there"
            )
            yield Finding(LEG_OVER_IGNORED, message, at=at)


def _named(legs: Sequence[int], stops: int) -> str:
    names = [f"to stop {k + 1}" if k < stops else "back" for k in legs]
    more = f" and {len(names) - 4} more" if len(names) > 4 else ""
    return f"leg{'s' * (len(names) > 1)} {', '.join(names[:4])}{more}"
