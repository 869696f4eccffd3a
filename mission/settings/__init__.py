"""Every parameter of a plan, declared once: type, default, unit, limits, and what it is for.

From this declaration plan.toml is read and printed, `stopgo plan` has its options, and values are checked:
a new parameter is one more field of `Settings`, and nothing else.
Names are those of the options with underscores. What a person types is metres, seconds and degrees, as here;
docs/background/planning.md tells what each one does.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Annotated, Any, Literal, get_type_hints

from stopgo.mission.errors import InputError
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.mission.settings.layer_kinds import check_entries, entries_in, kinds_by_name
from stopgo.mission.settings.parameter import Parameter, seconds, words
from stopgo.mission.settings.scanners import SCANNERS, ScannerName

LEAST_SHARE = 0.7
"""Of every room and kind: the most that cost at most one stop on small floors and 5 % on a large one."""
_floor, _plan, _robot, _scanner, _policy = (
    partial(Parameter, table) for table in ("floor", "plan", "robot", "scanner", "policy")
)
_share = partial(_plan, least=0, most=1, why="0.7 is 70 %", undecided=f"{LEAST_SHARE:g}; none by units")
OVERLAP_RANGE_M = 20.0
"""Scanners reach much farther than the range within which targets are seen well enough."""
_limit = partial(_plan, quiet=True)

Pair = tuple[float, float]
Triple = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """All parameters of a plan. `None` means: decided from the others or from the floor.

    What is in the table `floor` tells the floor's reader what to read; it makes a floor another floor.
    """

    storey: Annotated[str | None, _floor("The model's storey, by name", undecided="its only one")] = None
    level: Annotated[float | None, _floor("Level of the floor in a model", "m", undecided="storey's")] = None
    scan_height: Annotated[
        float | None, _floor("Scanner above the floor of a model", "m", above=0, below=10, undecided="1.3")
    ] = None
    robot_height: Annotated[
        float | None, _floor("Robot's height", "m", above=0.1, below=10, undecided="scan_height")
    ] = None
    date: Annotated[str | None, _floor("Day whose construction status counts", "YYYY-MM-DD")] = None
    since: Annotated[str | None, _floor("Scan only what was finished after this day", "YYYY-MM-DD")] = None
    schedule: Annotated[str | None, _floor("CSV of GlobalIds with start and finish of their tasks")] = None
    schedule_columns: Annotated[
        tuple[str, ...],
        _floor(
            "Which column of the schedule is guid, task, start or finish",
            form="WHAT=COLUMN",
            example="guid=GlobalId",
            read=str,
            option="schedule_column",
        ),
    ] = ()
    in_progress: Annotated[
        Literal["obstacle", "target"] | None,
        _floor("What is being built: in the way only, or scanned too", undecided="obstacle"),
    ] = None
    units: Annotated[
        str | None, _floor("A drawing's unit, such as mm, m or inch", undecided="as it fits walls and doors")
    ] = None
    drawing: Annotated[
        int | None, _floor("Which of several drawings in a file, from 1", least=1, undecided="its only plan")
    ] = None
    region: Annotated[
        tuple[float, float, float, float] | None,
        _floor(
            "The part of a drawing to read, in its own unit",
            undecided="all",
            form="X0,Y0,X1,Y1",
            example="0,0,30,20",
            farthest=1e12,
        ),
    ] = None
    layer_map: Annotated[
        tuple[str, ...] | None,
        _floor(
            "What layers stand for, by a file of stopgo floors --write-map",
            form="FILE",
            example="layers.toml",
            read=entries_in,
            option="layers",
            undecided="by their names",
        ),
    ] = None
    candidates: Annotated[str, _plan("grid, triangulation, or module:function")] = "grid"
    visibility: Annotated[str, _plan("exact or bresenham")] = "exact"
    selector: Annotated[str, _plan("default, greedy, exact, or anywhere")] = "default"
    router: Annotated[str, _plan("default or aco (the paper's ant colony)")] = "default"
    graph: Annotated[str, _plan("exact, or grid (the paper's room grids)")] = "exact"
    den_grid_min: Annotated[float, _plan("Least nodes of a room's grid", "per m²", least=0)] = 0.5
    max_err_dist: Annotated[float, _plan("Stop to the grid's node that stands for it", "m", above=0)] = 0.5
    minimise: Annotated[
        Literal["stops", "time"],
        _plan(
            "What is made least: stops, then the way over them; or the mission's time",
            quiet=True,
        ),
    ] = "stops"
    coverage: Annotated[
        float, _plan("Least share of all that is visible", above=0, most=1, why="0.9 is 90 %")
    ] = 0.9
    room_coverage: Annotated[float | None, _share("Least share of what each room shows")] = None
    kind_coverage: Annotated[float | None, _share("Least share of each kind of element")] = None
    views: Annotated[
        int | None, _plan("Stops that must see a target", least=1, most=20, undecided="1", quiet=True)
    ] = None
    max_incidence: Annotated[
        float | None, _limit("Flattest ray that counts, from square on", "degrees", above=0, below=90)
    ] = None
    density: Annotated[
        float | None, _limit("Widest spacing of points on a target, by angular_step", "mm", above=0)
    ] = None
    wall_height: Annotated[
        float | None,
        _limit(
            "Height up to which targets are to be seen so",
            "m",
            above=0,
            below=50,
            undecided="scanner_height only",
        ),
    ] = None
    coverage_rule: Annotated[
        Literal["length", "paper"],
        _plan("Count metres; or, as the paper does, units of the whole"),
    ] = "length"
    overlap: Annotated[
        float | None,
        _plan(
            "Least share of a scan that its neighbour sees too, so that all register; 0: not asked for",
            least=0,
            below=1,
            why="0.1 is 10 %",
            undecided="0",
            quiet=True,
        ),
    ] = None
    overlap_range: Annotated[
        float | None,
        _plan("Farthest boundary that counts for overlap", "m", above=0, undecided="20", quiet=True),
    ] = None
    d_sec: Annotated[float, _plan("Stop to element", "m", least=0)] = 0.7
    d_dis: Annotated[
        float, _plan("Length of a unit", "m", least=1e-3, why="units below 1 mm are not planned")
    ] = 0.05
    grid: Annotated[
        float, _plan("Spacing of grid candidates", "m", least=0.05, why="less than 5 cm is not planned")
    ] = 1.0
    # The paper gives no value for the next three: ours come closest to its Table 3.
    d_max: Annotated[
        float,
        _plan("Longest seed segment of triangulation", "m", least=0.05, why="less than 5 cm is not planned"),
    ] = 1.6
    l_min: Annotated[float, _plan("Least side of a triangle", "m", least=0)] = 2.6
    dens_min: Annotated[float, _plan("Least candidates of a room", "per m²", least=0)] = 0.25
    door_access: Annotated[float, _plan("Least clear width of an opening", "m", above=0)] = 0.7
    edge: Annotated[float, _plan("Stops and legs to floor edges and holes", "m", least=0)] = 0.35
    doors: Annotated[Literal["open", "closed"], _plan("Whether the laser passes doors")] = "open"
    targets: Annotated[
        tuple[str, ...] | None,
        _plan(
            "Kinds to scan",
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
            "What a layer stands for",
            form="NAME=KIND",
            example="A-WALL=walls or DIM=ignore",
            read=str,
            option="layer",
        ),
    ] = ()
    tour: Annotated[
        Literal["closed", "open"] | None,
        _plan("Whether the route comes back to its start", undecided="closed if only start is given"),
    ] = None
    start: Annotated[
        Triple | None,
        _plan(
            "Where the robot starts; with robots, once for all or once for each",
            "m and degrees counter-clockwise from +x",
            form="X,Y,HEADING",
            example="2.5,3.0,90",
            further="further_starts",
        ),
    ] = None
    further_starts: Annotated[
        tuple[Triple, ...] | None,
        _plan(
            "Where the second and each further robot starts",
            "m and degrees",
            form="X,Y,HEADING",
            example="2.5,3.0,90",
            option="start",
            quiet=True,
        ),
    ] = None
    robots: Annotated[
        int | None,
        _plan(
            "Robots that share the floor, each with a mission", least=1, most=50, undecided="1", quiet=True
        ),
    ] = None
    shift: Annotated[
        float | None,
        _plan(
            "Longest a tour may take until it is back at its start",
            "s",
            above=0,
            form="DURATION",
            example="1800, 30min or 1h30min",
            read=seconds,
            quiet=True,
        ),
    ] = None
    end: Annotated[Pair | None, _plan("Where the robot's way ends", "m", form="X,Y", example="2.5,3.0")] = (
        None
    )
    use: Annotated[tuple[Pair, ...], _plan("A stop that must be", "m", form="X,Y", example="2.5,3.0")] = ()
    avoid: Annotated[
        tuple[Triple, ...], _plan("Circle without stops", "m", form="X,Y,RADIUS", example="2.5,3.0,1")
    ] = ()
    refine: Annotated[
        bool | None, _plan("Offer places beside the chosen stops too", undecided="up to 25 stops")
    ] = None
    door_scan: Annotated[bool, _plan("Add a stop in every doorway driven through")] = False
    door_candidates: Annotated[bool, _plan("Offer doorways as candidates")] = False
    node_limit: Annotated[int, _plan("Nodes of the exact selector's search", least=0)] = 20_000
    time_limit: Annotated[
        float | None, _plan("Limit of that search; plans then depend on the machine", "s", above=0)
    ] = None
    origin: Annotated[
        tuple[float, float, float, float] | None,
        _plan(
            "Where on earth the drawing's origin is, and the bearing of its +y axis",
            "degrees and m",
            form="LAT,LON,ALT,HEADING",
            example="47.3769,8.5417,408,0",
        ),
    ] = None
    seed: Annotated[int, _plan("Seed of the tour search", least=0)] = 1
    robot_radius: Annotated[
        float | None, _robot("The robot's radius", "m", above=0, undecided="half of door_access")
    ] = None
    speed: Annotated[float, _robot("The robot's speed", "m/s", least=0.001)] = 0.5
    turn_rate: Annotated[float, _robot("How fast it turns", "degrees/s", least=0.01)] = 45.0
    battery: Annotated[
        float | None,
        _robot(
            "How long it runs on one charge, which limits tours as a shift does",
            "s",
            above=0,
            form="DURATION",
            example="5400, 90min or 1h30min",
            read=seconds,
            quiet=True,
        ),
    ] = None
    acceleration: Annotated[float, _robot("How fast it speeds up", "m/s²", least=0.001)] = 0.5
    scanner: Annotated[
        ScannerName | None,
        _scanner("Scanner by name, which gives what is not given besides", quiet=True),
    ] = None
    near: Annotated[
        float | None, _scanner("What is nearer is not seen", "m", least=0, undecided="0", quiet=True)
    ] = None
    angular_step: Annotated[
        float | None, _scanner("Between neighbouring points", "degrees", above=0, most=5, quiet=True)
    ] = None
    blind_cone: Annotated[
        float | None,
        _scanner(
            "Cone under the scanner that it does not see",
            "degrees",
            least=0,
            most=170,
            undecided="0",
            quiet=True,
        ),
    ] = None
    scanner_height: Annotated[
        float | None,
        _scanner(
            "Scanner above the floor", "m", above=0, below=10, undecided="scan_height, else 1.3", quiet=True
        ),
    ] = None
    range: Annotated[float, _scanner("The scanner's range", "m", above=0)] = 5.0
    fov: Annotated[float, _scanner("The scanner's field of view", "degrees", least=10, most=360)] = 360.0
    profile: Annotated[str, _scanner("The scanner's own name for how it scans")] = "default"
    settle: Annotated[float, _scanner("Standing still before a scan", "s", least=0)] = 2.0
    scan_time: Annotated[float, _scanner("Duration of a scan", "s", least=0)] = 60.0
    tolerance: Annotated[float, _policy("Robot to stop at the start of a scan", "m", above=0)] = 0.05
    on_failure: Annotated[
        Literal["retry", "skip", "ask", "abort", "home"], _policy("What is done when a scan fails")
    ] = "ask"
    retries: Annotated[int, _policy("How often a failed scan is tried again", least=0)] = 1
    link_loss: Annotated[
        Literal["continue", "finish_stop", "hold", "home"], _policy("What is done without a link")
    ] = "continue"
    link_loss_after: Annotated[float, _policy("How long a link is missing until then", "s", least=0)] = 30.0
    battery_min: Annotated[
        float, _policy("Least charge with which the run goes on", least=0, below=1, why="0.15 is 15 %")
    ] = 0.15

    @property
    def layer_roles(self) -> dict[str, str]:
        """What layers stand for, by their names in capitals, where the user says so."""
        return kinds_by_name(self.layers)

    @property
    def least_of_room(self) -> float | None:
        """Least share of what each room shows; None where none is asked for."""
        return self._least(self.room_coverage)

    @property
    def least_of_kind(self) -> float | None:
        """Least share of what is visible of each kind of element; None where none is asked for."""
        return self._least(self.kind_coverage)

    @property
    def least_overlap(self) -> float:
        """Least share of a scan that its neighbour sees too; 0 where scans need not register."""
        return self.overlap or 0.0

    @property
    def farthest_overlap(self) -> float:
        """Farthest boundary that counts for overlap, metres."""
        return OVERLAP_RANGE_M if self.overlap_range is None else self.overlap_range

    @property
    def least_views(self) -> int:
        """From how many stops a target must be seen until it counts."""
        return 1 if self.views is None else self.views

    def _least(self, given: float | None) -> float | None:
        if self.coverage_rule == "paper":
            return None
        return LEAST_SHARE if given is None else given

    @property
    def tour_limit(self) -> tuple[str, float] | None:
        """The parameter that limits how long a tour may take, and its seconds; None where none does."""
        limits = [(key, value) for key in ("shift", "battery") if (value := getattr(self, key)) is not None]
        return min(limits, key=lambda limit: limit[1], default=None)

    @property
    def divided(self) -> bool:
        """Whether the stops are shared out among several tours or robots."""
        return self.tour_limit is not None or self.robots is not None

    @property
    def starts(self) -> tuple[Triple, ...]:
        """Every start that is given."""
        return () if self.start is None else (self.start, *(self.further_starts or ()))

    @property
    def radius(self) -> float:
        """The robot's radius in metres: half of door_access unless given."""
        return self.door_access / 2 if self.robot_radius is None else self.robot_radius


def _declared() -> dict[str, Parameter]:
    """Each parameter with its name, type and default."""
    hints = get_type_hints(Settings, include_extras=True)
    return {
        field.name: replace(
            hints[field.name].__metadata__[0],
            name=field.name,
            type=hints[field.name].__origin__,
            default=field.default,
        )
        for field in fields(Settings)
    }


PARAMETERS = _declared()
"""Every parameter of a plan by name, in the order of their declaration."""
FLOOR_PARAMETERS = tuple(name for name, item in PARAMETERS.items() if item.section == "floor")
"""Those that choose and shape the floor that is read."""


def told_of(settings: Settings) -> dict[str, Any]:
    """What missions tell of the settings, by name, as JSON holds it."""
    import msgspec

    told = msgspec.to_builtins(settings)
    return {name: value for name, value in told.items() if not PARAMETERS[name].left_out(value)}


def check_settings(settings: Settings) -> None:
    """Refuse values that no plan can be made with, naming key and value."""
    for key, parameter in PARAMETERS.items():
        parameter.check(getattr(settings, key))
    _check_together(settings)
    _check_division(settings)
    _check_days(settings)
    _check_lists(settings)
    _check_region(settings)


def _check_together(settings: Settings) -> None:
    """Refuse what a coverage rule, a field of view or a closed tour has no use for."""
    for key in ("room_coverage", "kind_coverage"):
        share = getattr(settings, key)
        if share is not None and settings.coverage_rule == "paper":
            raise InputError(
                f"{key} = {share}: the paper's rule has no such share; use coverage_rule = length"
            )
    if settings.refine and (settings.coverage_rule == "paper" or settings.fov < 360):
        other = "coverage_rule = paper" if settings.coverage_rule == "paper" else f"fov = {settings.fov:g}"
        raise InputError(f"refine = true: is not done with {other}; leave one of them out")
    if settings.density is not None and settings.angular_step is None:
        raise InputError(
            f"density = {settings.density:g}: needs the scanner's angular_step; give it, or a scanner: "
            f"{', '.join(SCANNERS)}"
        )
    if settings.wall_height is not None and settings.max_incidence is None and settings.density is None:
        raise InputError(
            f"wall_height = {settings.wall_height:g}: says nothing without max_incidence or density; give one"
        )
    if settings.least_views > 1 and settings.fov < 360:
        raise InputError(
            f"views = {settings.views}: is not done with fov = {settings.fov:g}, where one place may have "
            "several stops; leave one of them out"
        )
    if settings.tour == "closed" and settings.end is not None:
        raise InputError("tour = closed and end are both given; a closed tour ends where it starts")


def _check_division(settings: Settings) -> None:
    """Refuse robots without a start, and tours that cannot be driven so."""
    starts = len(settings.starts)
    if settings.further_starts and settings.start is None:
        raise InputError("further_starts are given without start; give start, of the first robot")
    if starts > 1 and starts != (settings.robots or 1):
        raise InputError(
            f"robots = {settings.robots or 1}: {starts} starts are given; give --start once for all robots, "
            "or once for each"
        )
    if not settings.divided:
        return
    if settings.robots is not None and settings.tour_limit is not None:
        raise InputError(f"robots and {settings.tour_limit[0]} are both given; plan for one of them")
    what = "robots" if settings.tour_limit is None else settings.tour_limit[0]
    if settings.robots is not None and not starts:
        raise InputError(
            f"robots = {settings.robots}: no robot has a start; give --start X,Y,HEADING once for all, "
            "or once for each"
        )
    if settings.end is not None:
        raise InputError(f"end and {what} are both given; leave one of them out")
    if settings.tour_limit is not None and settings.tour == "open":
        raise InputError(f"tour = open: with {what} every tour comes back to its start; leave tour out")
    least = settings.settle + settings.scan_time
    if settings.tour_limit is not None and settings.tour_limit[1] < least:
        raise InputError(
            f"{what} = {settings.tour_limit[1]:g} s: is shorter than one stop, which takes {least:g} s; "
            "give more time, or a shorter scan_time"
        )


def _check_days(settings: Settings) -> None:
    for key in ("date", "since"):
        day = getattr(settings, key)
        try:
            if day is not None and datetime.date.fromisoformat(day).isoformat() != day:
                raise ValueError
        except ValueError:
            raise InputError(
                f"{key} = {day}: is no day; write it as YYYY-MM-DD, such as 2024-05-31"
            ) from None
    for key in ("since", "schedule", "in_progress"):
        if getattr(settings, key) is not None and settings.date is None:
            raise InputError(f"{key} = {getattr(settings, key)}: says nothing without a day; give --date too")
    if settings.since is not None and settings.date is not None and settings.since >= settings.date:
        raise InputError(f"since = {settings.since}: must lie before date = {settings.date}")
    for entry in settings.schedule_columns:
        what, _, column = entry.partition("=")
        if what.strip() not in ("guid", "task", "start", "finish") or not column.strip():
            raise InputError(
                f"schedule_columns = {entry}: write WHAT=COLUMN; known: guid, task, start, finish"
            )


def _check_lists(settings: Settings) -> None:
    for kind in settings.targets or ():
        if kind not in KINDS:
            raise InputError(f"targets = {kind}: unknown kind; known: {', '.join(KINDS)}")
    check_entries(settings.layers, key="layers")
    check_entries(settings.layer_map or (), key="layer_map")
    for x, y, radius in settings.avoid:
        if radius <= 0:
            raise InputError(f"avoid = {x:g},{y:g},{radius:g}: the radius must be greater than 0")
    if settings.targets == ():
        raise InputError(f"targets is empty; known: {', '.join(KINDS)}")
    if settings.origin is not None and not (abs(settings.origin[0]) <= 90 and abs(settings.origin[1]) <= 180):
        raise InputError(f"origin = {settings.origin}: latitude must be within ±90, longitude ±180")


def _check_region(settings: Settings) -> None:
    if settings.region is None:
        return
    x0, y0, x1, y1 = settings.region
    if not (x0 < x1 and y0 < y1):
        told = ",".join(f"{number:g}" for number in settings.region)
        raise InputError(f"region = {told}: the second corner must lie right of and above the first")
