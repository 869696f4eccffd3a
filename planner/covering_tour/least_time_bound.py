"""Lower bound on the time of every plan over the candidates, for any choice of stops and any route.

Targets, demands and the number of stops have prices. A stop costs its pause less what it earns by them, and
the route then need not see anything (Geoffrion, "Lagrangean relaxation for integer programming", 1974). But
every plan has a stop in each *zone* of a set of zones. So the rest of the route's time is at least that of a
shortest tour over the zones. Between two zones it takes at least the quickest path between any two of
their candidates, also by way of other stops, with their costs; each leg has half the cost of the stops at
its ends. The tour is bounded by one-trees (Held and Karp, 1970).

Prices rise and fall by Polyak's rule. Any prices prove a bound, so nothing depends on how they were found.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.covering_tour.time_graph import BLOCK, FARTHEST_S, TimeGraph
from stopgo.planner.covering_tour.zones import Zones
from stopgo.planner.routing.path_trees import NONE, trees_to_groups
from stopgo.planner.routing.tour import NANOMETRES, best_of_all, length_of, nanometres
from stopgo.planner.routing.tour_bound import growing, highest, one_tree
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.multiplier_bound import PricedCover, multiplier_prices

DETOUR_S = 3.0
"""Cost of each stop at first, when only their number has a price."""
EARNED = (0.0, 0.3)
"""Fractions of a stop's cost that targets and demands may pay at first; the rest is the number's price."""
WORK = 180_000_000
"""Pieces of paths evaluated in all steps together."""
FEWEST_STEPS, MOST_STEPS = 15, 240
FIRST_STEP, AIM, SMOOTHING, PATIENCE = 1.5, 1.2, 0.2, 8
"""The first step as a multiple of Polyak's for AIM times the best bound; as in the multiplier bound."""
NEAREST = 24
"""Zones next to each that paths are found to."""
FEW_NODES = 2_000_000
"""Nodes times zones up to which all paths are found."""
FIRST_TREES, FIRST_STEP_OF_WEIGHTS = 1500, 2.0
"""One-trees at the first prices, and the first change of weights, as in `tour_bound`."""
TREES, STEP_OF_WEIGHTS = 150, 0.2
"""The same at further prices, from the weights of the former."""
TREE_WORK = 1_000_000_000
"""Edges examined in the one-trees of each step; of very many zones there are fewer."""
FEWEST_TREES = 60
WEIGHTS = (0.05, 20.0)
"""Least and largest weight of a column, as a multiple of the mean, by whose root its price changes faster."""
DEMAND_STEP = 10.0
"""How much faster prices of demands change than those of columns."""
MANY_ZONES = 200
"""Zones of which only one set is tried."""
GAIN_S = 0.05
"""Seconds below which a bound is no better."""
LEAST_NORM = 1e-12
FIRST_PRICES = 100
"""Steps of the multiplier bound, for the first prices."""
FEW = 9
"""Points up to which all tours are compared."""
LONGEST_S = 1e5
"""Most seconds that a path counts for."""
NO_TIME = 1e-6
"""Seconds above all that stand for none on a path, and above the rounding of a tour's edge."""
NOISE = 1e-9
"""Rounding error of a bound, as a fraction of all amounts that it sums up."""


@dataclass(frozen=True, eq=False)
class RouteRequirements:
    """Requirements on a route; its points are candidates, as the rows of `cover`, then start and end."""

    graph: TimeGraph
    """Its first nodes are the points."""
    cover: Cover
    """What is to be seen besides what the required rows see."""
    zones: Zones
    start: int | None
    end: int | None
    closed: bool
    stops: int
    """Lower bound on the number of stops."""
    found: int
    """Stops of a known plan."""
    known_s: float
    """Time of a known plan."""
    pause_s: float
    directions: FloatArray
    """Heading in the middle between the legs of a good route at each candidate, NaN for none (rows,)."""

    @property
    def outer(self) -> list[int]:
        """Start and end, if they are given."""
        return [end for end in (self.start, self.end) if end is not None]

    @property
    def legs_without_turn(self) -> int:
        """Number of legs at whose stop there may be no turn: the first and the last without a given end."""
        if self.closed:
            return 0 if self.start is not None else 2
        return (self.start is None) + (self.end is None)


def least_time(route: RouteRequirements) -> float:
    """Lower bound in seconds on such a route."""
    directions = np.full(route.graph.nodes, np.nan)
    directions[: len(route.directions)] = route.directions
    turned = route.graph.with_turns(directions)
    sets = route.zones.packings
    if len(sets[0]) > MANY_ZONES:
        sets = sets[:1]
    found = [_Relaxation(route, route.graph, zones, 0.0) for zones in sets]
    plain = found[0]
    if len(found) > 1:
        values = [one.at(one.first_prices(0.0, DETOUR_S)).seconds for one in found]
        plain = found[int(np.argmax(values))]
    lost = route.legs_without_turn * turned.half_turn_s / 2
    both = [plain, _Relaxation(route, turned, plain.zones, lost)]
    values = [one.at(one.first_prices(0.0, DETOUR_S)).seconds for one in both]
    best = both[int(np.argmax(values))]
    return max(0.0, best.at(best.first_prices(0.0, 0.0)).seconds, _highest(best))


class _Bound(NamedTuple):
    """A bound at some prices, what it rises by with each price, and the pieces of paths evaluated for it."""

    seconds: float
    slope: FloatArray
    work: int


class _Relaxation:
    """Bounds of a route over some zones, on a graph from whose times `lost` seconds are not spent.

    Prices are those of columns, of all demands but the whole, and of the number of stops.
    """

    def __init__(
        self, route: RouteRequirements, graph: TimeGraph, zones: list[IntArray], lost: float
    ) -> None:
        self._route, self._graph, self._lost = route, graph, lost
        self._priced = PricedCover(route.cover)
        self._sees = route.cover.sees.astype(float)
        self.zones = zones
        self._outer = [np.array([end]) for end in route.outer]
        self._zones = [*self._outer, *zones]
        self._group = np.full(graph.nodes + len(self._zones), NONE, dtype=np.int64)
        """Number of the zone of each node."""
        for number, zone in enumerate(self._zones):
            self._group[zone] = number
        self.known_s, self._rows = route.known_s, route.cover.rows
        self._weight: IntArray | None = None
        """Weights of the zones at the former prices."""
        weight = route.cover.weight / max(1, route.cover.total) * route.cover.columns
        demands = np.full(len(route.cover.needed) - 1, DEMAND_STEP)
        self.steps = np.concatenate([np.sqrt(np.clip(weight, *WEIGHTS)), demands, [1.0]])
        """How much faster each price changes."""

    def first_prices(self, earned: float, rest: float) -> FloatArray:
        """Prices at which targets and demands pay this fraction of a stop, and `rest` seconds stay."""
        route = self._route
        paid = max(0.0, route.pause_s - rest)
        prices = np.zeros(route.cover.columns + len(route.cover.needed) - 1)
        if earned and route.cover.needed.any():
            prices = multiplier_prices(self._priced, found=route.found, steps=FIRST_PRICES)[1]
        return np.append(prices * paid * earned, paid * (1 - earned))

    def at(self, prices: FloatArray) -> _Bound:
        """The bound at these prices, and its slope."""
        route, priced, cover = self._route, self._priced, self._route.cover
        column, demand, each = prices[: cover.columns], prices[cover.columns : -1], prices[-1]
        rest = route.pause_s - each - self._sees @ column
        tour = self._tour(np.maximum(rest, 0.0))
        visits = np.where(rest < 0, 1.0, tour.slope)
        covered, left = priced.bought(column, demand)
        whole = covered + each * route.stops + np.minimum(rest, 0.0).sum() + tour.seconds - self._lost
        noise = NOISE * (self._rows * route.pause_s + abs(covered) + each * route.stops + tour.seconds)
        slope = np.concatenate([left, [route.stops - visits.sum()]])
        slope[: cover.columns] -= self._sees.T @ visits
        return _Bound(whole - noise, slope, tour.work)

    def _tour(self, rest: FloatArray) -> _Bound:
        """Bound on the tour over the zones with the rest of each stop's cost, and its visits (rows,)."""
        if not self._zones:
            return _Bound(0.0, np.zeros(self._rows), 0)
        more = np.zeros(self._graph.nodes)
        more[: self._rows] = rest
        seconds, nearest, ways, work = self._between(more)
        begin = np.array([zone[np.argmin(more[zone])] for zone in self._zones], dtype=np.int64)
        cost, beyond = self._cost(seconds, more[begin] / 2)
        value, pairs, self._weight = _least_tour(nanometres(cost), self._weight)
        count = len(self._zones)
        inside = pairs[(pairs < count).all(axis=1)]
        ends = pairs[(pairs >= count).any(axis=1)].min(axis=1)
        visits = np.bincount(begin[ends], minlength=self._graph.nodes) / 2
        is_found = nearest[tuple(inside.T)] >= 0
        for first, last in np.where(is_found[:, None], inside, inside[:, ::-1]).tolist():
            node = int(nearest[first, last])
            while 0 <= node < self._graph.nodes:
                begins = _before(ways[first], node)
                visits[node] += 0.5 if node == nearest[first, last] or begins >= self._graph.nodes else 1.0
                node = begins
        return _Bound(max(0.0, value / NANOMETRES - beyond), visits[: self._rows], work)

    def _between(self, more: FloatArray) -> tuple[FloatArray, IntArray, list[tuple[IntArray, IntArray]], int]:
        """Least seconds between zones, the row where each is reached from each, and the pieces evaluated.

        A zone that is not among the nearest of another is at least as far from it as the last of these.
        """
        zones, nodes = self._zones, self._graph.nodes
        limit = np.inf if nodes * len(zones) <= FEW_NODES else FARTHEST_S
        times = self._graph.times(more, zones)
        seconds = np.empty((len(zones), len(zones)))
        nearest = np.full(seconds.shape, -1, dtype=np.int64)
        ways: list[tuple[IntArray, IntArray]] = []
        for k in range(0, len(zones), BLOCK):
            some = slice(k, min(k + BLOCK, len(zones)))
            sources = np.arange(nodes + some.start, nodes + some.stop)
            away, before, ends = trees_to_groups(times, sources, self._group, NEAREST + 1, limit=limit)
            for row in before:
                reached = np.flatnonzero(row >= 0)
                ways.append((reached, row[reached]))
            for j, zone in enumerate(zones):
                near = away[:, zone]
                at = np.argmin(near, axis=1)
                least = near[np.arange(len(near)), at]
                nearest[some, j] = np.where(np.isfinite(least), zone[at], -1)
                seconds[some, j] = np.minimum(least, ends)
        seconds = np.clip(np.maximum(seconds, seconds.T) - NO_TIME, 0.0, LONGEST_S)
        np.fill_diagonal(seconds, 0.0)
        pieces = sum(len(reached) for reached, _ in ways) * times.nnz // max(1, nodes)
        return seconds, nearest, ways, pieces

    def _cost(self, seconds: FloatArray, ending: FloatArray) -> tuple[FloatArray, float]:
        """The matrix of a closed tour, and the seconds by which its tours are longer than the route.

        An open route gets one more point between its last and its first. `ending` are the seconds between
        it and each zone, if the route may end there.
        """
        if self._route.closed:
            return seconds, 0.0
        fixed = len(self._outer)
        far = float(np.ceil(3 * seconds.max(initial=0.0)) + 1) if fixed else 0.0
        extra = ending + far
        extra[:fixed] = 0.0
        cost = np.block([[seconds, extra[:, None]], [extra[None, :], np.zeros((1, 1))]])
        return cost, far if fixed == 1 and len(seconds) > 1 else 0.0


def _before(way: tuple[IntArray, IntArray], node: int) -> int:
    return int(way[1][np.searchsorted(way[0], node)])


def _least_tour(cost: IntArray, start: IntArray | None) -> tuple[int, IntArray, IntArray | None]:
    """Lower bound on a closed tour over the points, in the unit of `cost`, its edges (n, 2), and weights.

    The search for weights begins at those of a similar matrix, if there are any.
    """
    count = len(cost)
    if count <= FEW:
        order = best_of_all(cost)
        return length_of(cost, order), np.stack([order, np.roll(order, -1)], axis=1), None
    if start is None:
        trees, step = FIRST_TREES, FIRST_STEP_OF_WEIGHTS
    else:
        trees, step = TREES, STEP_OF_WEIGHTS
    trees = min(trees, max(FEWEST_TREES, TREE_WORK // count**2))
    most = np.iinfo(np.int64).max
    value, weight = highest(growing(cost), count, best=most, steps=trees, first_step=step, start=start)
    tree = one_tree(cost, weight)
    last = np.argsort(tree.costs[-1, :-1], kind="stable")[:2]
    first, second = [*tree.reached[1:], *last], [*tree.before[1:], count - 1, count - 1]
    return value, np.stack([first, second], axis=1), weight


def _highest(relaxation: _Relaxation) -> float:
    """The highest bound found from some first prices, and on from the best."""
    first = [relaxation.first_prices(earned, DETOUR_S) for earned in EARNED]
    steps = min(MOST_STEPS, max(FEWEST_STEPS, WORK // max(1, relaxation.at(first[0]).work)))
    found = [_raised(relaxation, prices, steps // 5) for prices in first]
    seconds, prices = max(found, key=lambda one: one[0])
    return max(seconds, _raised(relaxation, prices, steps - len(first) * (steps // 5))[0])


def _raised(relaxation: _Relaxation, prices: FloatArray, steps: int) -> tuple[float, FloatArray]:
    """The best bound of so many steps, and its prices."""
    best, best_prices, step, waited, direction = 0.0, prices, FIRST_STEP, 0, np.zeros(len(prices))
    for _ in range(steps):
        bound = relaxation.at(prices)
        waited = 0 if bound.seconds > best + GAIN_S else waited + 1
        if bound.seconds > best:
            best, best_prices = bound.seconds, prices
        slope = bound.slope * relaxation.steps
        direction = SMOOTHING * slope + (1 - SMOOTHING) * direction if direction.any() else slope
        norm = float((direction * direction).sum())
        if best >= relaxation.known_s or norm < LEAST_NORM:
            break
        if waited >= PATIENCE:
            step, waited = step / 2, 0
        aim = min(AIM * best, relaxation.known_s)
        prices = np.maximum(0.0, prices + step * (aim - bound.seconds) / norm * direction * relaxation.steps)
    return best, best_prices
