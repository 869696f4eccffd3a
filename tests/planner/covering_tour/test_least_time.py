"""Stops and tour chosen together, against every choice and every order on small floors."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

import stopgo.planner.covering_tour.least_time_bound
import stopgo.planner.covering_tour.problem
import stopgo.planner.covering_tour.time_graph
from stopgo.mission.document.schedule import leg_times, schedule, turn_time
from stopgo.mission.document.specs import robot_of
from stopgo.mission.geometry import FloatArray
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace, Route
from stopgo.planner.covering_tour import least_time_route
from stopgo.planner.covering_tour.least_time_bound import RouteRequirements, _Relaxation, least_time
from stopgo.planner.covering_tour.problem import TourProblem, problem_of
from stopgo.planner.covering_tour.search import shorter_line
from stopgo.planner.covering_tour.time_graph import TimeGraph
from stopgo.planner.covering_tour.zones import Zones
from stopgo.planner.overlap import links_of
from stopgo.planner.routing import legs_between, points_and_ends, rank_at_door
from stopgo.planner.routing.assemble import assemble
from stopgo.planner.routing.grid_graph import grid_paths
from stopgo.planner.routing.leg_kernel import follow
from stopgo.planner.routing.leg_table import MICROSECONDS, leg_table
from stopgo.planner.routing.paths import Paths
from stopgo.planner.selection import cover_problem
from stopgo.planner.selection.separators import components_of
from tests.faults.sizes import size, some
from tests.planner.kernels import interpret, machine_code
from tests.planner.worlds import box, column, door, floor_of, hall, planned, room, shell, two_rooms, wall

BASIS: dict[str, Any] = {"d_dis": 0.2, "refine": False, "register": False}


def asked_of(problem: TourProblem) -> RouteRequirements:
    """Requirements of the bound, with the plan of fewest stops as the known one."""
    route = problem.route
    return problem.bound_problem(route.selection.chosen[route.order], seconds_of(route))


def corridor() -> Any:
    """Two rooms above a corridor that leads outside through a door at its left end."""
    walls = [
        wall("a", box(0, 1.9, 1.4, 2.1)),
        wall("b", box(2.4, 1.9, 5.4, 2.1)),
        wall("c", box(6.4, 1.9, 8, 2.1)),
        wall("d", box(3.9, 2.1, 4.1, 5)),
    ]
    rooms = [
        room("hall", box(0, 0, 8, 1.9)),
        room("left", box(0, 2.1, 3.9, 5)),
        room("right", box(4.1, 2.1, 8, 5)),
    ]
    openings = [
        door("l", (1.4, 2), (2.4, 2)),
        door("r", (5.4, 2), (6.4, 2)),
        door("out", (0, 0.5), (0, 1.5)),
    ]
    return floor_of(box(0, 0, 8, 5), rooms=rooms, openings=openings, elements=[shell(0, 0, 8, 5), *walls])


WORLDS = {
    "hall": (
        hall(9, 7, column("c1", 3.5, 3.5, 1.0), column("c2", 6.5, 3.0, 0.8)),
        {"grid": 2.6, "range": 3.2},
    ),
    "rooms": (two_rooms(1.0, at=1.2), {"grid": 1.3, "range": 2.2}),
    "corridor": (corridor(), {"grid": 1.9, "range": 2.5}),
}
CASES: list[dict[str, Any]] = [
    {},
    {"scan_time": 2.0, "settle": 1.0},
    {"start": (1.5, 1.2, 40.0)},
    {"start": (1.5, 1.2, 40.0), "tour": "open"},
    {"start": (1.5, 1.2, 0.0), "end": (3.0, 1.0), "scan_time": 10.0},
    {"tour": "closed", "scan_time": 10.0},
    {"views": 2},
    {"coverage": 0.7, "room_coverage": 0.4, "kind_coverage": 0.4, "scan_time": 5.0},
    {"use": ((1.5, 1.2),)},
    {"fov": 200.0, "scan_time": 20.0},
    {"speed": 0.1, "scan_time": 10.0, "turn_rate": 10.0},
]


@cache
def two_step(world: str, case: int = 0, **more: Any) -> Route:
    floor, changes = WORLDS[world]
    _, nouns = planned(floor, Settings(**{**BASIS, **changes, **CASES[case], **more}))
    found: Route = nouns[Route]
    return found


@cache
def joint(world: str, case: int) -> Route:
    return least_time_route(two_step(world, case))


def seconds_of(driven: Route) -> float:
    return schedule(assemble(driven)).total_s


@dataclass
class EveryTour:
    """All routes over all sets of candidates that see enough, timed by the schedule's own functions."""

    driven: Route
    best: float
    found: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        selection = self.driven.selection
        candidates = selection.candidates
        settings = candidates.settings
        self.cover, fixed, _ = cover_problem(selection.visibility)
        self.must = set(fixed.tolist())
        everywhere = replace(selection, chosen=np.arange(self.cover.rows))
        points, self.ends = points_and_ends(everywhere)
        self.legs = legs_between(candidates.space, points)
        self.robot = robot_of(settings)
        self.pause = settings.settle + settings.scan_time
        self.heading = candidates.heading[candidates.kept] if len(candidates.heading) else None
        self.rank = (
            rank_at_door(candidates, np.arange(self.cover.rows))[0] if settings.start is None else None
        )
        self.given = None if settings.start is None else math.radians(settings.start[2])
        self.closed = self.driven.tour == "closed"
        self.facts: dict[tuple[int, int], tuple[float, float, float] | None] = {}
        self.offered = np.flatnonzero(np.diff(self.cover.sees.indptr)).tolist()

    def run(self) -> float:
        """The least seconds of any, if that is less than `best`."""
        first = [self.ends.first] if self.given is not None else self.offered
        for point in first:
            assert point is not None
            if self.given is not None:
                self._on((), point, self.given, 0.0)
            else:
                self._stop((), point, None, 0.0)
        return self.best

    def _on(self, stops: tuple[int, ...], here: int, heading: float | None, spent: float) -> None:
        left = max(0, self.driven.selection.bound - len(stops))
        if spent + left * self.pause >= self.best - 1e-6:
            return
        if stops and self._enough(stops):
            self._end(stops, here, heading, spent)
        for row in self.offered:
            if row not in stops:
                self._leg(stops, here, row, heading, spent)

    def _leg(self, stops: tuple[int, ...], here: int, row: int, heading: float | None, spent: float) -> None:
        took, then = self._drive(here, row, heading)
        if (
            heading is None and self.heading is not None
        ):  # begun along the first leg, turned to the scan and back
            fact = self._fact(here, row)
            if fact is not None:
                took += 2 * turn_time(float(self.heading[here]) - fact[1], turn_rate=self.robot.turn_rate)
        self._stop(stops, row, then, spent + took)

    def _stop(self, stops: tuple[int, ...], row: int, heading: float | None, spent: float) -> None:
        if heading is not None and self.heading is not None:
            wanted = float(self.heading[row])
            spent += turn_time(wanted - heading, turn_rate=self.robot.turn_rate)
            heading = wanted
        self._on((*stops, row), row, heading, spent + self.pause)

    def _end(self, stops: tuple[int, ...], here: int, heading: float | None, spent: float) -> None:
        if self.rank is not None and min(stops, key=lambda row: self.rank[row]) != stops[0]:
            return
        if self.closed:
            spent += self._drive(here, stops[0] if self.given is None else self.ends.first, heading)[0]  # type: ignore[arg-type]
        elif self.ends.last is not None:
            spent += self._drive(here, self.ends.last, heading)[0]
        if spent < self.best:
            self.best, self.found = spent, list(stops)

    def _enough(self, stops: tuple[int, ...]) -> bool:
        rows = np.array(stops)
        return self.must <= set(stops) and not self.cover.missing(self.cover.covered_by(rows)).any()

    def _drive(self, a: int, b: int, heading: float | None) -> tuple[float, float | None]:
        fact = self._fact(a, b)
        if fact is None:
            return 0.0, heading
        seconds, first, last = fact
        turn = 0.0 if heading is None else turn_time(first - heading, turn_rate=self.robot.turn_rate)
        return seconds + turn, last

    def _fact(self, a: int, b: int) -> tuple[float, float, float] | None:
        if (a, b) not in self.facts:
            line = self.legs.path(a, b)
            if len(line) < 2:
                self.facts[a, b] = None
            else:
                first = math.atan2(*(line[1] - line[0])[::-1])
                drive, turn, last = leg_times(
                    [(float(x), float(y)) for x, y in line], heading=first, robot=self.robot
                )
                self.facts[a, b] = (drive + turn, first, last)
        return self.facts[a, b]


TRIED = [
    *(("hall", case) for case in (0, 1, 2, 3, 4, 5, 6, 7, 8, 10)),
    *(("rooms", case) for case in (0, 1, 3, 7, 8)),
    *(("corridor", case) for case in (0, 2, 4, 5, 7, 8)),
]


@pytest.mark.parametrize(("world", "case"), some(TRIED, every=5))
def test_no_choice_of_stops_and_order_takes_less_than_the_bound(world: str, case: int) -> None:
    driven, made = two_step(world, case), joint(world, case)
    assert made.time is not None
    assert made.time.two_step_s == pytest.approx(seconds_of(driven), abs=1e-9)
    assert made.time.seconds == pytest.approx(seconds_of(made), abs=1e-9)
    best = EveryTour(driven, made.time.seconds + 0.01).run()
    assert made.time.bound <= best + 1e-4
    assert best - 0.01 <= made.time.seconds <= made.time.two_step_s
    assert made.time.seconds <= 1.03 * best, "nor is much left to find"


@pytest.mark.parametrize(
    ("world", "case"), some([(world, case) for world in WORLDS for case in range(len(CASES))], every=4)
)
def test_a_plan_is_never_slower_and_sees_what_is_asked_for(world: str, case: int) -> None:
    driven, made = two_step(world, case), joint(world, case)
    assert made.time is not None
    assert made.time.bound <= made.time.seconds <= made.time.two_step_s == pytest.approx(seconds_of(driven))
    whole, fixed, _ = cover_problem(made.visibility)
    assert not whole.missing(whole.covered_by(made.selection.chosen)).any()
    assert set(fixed.tolist()) <= set(made.selection.chosen.tolist())
    assert sorted(made.order.tolist()) == list(range(len(made.selection.chosen)))
    assert (made.tour, made.start_reason) == (driven.tour, driven.start_reason)
    assert made.selection.coverage >= made.selection.required - 1e-9


@pytest.mark.parametrize(
    ("world", "case"), some([(world, case) for world in WORLDS for case in range(len(CASES))], every=6)
)
def test_the_times_of_the_search_are_those_of_the_schedule(world: str, case: int) -> None:
    """Of the route it begins with, and of the one that it ends with."""
    driven = two_step(world, case)
    problem = problem_of(driven)
    assert problem.times.total(problem.line) / MICROSECONDS == pytest.approx(seconds_of(driven), abs=1e-3)
    found = joint(world, case)
    assert found.time is not None
    if len(found.approaches[1]) == 1:
        return  # two scans at the place where it begins: only the schedule knows the heading of its first leg
    order = np.searchsorted(problem.rows, found.selection.chosen[found.order]).tolist()
    line = [order[0] if problem.begin is not None else problem.line[0], *order, problem.line[-1]]
    del line[: int(problem.begin is not None)]
    assert problem.times.total(line) / MICROSECONDS == pytest.approx(found.time.seconds, abs=1e-3)


def third_party(space: NavigableSpace, points: FloatArray) -> Paths:
    return grid_paths(space, points)


THIRD_PARTY = f"{__name__}:third_party"


@pytest.mark.parametrize(
    ("graph", "world"),
    some(
        [("grid", "rooms"), ("grid", "corridor"), (THIRD_PARTY, "corridor"), (THIRD_PARTY, "rooms")], every=2
    ),
)
def test_on_any_graph_the_search_has_the_times_that_are_driven(world: str, graph: str) -> None:
    driven = two_step(world, 3, graph=graph)
    problem, made = problem_of(driven), least_time_route(driven)
    assert made.time is not None and made.time.seconds < made.time.two_step_s
    order = np.searchsorted(problem.rows, made.selection.chosen[made.order]).tolist()
    total = problem.times.total([problem.line[0], *order, problem.line[-1]]) / MICROSECONDS
    assert total == pytest.approx(made.time.seconds, abs=1e-3) == seconds_of(made)


def test_paths_take_the_same_time_at_both_speeds(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problem_of(two_step("corridor"))
    assert machine_code(follow)
    robot = robot_of(problem.settings)
    fast = leg_table(problem.legs, robot)
    interpret(monkeypatch)
    slow = leg_table(problem.legs, robot)
    assert fast.spent.any()
    for name in ("spent", "leaving", "arriving"):
        assert np.array_equal(getattr(fast, name), getattr(slow, name))


@pytest.mark.parametrize("world", WORLDS)
def test_what_a_change_takes_is_what_the_whole_line_then_takes_more(world: str) -> None:
    for case in some((0, 3, 4, 9), every=2):
        problem = problem_of(two_step(world, case))
        times, line = problem.times, problem.line
        for leg in range(len(line) - 1):
            added = times.inserted(line, leg)
            for place in sorted(set(range(times.positions)) - set(line))[:6]:
                longer = [*line[: leg + 1], place, *line[leg + 1 :]]
                assert times.total(longer) - times.total(line) == added[place]
        turned = times.turned(line, 1)
        assert sorted(turned) == sorted(line)
        assert times.total(turned) <= times.total(line)


@pytest.mark.parametrize("world", WORLDS)
def test_no_reversal_shortens_a_line_that_was_turned(world: str) -> None:
    for case in (0, 2, 9):
        times, random = problem_of(two_step(world, case)).times, np.random.default_rng(case)
        inner = random.permutation(times.positions)[:6].tolist()
        free = len(times.scan) - 1
        line = times.turned([free, *inner, free], 1)
        total = times.total(line)
        for i in range(1, len(inner) + 1):
            for j in range(i + 1, len(inner) + 1):
                assert times.total([*line[:i], *line[i : j + 1][::-1], *line[j + 1 :]]) >= total


@pytest.mark.parametrize("world", WORLDS)
def test_the_search_goes_on_where_the_best_changes_leave_scans_unconnected(world: str) -> None:
    """Scans are connected only if every other position is unused: the search finds the same without them."""
    problem = problem_of(two_step(world, 1))
    task, positions = problem.task, problem.times.positions
    used = np.zeros(positions, dtype=bool)
    used[::2] = True
    used[problem.stops_of(problem.line)] = True
    none = np.where(used, 0, 10**9)
    found = shorter_line(problem.times, replace(task, joins=lambda stops: used), problem.line)
    dear = replace(problem.times, scan=problem.times.scan)
    dear.inserted = lambda line, leg: problem.times.inserted(line, leg) + none  # type: ignore[method-assign]
    assert found == shorter_line(dear, task, problem.line)
    assert used[problem.stops_of(found)].all()


def test_a_zone_is_left_by_no_selection_that_sees_enough() -> None:
    problem = problem_of(two_step("rooms", 0))
    zones, cover = asked_of(problem).zones, problem.task.cover
    assert zones.rows
    for rows in zones.rows:
        beyond = np.setdiff1d(np.arange(cover.rows), rows)
        assert cover.missing(cover.covered_by(beyond)).any()
    for packed in zones.packings:
        assert len(np.unique(np.concatenate(packed))) == sum(map(len, packed)), "no row is in two"


def test_scans_that_are_to_register_still_do() -> None:
    driven = two_step("rooms", 0, register=True)
    made = least_time_route(driven)
    links = links_of(made.candidates)
    pieces = [len(components_of(links, one.selection.chosen)) for one in (driven, made)]
    assert pieces[1] <= pieces[0]
    assert made.time is not None and made.time.seconds <= made.time.two_step_s


def test_of_very_many_candidates_the_nearest_are_tried_and_the_bound_is_over_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    every = joint("rooms", 2).time
    monkeypatch.setattr(stopgo.planner.covering_tour.problem, "MOST_POSITIONS", 8)
    some = least_time_route(two_step("rooms", 2)).time
    assert every is not None and some is not None
    assert 0 < some.bound <= every.seconds + 1e-4
    assert some.seconds <= some.two_step_s
    monkeypatch.setattr(stopgo.planner.covering_tour.least_time_bound, "FEW_NODES", 0)
    monkeypatch.setattr(stopgo.planner.covering_tour.least_time_bound, "FARTHEST_S", 5.0)
    near = least_time_route(two_step("rooms", 2)).time
    assert near is not None and 0 < near.bound <= every.seconds + 1e-4


@pytest.mark.parametrize(("world", "case"), [("hall", 0), ("rooms", 2), ("corridor", 0)])
def test_no_leg_takes_less_than_its_pieces_by_the_time_graph(world: str, case: int) -> None:
    """Of all legs between candidates, and most of them take no more than a tenth more."""
    problem = problem_of(two_step(world, case))
    graph, count = asked_of(problem).graph, len(problem.rows)
    assert count == len(problem.offered)
    least = dijkstra(graph.times(np.zeros(graph.nodes), []), indices=np.arange(count))[:, :count]
    spent = problem.times.table.spent[:count, :count] / MICROSECONDS
    assert (least <= spent + 1e-4).all()
    assert np.median(least[spent > 0] / spent[spent > 0]) > 0.9


SLOW = {"graph": "grid", "grid": 2.6, "turn_rate": 720.0, "acceleration": 0.05, "scan_time": 1.0}
DRIVEN_ON_GRIDS: list[tuple[str, dict[str, Any]]] = [
    ("corridor", {**SLOW, "start": (4.5, 3.3, 0.0), "tour": "open"}),
    ("hall", {**SLOW, "start": (2.7, 2.0, 0.0)}),
]


@pytest.mark.parametrize(("world", "more"), DRIVEN_ON_GRIDS)
def test_no_mission_on_a_grid_takes_less_than_the_bound(world: str, more: dict[str, Any]) -> None:
    """The grid through fewer stops may be coarser, and its paths longer with fewer corners."""
    driven = two_step(world, **more)
    asked = replace(asked_of(problem_of(driven)), known_s=math.inf)
    assert 0.5 * seconds_of(driven) < least_time(asked) <= seconds_of(driven)


def test_a_longer_way_on_a_grid_may_take_less_than_the_bound_by_shortest_paths() -> None:
    """It has fewer bends; the bound on a grid is that of any path."""
    ways = {**SLOW, "range": 3.3, "grid": 2.36, "coverage": 0.99, "start": (1.12, 1.17, 40.0), "speed": 0.2}
    floor = two_rooms(1.0, at=1.9)
    found = [
        planned(floor, Settings(**{**BASIS, **ways, "graph": graph}))[1][Route] for graph in ("exact", "grid")
    ]
    shortest, on_grid = (least_time_route(route).time for route in found)
    assert shortest is not None and on_grid is not None
    assert on_grid.bound <= on_grid.seconds < shortest.bound <= shortest.seconds


def test_on_a_grid_the_bound_over_very_many_candidates_is_that_of_the_stops(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stopgo.planner.covering_tour.time_graph, "MOST_POINTS", 8)
    for case in (0, 4):
        driven = two_step("rooms", case, graph="grid")
        asked = asked_of(problem_of(driven))
        assert asked.pause_s * asked.stops - 0.01 <= least_time(asked) <= seconds_of(driven)


def test_pieces_share_no_more_than_the_turn_between_them() -> None:
    """At one node, of pieces in sixteen directions, whatever its own direction."""
    angles = np.arange(16) * np.pi / 8
    edges = np.stack([np.zeros(16, np.int64), np.arange(1, 17)], axis=1)
    both = np.stack([angles, angles + np.pi], axis=1)
    xy = np.concatenate([np.zeros((1, 2)), np.stack([np.cos(angles), np.sin(angles)], axis=1)])
    graph = TimeGraph(xy, edges, np.full(16, 100.0), both, half_turn_s=4.0)
    direction = np.full(17, np.nan)
    direction[0] = 0.3
    share = graph.with_turns(direction).seconds - 100.0
    away = np.abs(np.remainder(angles[:, None] - angles[None, :] + np.pi, 2 * np.pi) - np.pi)
    turn = 4.0 * (1 - away / np.pi)
    assert (share[:, None] + share[None, :] <= turn + 1e-9).all()
    opposite = np.argwhere(np.isclose(away, np.pi))
    assert np.allclose(share[opposite].sum(axis=1), 0.0)


@pytest.mark.parametrize("seed", range(size(short=2, full=20)))
def test_the_bound_holds_at_any_prices(seed: int) -> None:
    problem, random = problem_of(two_step("rooms", 2)), np.random.default_rng(seed)
    best = joint("rooms", 2).time
    assert best is not None
    asked = asked_of(problem)
    one = _Relaxation(asked, asked.graph, asked.zones.packings[0], 0.0)
    prices = random.exponential(size=len(one.first_prices(0.0, 0.0))) * random.choice([0.1, 1.0, 30.0])
    assert one.at(prices).seconds <= best.seconds


def test_a_route_without_a_possible_stop_has_a_bound() -> None:
    asked = asked_of(problem_of(two_step("rooms")))
    none = np.empty(0, np.int64)
    cover = asked.cover.after(np.arange(asked.cover.rows))
    nowhere = replace(asked, cover=cover, zones=Zones([], none, none, cover.rows), stops=1)
    assert least_time(nowhere) == pytest.approx(nowhere.pause_s, abs=1e-3)


def test_one_stop_stays_one() -> None:
    _, nouns = planned(hall(4, 3), Settings(range=8, grid=2.0, minimise="time"))
    made: Route = nouns[Route]
    assert len(made.order) == 1
    assert made.time is not None
    assert made.time.bound == pytest.approx(made.time.seconds) == 62.0


@pytest.mark.parametrize("seed", range(size(short=1, full=40)))
def test_floors_at_random_are_never_planned_slower(seed: int) -> None:
    random = np.random.default_rng(seed)
    width, depth = random.uniform(6, 12, size=2).round(2).tolist()
    places = random.uniform((1, 1), (width - 1, depth - 1), size=(int(random.integers(0, 4)), 2)).round(2)
    floor = hall(width, depth, *(column(f"c{k}", x, y) for k, (x, y) in enumerate(places.tolist())))
    more: dict[str, Any] = {"scan_time": float(random.choice([0.0, 5.0, 60.0]))}
    if seed % 2:
        more |= {"grid": 1.5, "range": 3.0}
    settings = Settings(**{**BASIS, **more})
    before, _ = planned(floor, settings)
    after, nouns = planned(floor, replace(settings, minimise="time"))
    assert schedule(after).total_s <= schedule(before).total_s
    assert nouns[Route].time.bound <= schedule(after).total_s + 1e-9
    again, _ = planned(floor, replace(settings, minimise="time"))
    assert again == after
