"""Tours of several vehicles over all stops within a time each, by PyVRP's iterated local search.

Wouda, Lan, Kool, "PyVRP: a high-performance VRP solver package", INFORMS Journal on Computing 2024. Times
are whole milliseconds. The search is seeded and ends by a count, so that the result is reproducible.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from stopgo.mission.geometry import FloatArray

ITERATIONS = 200
"""Iterations of each search, one more per stop, and at most as many as WORK allows."""
WORK = 150_000
"""Iterations times stops."""
MILLISECONDS = 1_000


def vehicle_tours(
    times: FloatArray, *, stops: int, depots: Sequence[int], pause_s: float, limit_s: float, closed: bool,
    seed: int,
) -> list[tuple[int, tuple[int, ...]]] | None:  # fmt: skip
    """Tours, each with the depot where it starts (point `stops` and up); None if none were found.

    `times` (points, points) are seconds; there is a vehicle at each of `depots`, which may repeat.
    """
    import pyvrp
    from pyvrp.stop import MaxIterations

    whole: Any = np.ceil(times * MILLISECONDS).astype(np.int64)
    np.fill_diagonal(whole, 0)
    if not closed:
        whole[:, stops:] = 0
    service = int(np.ceil(pause_s * MILLISECONDS))
    data = pyvrp.ProblemData(
        locations=[pyvrp.Location(0, 0) for _ in range(len(whole))],
        clients=[pyvrp.Client(location=k, service_duration=service) for k in range(stops)],
        depots=[pyvrp.Depot(location=k) for k in range(stops, len(whole))],
        vehicle_types=_vehicle_types(depots, stops, int(limit_s * MILLISECONDS)),
        distance_matrices=[whole],
        duration_matrices=[whole],
    )
    found = pyvrp.solve(
        data,
        MaxIterations(min(ITERATIONS + stops, max(1, WORK // stops))),
        seed=seed,
        collect_stats=False,
        display=False,
    )
    return [_tour_of(route, stops) for route in found.best.routes()] if found.is_feasible() else None


def _vehicle_types(depots: Sequence[int], stops: int, limit: int) -> list[Any]:
    """One type per depot, with as many vehicles as the depot is repeated, and a limit in milliseconds."""
    import pyvrp

    return [
        pyvrp.VehicleType(
            num_available=many,
            start_depot=depot - stops,
            end_depot=depot - stops,
            shift_duration=limit,
            unit_distance_cost=1,
        )
        for depot, many in sorted(Counter(depots).items())
    ]


def _tour_of(route: Any, stops: int) -> tuple[int, tuple[int, ...]]:
    return stops + route.start_depot(), tuple(item.idx for item in route if item.is_client())
