"""Parameters of space and candidates: clearances, doors, targets, and where stops are offered."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from stopgo.mission.settings.element_kinds import KINDS
from stopgo.mission.settings.layer_kinds import kinds_by_name
from stopgo.mission.settings.parameter import Parameter, words

_plan = partial(Parameter, "plan", group="Paper")


@dataclass(frozen=True, kw_only=True)
class SpaceParameters:
    """Table `plan`: clearances, openings, targets and candidates."""

    d_sec: Annotated[
        float,
        _plan("Minimum distance stop to element", "m", group="Robot", first=True, least=0, word="clearance"),
    ] = 0.7
    d_dis: Annotated[
        float, _plan("Length of a target unit", "m", least=1e-3, why="units below 1 mm are not planned")
    ] = 0.05
    grid: Annotated[
        float, _plan("Spacing of grid candidates", "m", least=0.05, why="less than 5 cm is not planned")
    ] = 1.0
    # The paper gives no value for the next three: ours come closest to its Table 3.
    d_max: Annotated[
        float,
        _plan(
            "Maximum length of a seed segment of triangulation",
            "m",
            least=0.05,
            why="less than 5 cm is not planned",
        ),
    ] = 1.6
    l_min: Annotated[float, _plan("Minimum side of a triangle", "m", least=0)] = 2.6
    dens_min: Annotated[float, _plan("Minimum candidates of a room", "per m²", least=0)] = 0.25
    door_access: Annotated[
        float,
        _plan("Minimum clear width of a door or opening", "m", group="Robot", above=0, word="min_door_width"),
    ] = 0.7
    edge: Annotated[
        float,
        _plan(
            "Minimum distance of stops and legs from floor edges and holes",
            "m",
            group="Robot",
            least=0,
            word="edge_clearance",
        ),
    ] = 0.35
    doors: Annotated[Literal["open", "closed"], _plan("Doors for the laser", group="Floor")] = "open"
    targets: Annotated[
        tuple[str, ...] | None,
        _plan(
            "Kinds to scan",
            group="Quality",
            first=True,
            undecided=",".join(kind.name for kind in KINDS.values() if kind.target),
            form="kinds",
            example="walls,columns",
            read=words,
            known=tuple(KINDS),
        ),
    ] = None
    layers: Annotated[
        tuple[str, ...],
        _plan(
            "Kind of a layer",
            group="Floor",
            form="NAME=KIND",
            example="A-WALL=walls or DIM=ignore",
            read=str,
            option="layer",
        ),
    ] = ()

    @property
    def layer_roles(self) -> dict[str, str]:
        """Kind of element of each layer that the user names, by the layer's name in capitals."""
        return kinds_by_name(self.layers)
