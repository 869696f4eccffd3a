"""Parameters of the method: the variant that carries out each stage."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from stopgo.mission.settings.parameter import Parameter

_plan = partial(Parameter, "plan", group="Paper")


@dataclass(frozen=True, kw_only=True)
class MethodParameters:
    """Table `plan`: variants of the stages."""

    candidates: Annotated[str, _plan("grid, triangulation, or module:function")] = "grid"
    visibility: Annotated[str, _plan("exact or bresenham")] = "exact"
    selector: Annotated[str, _plan("default, greedy, exact, or anywhere", group="Quality")] = "default"
    router: Annotated[str, _plan("default or aco (the paper's ant colony)")] = "default"
    graph: Annotated[str, _plan("exact, or grid (the paper's room grids)")] = "exact"
    den_grid_min: Annotated[float, _plan("Minimum nodes of a room's grid", "per m²", least=0)] = 0.5
    max_err_dist: Annotated[
        float, _plan("Maximum distance of a stop from its node in the grid", "m", above=0)
    ] = 0.5
