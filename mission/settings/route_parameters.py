"""Parameters of the route: start and end, required stops, and division among robots or tours."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from stopgo.mission.settings.parameter import Pair, Parameter, seconds

Triple = tuple[float, float, float]

_plan = partial(Parameter, "plan", group="Route")


@dataclass(frozen=True, kw_only=True)
class RouteParameters:
    """Table `plan`: start, end, tour, robots and shift."""

    tour: Annotated[
        Literal["closed", "open"] | None,
        _plan("Return to the start, or not", undecided="closed if only start is given"),
    ] = None
    start: Annotated[
        Triple | None,
        _plan(
            "Start pose of the robot; with robots, once for all or once for each",
            "m and degrees counter-clockwise from +x",
            first=True,
            form="X,Y,HEADING",
            example="2.5,3.0,90",
            further="further_starts",
        ),
    ] = None
    further_starts: Annotated[
        tuple[Triple, ...] | None,
        _plan(
            "Start poses of the second robot and those after it",
            "m and degrees",
            group="Fleet",
            form="X,Y,HEADING",
            example="2.5,3.0,90",
            option="start",
            quiet=True,
        ),
    ] = None
    robots: Annotated[
        int | None,
        _plan(
            "Number of robots that divide the floor, a mission each",
            group="Fleet",
            first=True,
            least=1,
            most=50,
            undecided="1",
            quiet=True,
        ),
    ] = None
    shift: Annotated[
        float | None,
        _plan(
            "Maximum duration of a tour until it is back at its start",
            "s",
            group="Fleet",
            above=0,
            form="DURATION",
            example="1800, 30min or 1h30min",
            read=seconds,
            quiet=True,
        ),
    ] = None
    end: Annotated[Pair | None, _plan("End of the route", "m", form="X,Y", example="2.5,3.0")] = None
    use: Annotated[
        tuple[Pair, ...],
        _plan("Position that must be a stop", "m", form="X,Y", example="2.5,3.0", word="require_stop"),
    ] = ()
    avoid: Annotated[
        tuple[Triple, ...], _plan("Circle without stops", "m", form="X,Y,RADIUS", example="2.5,3.0,1")
    ] = ()

    @property
    def starts(self) -> tuple[Triple, ...]:
        """Every start that is given."""
        return () if self.start is None else (self.start, *(self.further_starts or ()))
