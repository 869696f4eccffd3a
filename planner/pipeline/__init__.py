"""Floor -> plan: where the scanner must stand, and by which route a robot visits those stops."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stopgo.mission.floor import FloorPlan
    from stopgo.mission.plan import PartPlan, Plan
    from stopgo.mission.settings import Settings
    from stopgo.mission.stages import Candidates, NavigableSpace, Route, Selection, Visibility
    from stopgo.mission.stages.division import DividedRoute
    from stopgo.planner.appraisal.figures_of_route import FiguresBefore
    from stopgo.planner.geometry.side_work import SideWork
    from stopgo.planner.overlap import PairsFound
    from stopgo.planner.selection.later_bound import LaterBound

Observe = Callable[[Any], None]


def plan(
    floor: FloorPlan,
    settings: Settings,
    *,
    observe: Observe = lambda result: None,
    all_parts: bool = False,
) -> Plan:
    """Plan the part of the floor that holds the start, else the largest; with `all_parts` the others too.

    Every stage result goes to `observe` as soon as it exists; the selection of a large floor goes there again
    after the figures, with its bound.

    Raises
    ------
    NegativeResult
        No target, no candidate, or nothing visible.
    InputError
        A start, an end or a variant that does not fit the floor.
    """
    from stopgo.mission.errors import InputError
    from stopgo.mission.plan import Plan
    from stopgo.planner.candidates import candidates
    from stopgo.planner.space.navigable import navigable

    observe(floor)
    space = navigable(floor, settings)
    observe(space)
    if all_parts and settings.divided:
        raise InputError("--all-parts: not possible with robots or shifts; plan each part by its --start")
    with _graph_beside(space) as keep_graph:
        found = parts_to_plan(space) if all_parts else [candidates(space)]
        planned = frozenset(part.chosen_part for part in found)
        if settings.divided:
            return _plan_divided(found[0], planned, observe, keep_graph)
        parts = (_plan_part(part, k, planned, observe, keep_graph) for k, part in enumerate(found))
        return Plan(tuple(parts))


@contextmanager
def _graph_beside(space: NavigableSpace) -> Iterator[Callable[[], None]]:
    """Yield what keeps the parts of the route's graph that need no stops.

    Another process finds those of a large floor until then.
    """
    from stopgo.planner.geometry.instance_cache import store
    from stopgo.planner.geometry.side_work import SideWork
    from stopgo.planner.routing.roadmap import corner_pieces, drive_mesh, outward_corners
    from stopgo.planner.space.navigable import is_large

    parts = (drive_mesh, outward_corners, corner_pieces)
    forked = is_large(space.floor) and space.settings.graph == "exact"
    with SideWork(lambda: [part(space) for part in parts], forked=forked, gives_way=True) as graph:

        def keep() -> None:
            if graph.is_apart:
                for part, found in zip(parts, graph.result(), strict=True):
                    store(part, space, found)

        yield keep


def _plan_part(
    found: Candidates, number: int, planned: frozenset[int], observe: Observe, keep_graph: Callable[[], None]
) -> PartPlan:
    """Plan from candidates on; `planned` are all parts of the floor that the plan enters."""
    from stopgo.planner.routing import route

    settings = found.space.settings
    with _seen(found, planned, observe) as (seen, prepared), _later_bound(seen) as later:
        selection = _selected(seen, later)
        keep_graph()
        driven = _in_least_time(route(selection)) if settings.minimise == "time" else None
        observe(selection if driven is None else driven.selection)
        driven = driven or route(selection)
        observe(driven)
        return _part(driven, number, prepared.figures(driven), observe, later)


MANY = 5000
"""Candidates from which work that nothing waits for yet is done in a process of its own."""


@contextmanager
def _seen(
    found: Candidates, planned: frozenset[int], observe: Observe
) -> Iterator[tuple[Visibility, _Prepared]]:
    """Yield the visibility of the candidates, and results that need no stops.

    The pairs of many that register are found meanwhile.
    """
    from stopgo.planner.geometry.side_work import SideWork
    from stopgo.planner.overlap import keep_pairs, pairs_found
    from stopgo.planner.selection import cover_problem
    from stopgo.planner.visibility import visibility

    observe(found)
    settings = found.settings
    many = len(found.kept) >= MANY and settings.registers and settings.fov >= 360  # else with headings
    with ExitStack() as after:
        with SideWork(lambda: pairs_found(found), forked=many) as pairs:
            seen = visibility(found)
            observe(seen)
            if many:
                cover_problem(seen)  # kept for the selection, and made while the pairs are found
            prepared = after.enter_context(_Prepared(seen, planned, pairs))
            if many:
                keep_pairs(seen.candidates, pairs.result())
        del pairs  # and what it holds
        yield seen, prepared


class _Prepared:
    """The figures that need no stops, found while these are selected.

    The selection waits for the `pairs` that register, so that these take both cores before.
    """

    def __init__(self, seen: Visibility, planned: frozenset[int], pairs: SideWork[PairsFound]) -> None:
        from stopgo.planner.geometry.side_work import SideWork
        from stopgo.planner.visibility.limited import keep_only_visible

        self._seen, self._planned = seen, planned
        self._work = SideWork(
            lambda: self._found(seen),
            forked=seen.rows >= MANY,
            again=lambda: self._found(self._seen_again()),
            after=pairs,
            gives_way=True,
        )
        if self._work.is_apart and seen.in_sight is not None:
            keep_only_visible(seen.in_sight)

    def __enter__(self) -> _Prepared:
        return self

    def __exit__(self, *error: Any) -> None:
        self._work.__exit__(*error)

    def _seen_again(self) -> Visibility:
        """The visibility with all lines of sight, where those of its own are forgotten."""
        from stopgo.planner.visibility import visibility

        return self._seen if self._seen.in_sight is None else visibility(self._seen.in_sight.candidates)

    def _found(self, seen: Visibility) -> FiguresBefore:
        from stopgo.planner.appraisal.figures_of_route import FiguresBefore

        return FiguresBefore.of(seen, self._planned)

    def figures(self, route: Route) -> FiguresBefore:
        """The figures that need no route, of the visibility that it has."""
        from stopgo.planner.appraisal.figures_of_route import FiguresBefore

        if route.visibility is self._seen:
            return self._work.result()
        known = self._work.result().estimates if self._work.is_beside else None
        return FiguresBefore.of(route.visibility, self._planned, before=self._seen, known=known)


@contextmanager
def _later_bound(seen: Visibility) -> Iterator[LaterBound | None]:
    """Yield what finds the bound of a selection during its route; None where that is no gain."""
    from stopgo.planner.geometry.side_work import can_fork
    from stopgo.planner.selection.later_bound import LaterBound

    if seen.rows < MANY or seen.settings.minimise == "time" or not can_fork():
        yield None  # the least time goes by the bound
        return
    with LaterBound(lambda: _selected(seen)) as later:
        yield later


def _selected(seen: Visibility, later: LaterBound | None = None) -> Selection:
    """Select the fewest stops, and more where the accuracy required needs them."""
    from stopgo.planner.selection.accurate import accurate
    from stopgo.planner.selection.bound import lower_bound
    from stopgo.planner.selection.continuous_selection import SELECTOR, select_anywhere
    from stopgo.planner.selection.refine import select_refined

    if seen.settings.selector == SELECTOR:
        return accurate(select_anywhere(seen))
    return accurate(select_refined(seen, bound_of=later or lower_bound))


def _in_least_time(route: Route) -> Route:
    from stopgo.planner.covering_tour import least_time_route

    return least_time_route(route)


def _part(
    driven: Route, number: int, before: FiguresBefore, observe: Observe, later: LaterBound | None = None
) -> PartPlan:
    """Return the plan of a route; a bound that is known later is waited for, and observed."""
    from stopgo.mission.plan import PartPlan
    from stopgo.planner.appraisal.figures_of_route import figures_of
    from stopgo.planner.routing.assemble import assemble

    figures = figures_of(driven, before)
    observe(figures)
    mission = assemble(driven, part=number)
    proved = driven if later is None else later.proved(driven)
    if proved is not driven:
        observe(proved.selection)
    observe(mission)
    return PartPlan(proved, figures, mission)


def _plan_divided(
    found: Candidates, planned: frozenset[int], observe: Observe, keep_graph: Callable[[], None]
) -> Plan:
    """Plan one part, and divide its stops among robots or tours."""
    from stopgo.mission.document import UNDIVIDED, MissionAllocation
    from stopgo.mission.plan import DividedPlan, PartPlan, Plan
    from stopgo.planner.appraisal.figures_of_route import figures_of_share
    from stopgo.planner.routing.assemble import assemble

    with _seen(found, planned, observe) as (seen, prepared):
        selection = _selected(seen)
        keep_graph()
        driven, division = _divided(selection)
        observe(driven.selection)
        observe(driven)
        before = prepared.figures(driven)
    whole = _part(driven, UNDIVIDED, before, observe)
    shares = []
    for k, route in enumerate(division.routes):
        allocation = MissionAllocation(kind=division.kind, number=k + 1, of=len(division.routes))
        mission = assemble(route, part=k, allocation=allocation)
        shares.append(PartPlan(route, figures_of_share(route, whole, before), mission))
    made = DividedPlan(division.kind, whole, tuple(shares), division.limit_s, division.bound, division.method)
    observe(made)
    return Plan(made.shares, made)


BOTH_UP_TO = 40
"""Stops up to which two routes are divided: of many stops a division takes as long as all else."""


def _divided(selection: Selection) -> tuple[Route, DividedRoute]:
    """Return the route over all stops, and their division among robots or tours.

    For the least time, both the route of least time and the route of fewest stops are divided. The route
    that is quicker for one robot is not always quicker for several. Of many stops only the quicker one is.
    """
    from stopgo.planner.covering_tour import with_known_time
    from stopgo.planner.routing import route
    from stopgo.planner.task_allocation.dividing import divided, division_cost

    driven = route(selection)
    if selection.settings.minimise == "stops":
        return driven, divided(driven)
    quicker = _in_least_time(driven)
    if len(quicker.order) > BOTH_UP_TO:
        return quicker, divided(quicker)
    both = [(one, divided(one)) for one in (with_known_time(driven, quicker), quicker)]
    return min(both, key=lambda one: division_cost(one[1]))


def parts_to_plan(space: NavigableSpace) -> list[Candidates]:
    """Return candidates of every part that has any: the part of `plan` first, then the others by area.

    A part without a room is left out if no target is visible from it, such as a landing.
    """
    from stopgo.planner.candidates import candidates

    first = candidates(space)
    rooms = {
        int(part) for part, k in zip(first.part, first.room, strict=True) if space.rooms[k].room is not None
    }
    others = sorted(set(first.part.tolist()) - {-1, first.chosen_part})
    found = [candidates(space, part=part) for part in others]
    return [first, *(item for item in found if item.chosen_part in rooms or _any_visible(item))]


def _any_visible(found: Candidates) -> bool:
    """True if any target is visible from the candidates."""
    from stopgo.mission.errors import NegativeResult
    from stopgo.planner.visibility import visibility

    try:
        visibility(found)
    except NegativeResult:
        return False
    return True


__all__ = ["Observe", "plan"]
