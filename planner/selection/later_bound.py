"""Lower bound on the stops of a large selection, found in a process of its own while the route is planned."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import TracebackType

from stopgo.mission.stages import Route, Selection
from stopgo.planner.geometry.instance_cache import changed_copy
from stopgo.planner.geometry.side_work import SideWork
from stopgo.planner.selection.bound import lower_bound
from stopgo.planner.selection.cover import Cover


class LaterBound:
    """The bound of one selection; the end of the block ends the work on it."""

    def __init__(self, again: Callable[[], Selection]) -> None:
        """`again` selects with the bound at once, should the process end without a result."""
        self._again, self._work = again, SideWork(lambda: 0, forked=False)

    def __call__(self, problem: Cover, *, found: int) -> int:
        """Begin with the bound of a problem, and return the one known now: none."""
        work = partial(lower_bound, problem, found=found)
        self._work = SideWork(work, forked=True, again=lambda: self._again().bound)
        return 0

    def __enter__(self) -> LaterBound:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._work.__exit__(kind, error, trace)

    def proved(self, route: Route) -> Route:
        """The route with the bound of its selection, or itself where that is no higher than known before."""
        selection, bound = route.selection, self._work.result()
        if bound <= selection.bound:
            return route
        proved = ", proved fewest" if bound == len(selection.chosen) else ""
        known = changed_copy(selection, bound=bound, method=selection.method + proved)
        return changed_copy(route, selection=known)
