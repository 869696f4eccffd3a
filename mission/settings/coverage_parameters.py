"""Parameters of coverage: what the stops must see, how well, and how firmly scans register."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from stopgo.mission.settings.parameter import Pair, Parameter, millimetres

LEAST_FRACTION = 0.7
"""Of every room and kind: the most that cost at most one stop on small floors and 5 % on a large one."""
INCIDENCE = 80.0
"""At this angle 5 cm of a wall 5 m away measure 0.1° from the scanner, which is the step of a coarse scan."""
ANY_INCIDENCE = 90.0
OVERLAP_RANGE_M = 20.0
"""Scanners reach much farther than the range within which targets are seen well enough."""

_plan = partial(Parameter, "plan", group="Quality")
_fraction = partial(_plan, least=0, most=1, why="0.7 is 70 %", undecided=f"{LEAST_FRACTION:g}; none by units")
_limit = partial(_plan, quiet=True)


@dataclass(frozen=True, kw_only=True)
class CoverageParameters:
    """Table `plan`: coverage, limits of a measurement, and overlap."""

    minimise: Annotated[
        Literal["stops", "time"],
        _plan(
            "Objective: fewest stops, then the shortest route; or least time",
            quiet=True,
        ),
    ] = "stops"
    coverage: Annotated[
        float,
        _plan("Minimum fraction of all that is visible", first=True, above=0, most=1, why="0.9 is 90 %"),
    ] = 0.9
    room_coverage: Annotated[float | None, _fraction("Minimum fraction in each room")] = None
    kind_coverage: Annotated[float | None, _fraction("Minimum fraction of each kind of element")] = None
    views: Annotated[
        int | None,
        _plan(
            "Stops that must see each target", least=1, most=20, undecided="1", quiet=True, word="min_views"
        ),
    ] = None
    max_incidence: Annotated[
        float | None,
        _plan(
            "Maximum angle from the surface normal; 90 is any",
            "degrees",
            group="Scanner",
            above=0,
            most=ANY_INCIDENCE,
            undecided=f"{INCIDENCE:g}; any with --coverage-rule paper",
        ),
    ] = None
    density: Annotated[
        float | None,
        _limit("Maximum point spacing on a target, by angular_step", "mm", group="Scanner", above=0),
    ] = None
    wall_height: Annotated[
        float | None,
        _limit(
            "Height up to which these limits hold",
            "m",
            group="Scanner",
            above=0,
            below=50,
            undecided="scanner_height only",
        ),
    ] = None
    coverage_rule: Annotated[
        Literal["length", "paper"],
        _plan(
            "Coverage by metres of each room and kind; or by units of the whole, as in the paper",
            group="Paper",
        ),
    ] = "length"
    register: Annotated[
        bool | None,
        _plan(
            "Choose stops whose scans register with one another, all in one network",
            undecided="yes; no with --coverage-rule paper",
        ),
    ] = None
    overlap: Annotated[
        float | None,
        _plan(
            "Minimum overlap ratio of scans that register",
            least=0,
            below=1,
            why="0.1 is 10 %",
            undecided="0",
            quiet=True,
        ),
    ] = None
    accuracy: Annotated[
        float | None,
        _plan(
            "Maximum predicted position error of every registered scan, with a probability of 0.99",
            "mm",
            above=0,
            form="LENGTH",
            example="5mm",
            read=millimetres,
            quiet=True,
        ),
    ] = None
    control: Annotated[
        tuple[Pair, ...],
        _plan(
            "Control point: a target with known coordinates", "m", form="X,Y", example="2.5,3.0", quiet=True
        ),
    ] = ()
    overlap_range: Annotated[
        float | None,
        _plan(
            "Maximum distance of boundary that counts for overlap", "m", above=0, undecided="20", quiet=True
        ),
    ] = None

    @property
    def least_of_room(self) -> float | None:
        """Least fraction of what is visible of each room; None where none is required."""
        return self._least(self.room_coverage)

    @property
    def least_of_kind(self) -> float | None:
        """Least fraction of what is visible of each kind of element; None where none is required."""
        return self._least(self.kind_coverage)

    def _least(self, given: float | None) -> float | None:
        if self.coverage_rule == "paper":
            return None
        return LEAST_FRACTION if given is None else given

    @property
    def most_incidence(self) -> float | None:
        """Largest angle from the surface normal at which a target counts, in degrees; None for any."""
        default = ANY_INCIDENCE if self.coverage_rule == "paper" else INCIDENCE
        most = default if self.max_incidence is None else self.max_incidence
        return None if most == ANY_INCIDENCE else most

    @property
    def registers(self) -> bool:
        """True if stops are chosen so that their scans register."""
        return self.coverage_rule != "paper" if self.register is None else self.register

    @property
    def least_overlap(self) -> float:
        """Least fraction of a scan that a scan which registers with it covers too."""
        return self.overlap or 0.0

    @property
    def farthest_overlap(self) -> float:
        """Farthest boundary that counts for overlap, metres."""
        return OVERLAP_RANGE_M if self.overlap_range is None else self.overlap_range

    @property
    def least_views(self) -> int:
        """Number of stops that must see a target before it counts."""
        return 1 if self.views is None else self.views
