"""Tours compared with other solvers and proven bounds; the paper's grids compared with exact paths.

Run: python -m benchmarks.tours. Peers are fast-tsp, pyvrp and OR-tools where they can be imported: they
are not dependencies. Each peer that runs for a given time gets the time of planning.md's comparison.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from multiprocessing import get_context

import numpy as np
import shapely

from benchmarks.floors import office
from benchmarks.table import put, table, versions
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.routing.colony import ant_colony
from stopgo.planner.routing.grid_graph import RESOLUTIONS, paths_on_grids
from stopgo.planner.routing.paths import Paths
from stopgo.planner.routing.proof import Proof, tour_proof
from stopgo.planner.routing.roadmap import paths_between
from stopgo.planner.routing.tour import length_of, nanometres, search, shortest_tour, trials
from stopgo.planner.space.navigable import navigable

SIDE = 100.0
"""Points lie in a square of this many metres."""
SEEDS = {10: 5, 20: 5, 50: 5, 200: 3, 1000: 1}
"""Instances per number of points."""
SECONDS = {10: 1.0, 20: 1.0, 50: 1.0, 200: 5.0, 1000: 5.0}
"""Time limit of a solver that runs for a given time."""
ANTS_UP_TO = 200
LONG_SEARCH = 5
"""Perturbations of the long search among the best found, in multiples of ours."""

Solver = Callable[[FloatArray, float], IntArray]


@dataclass(frozen=True)
class Figure:
    """A tour of one instance."""

    length: int
    seconds: float


def main() -> None:
    """Print both tables and write them into benchmarks/README.md."""
    for section, text in (("tours", tours_table()), ("ways", ways_table())):
        print(text, flush=True)
        put(section, text)


# ---- tours ----


def solvers() -> dict[str, Solver]:
    """Ours, then the peers that are installed."""
    found: dict[str, Solver] = {
        "ours, search": lambda lengths, _: shortest_tour(lengths, seed=1),
        "ours, search and proof": lambda lengths, _: search_and_proof(lengths).order,
        "ours, ant colony (the paper's)": lambda lengths, _: ant_colony(lengths, seed=1),
    }
    for name, module, solver in PEERS:
        if find_spec(module) is None:
            print(f"{name} is not installed and left out (pip install {name})")
        else:
            found[name] = solver
    return found


def search_and_proof(lengths: FloatArray) -> Proof:
    return tour_proof(nanometres(lengths), shortest_tour(lengths, seed=1))


def fast_tsp(lengths: FloatArray, seconds: float) -> IntArray:
    """Whole centimetres, since its distances end at 65535."""
    from fast_tsp import find_tour

    return np.array(find_tour(np.rint(100 * lengths).astype(int).tolist(), duration_seconds=seconds))


def pyvrp(lengths: FloatArray, seconds: float) -> IntArray:
    """One vehicle that visits every point from a depot at point 0."""
    from pyvrp import Model
    from pyvrp.stop import MaxRuntime

    model = Model()
    places = [model.add_location(0, 0) for _ in lengths]
    model.add_depot(places[0])
    for place in places[1:]:
        model.add_client(place)
    model.add_vehicle_type(1)
    whole = np.rint(100 * lengths).astype(int)
    for a, start in enumerate(places):
        for b, end in enumerate(places):
            if a != b:
                model.add_edge(start, end, distance=int(whole[a, b]))
    found = model.solve(stop=MaxRuntime(seconds), seed=1, display=False)
    clients = [item.idx + 1 for item in found.best.routes()[0] if item.is_client()]
    return np.array([0, *clients])


def or_tools(lengths: FloatArray, seconds: float) -> IntArray:
    """In a process of its own: its copy of HiGHS and highspy's cannot be loaded into one."""
    return _other_process().submit(_or_tools, lengths, seconds).result()


@cache
def _other_process() -> ProcessPoolExecutor:
    pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"))
    pool.submit(_or_tools, scattered(5, 0), 0.1).result()
    return pool


def _or_tools(lengths: FloatArray, seconds: float) -> IntArray:
    """Guided local search from the cheapest arcs."""
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    manager = pywrapcp.RoutingIndexManager(len(lengths), 1, 0)
    routing = pywrapcp.RoutingModel(manager)
    whole = np.rint(100 * lengths).astype(int).tolist()
    arc = routing.RegisterTransitMatrix(whole)
    routing.SetArcCostEvaluatorOfAllVehicles(arc)
    options = pywrapcp.DefaultRoutingSearchParameters()
    options.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PATH_CHEAPEST_ARC
    options.local_search_metaheuristic = routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    options.time_limit.FromMilliseconds(int(1000 * seconds))
    found = routing.SolveWithParameters(options)
    index, order = routing.Start(0), []
    while not routing.IsEnd(index):
        order.append(manager.IndexToNode(index))
        index = found.Value(routing.NextVar(index))
    return np.array(order)


PEERS: tuple[tuple[str, str, Solver], ...] = (
    ("fast-tsp", "fast_tsp", fast_tsp),
    ("pyvrp", "pyvrp", pyvrp),
    ("ortools", "ortools", or_tools),
)


def scattered(n: int, seed: int) -> FloatArray:
    """Straight lengths between n points of the square."""
    xy = np.random.default_rng(seed).uniform(0, SIDE, (n, 2))
    lengths: FloatArray = np.hypot(*np.moveaxis(xy[:, None] - xy[None], -1, 0))
    return lengths


def tours_table() -> str:
    """Length over the best found, and seconds, per number of points and method; then the bounds."""
    known = solvers()
    warm = scattered(60, 0)
    for solver in known.values():
        solver(warm, 0.1)
    rows = [row for n in SEEDS for row in _rows(n, known)]
    head = ("points", "method", "length / best found, median", "worst", "seconds, median", "proved")
    return (
        f"Random points in a square of {SIDE:.0f} m; {', '.join(f'{k} of {n}' for n, k in SEEDS.items())}. "
        "Best found: the shortest of all methods and of ours with five times the perturbations. Proved: "
        "instances proved optimal, else the bound over the length. Warm, medians of one run per instance; "
        f"{versions('numpy', 'scipy', 'highspy', 'fast-tsp', 'pyvrp', 'ortools')}.\n\n"
        f"{table(head, rows)}"
    )


def _rows(n: int, known: dict[str, Solver]) -> Iterator[tuple[object, ...]]:
    instances = [scattered(n, seed) for seed in range(SEEDS[n])]
    figures = {
        name: [_figure(solver, lengths, SECONDS[n]) for lengths in instances]
        for name, solver in known.items()
        if "ant" not in name or n <= ANTS_UP_TO
    }
    best = [min(_long_search(x), *(f[k].length for f in figures.values())) for k, x in enumerate(instances)]
    for name, each in figures.items():
        ratios = [figure.length / least for figure, least in zip(each, best, strict=True)]
        seconds = statistics.median(figure.seconds for figure in each)
        told = _proved(instances) if "proof" in name else ""
        yield n, name, f"{statistics.median(ratios):.4f}", f"{max(ratios):.4f}", seconds, told


def _figure(solver: Solver, lengths: FloatArray, seconds: float) -> Figure:
    begin = time.perf_counter()
    order = solver(lengths, seconds)
    spent = time.perf_counter() - begin
    if sorted(order.tolist()) != list(range(len(lengths))):
        raise SystemExit("a solver returned no tour of all points")
    return Figure(length_of(nanometres(lengths), order), spent)


def _long_search(lengths: FloatArray) -> int:
    cost = nanometres(lengths)
    if len(lengths) < 50:
        return length_of(cost, search_and_proof(lengths).order)
    perturbations = trials(cost, LONG_SEARCH * 100 * len(lengths), seed=2)
    return length_of(cost, search(cost, perturbations))


def _proved(instances: list[FloatArray]) -> str:
    proofs = [search_and_proof(lengths) for lengths in instances]
    closed = sum(proof.closed for proof in proofs)
    least = min(proof.bound / proof.length for proof in proofs)
    return f"{closed} of {len(proofs)}" if closed == len(proofs) else f"{closed}, bound {least:.4f}"


# ---- ways ----


def ways_table() -> str:
    """Stop pairs that a grid connects, and the excess length of its paths over exact ones."""
    space = navigable(office(60, 40, seed=1), Settings())
    stops = free_points(space, 50, seed=1)
    exact, spent = _timed(lambda: paths_between(space, stops))
    i, j = np.triu_indices(len(stops), 1)
    rows: list[tuple[object, ...]] = [("exact", "100 %", "1", "1", len(exact.xy), spent)]
    for name, resolutions in (
        *((f"grid {r:g} m", (r,)) for r in RESOLUTIONS[:4]),
        ("grid, refined", RESOLUTIONS),
    ):
        found, spent = _timed(lambda r=resolutions: paths_on_grids(space, stops, resolutions=r))
        lengths = found.lengths[i, j]
        joined = np.isfinite(lengths)
        excess = lengths[joined] / exact.lengths[i, j][joined]
        median, worst = (f"{np.median(excess):.3f}", f"{excess.max():.3f}") if joined.any() else ("-", "-")
        rows.append((name, f"{100 * joined.mean():.0f} %", median, worst, len(found.xy), spent))
    head = ("graph", "pairs connected", "length / exact, median", "worst", "nodes", "seconds")
    return (
        "50 stops on a synthetic office of 60 × 40 m, doors of 0.9 m, a robot of 0.35 m. Grids of one "
        "resolution everywhere, and the paper's refined by room (den_grid_min 0.5 per m², max_err_dist "
        f"0.5 m: ours); {versions('numpy', 'scipy', 'shapely')}.\n\n{table(head, rows)}"
    )


def _timed(action: Callable[[], Paths]) -> tuple[Paths, float]:
    action()
    begin = time.perf_counter()
    result = action()
    return result, time.perf_counter() - begin


def free_points(space: NavigableSpace, count: int, *, seed: int) -> FloatArray:
    """Positions (count, 2) in the largest part of the drive area, well inside it."""
    pieces = [shapely.Polygon(p.exterior, p.holes).buffer(-0.3) for p in space.drive_area]
    largest = max(pieces, key=shapely.area)
    low_x, low_y, high_x, high_y = largest.bounds
    points = np.random.default_rng(seed).uniform((low_x, low_y), (high_x, high_y), (20 * count, 2))
    return points[shapely.contains_xy(largest, *points.T)][:count]


if __name__ == "__main__":
    main()
