"""Tours of several vehicles over all stops within a time each, by PyVRP's iterated local search.

Wouda, Lan, Kool, "PyVRP: a high-performance VRP solver package", INFORMS Journal on Computing 2024. Times
are whole milliseconds, the search ends by a count and is seeded, so that it finds the same on every machine.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from stopgo.mission.geometry import FloatArray

ITERATIONS = 100
"""Of each search."""
PER_STOP = 5
"""More of them for each stop."""
MILLISECONDS = 1_000


def vehicle_tours(
    times: FloatArray, *, stops: int, depots: Sequence[int], pause_s: float, limit_s: float, closed: bool,
    seed: int,
) -> list[tuple[int, tuple[int, ...]]] | None:  # fmt: skip
    """Tours, each with the depot it starts from (point `stops` and up); None where none were found in time.

    `times` (points, points) are seconds; there is a vehicle at each of `depots`, which may repeat.
    """
    import pyvrp
    from pyvrp.stop import MaxIterations

    whole: Any = np.ceil(times * MILLISECONDS).astype(np.int64)
    np.fill_diagonal(whole, 0)
    if not closed:
        whole[:, stops:] = 0
    limit = int(limit_s * MILLISECONDS)
    locations = [pyvrp.Location(0, 0) for _ in range(len(whole))]
    service = int(np.ceil(pause_s * MILLISECONDS))
    data = pyvrp.ProblemData(
        locations=locations,
        clients=[pyvrp.Client(location=k, service_duration=service) for k in range(stops)],
        depots=[pyvrp.Depot(location=k) for k in range(stops, len(whole))],
        vehicle_types=[
            pyvrp.VehicleType(
                num_available=many,
                start_depot=depot - stops,
                end_depot=depot - stops,
                shift_duration=limit,
                unit_distance_cost=1,
            )
            for depot, many in sorted(Counter(depots).items())
        ],
        distance_matrices=[whole],
        duration_matrices=[whole],
    )
    found = pyvrp.solve(
        data, MaxIterations(ITERATIONS + PER_STOP * stops), seed=seed, collect_stats=False, display=False
    )
    if not found.is_feasible():
        return None
    return [_told(route, stops) for route in found.best.routes()]


def _told(route: Any, stops: int) -> tuple[int, tuple[int, ...]]:
    return stops + route.start_depot(), tuple(item.idx for item in route if item.is_client())
