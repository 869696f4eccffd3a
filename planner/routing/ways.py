"""Names of `planner.routing.paths` in 0.1, for plug-ins of `--graph`; they end with 0.3."""

from stopgo.planner.routing.paths import Paths as Ways
from stopgo.planner.routing.paths import shortest_paths as shortest_ways

__all__ = ["Ways", "shortest_ways"]
