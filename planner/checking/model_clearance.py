"""Mission + bodies of its model -> stops and legs nearer to a body than the plan promises.

The bodies are the model's own triangles: an error of the sections that planning uses shows here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from stopgo.mission.document import Mission
from stopgo.mission.document.problems import Problem
from stopgo.mission.settings import Settings
from stopgo.planner.floors.standing_body import StandingBody

SECTION_GRAIN = 2e-3
"""Metres by which the sections of a model may differ from its bodies."""


def too_near(mission: Mission, bodies: Sequence[StandingBody], settings: Settings) -> Iterator[Problem]:
    """Stops and legs within a body, or nearer to it than their clearance."""
    if not bodies:
        return
    around = _Bodies(bodies)
    radius = max(settings.radius, mission.robot.radius)
    for index, stop in enumerate(mission.stops):
        path, name = f"$.stops[{index}]", f"{stop.id} at ({stop.x:.3f}, {stop.y:.3f})"
        clearance = radius if stop.doorway else max(settings.d_sec, radius)
        yield from around.problem(path, name, [(stop.x, stop.y)], clearance)
        yield from around.problem(f"{path}.approach", f"the leg to {stop.id}", stop.approach, radius)
    yield from around.problem("$.return", "the leg back", mission.return_ or (), radius)


class _Bodies:
    """Faces of all bodies, for the nearest one to a line."""

    def __init__(self, bodies: Sequence[StandingBody]) -> None:
        self.bodies = bodies
        self._owner = np.repeat(np.arange(len(bodies)), [len(body.faces) for body in bodies])
        self._tree = shapely.STRtree([face for body in bodies for face in body.faces])

    def problem(
        self, path: str, name: str, points: Sequence[tuple[float, float]], clearance: float
    ) -> Iterator[Problem]:
        """The shortfall of a point's or a line's clearance, if there is one."""
        if not points:
            return
        for body in self.bodies:
            if any(body.encloses(*point) for point in points):
                yield Problem(path, f"{name} lies within {body.name} of the model")
                return
        line = shapely.Point(points[0]) if len(set(points)) == 1 else shapely.LineString(points)
        near = self._tree.query(line, predicate="dwithin", distance=clearance - SECTION_GRAIN)
        if len(near):
            distances = shapely.distance(line, self._tree.geometries[near])
            worst = int(np.argmin(distances))
            body = self.bodies[int(self._owner[near[worst]])]
            text = f"{name} is {distances[worst]:.3f} m from {body.name} of the model"
            yield Problem(path, f"{text}, less than {clearance:.3f} m")
