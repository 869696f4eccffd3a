"""Results of a plan in numbers: one set for terminal, JSON, page, printed plan and recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import Schedule
from stopgo.mission.floor import FloorPlan
from stopgo.mission.stages import Candidates, LeastTime, NavigableSpace, Route, Selection, Visibility
from stopgo.mission.stages.figures import Figures

StageResults = Mapping[type, Any]
"""Results of stages by their types; a plan that is being made has the first ones only."""

ROUNDED = {
    **{"area_m2": 2, "coverage": 4, "route_m": 3, "route_bound_m": 3},
    **{"planned_s": 1, "least_time_bound_s": 1, "two_step_s": 1},
}
"""Digits after the point in a recording."""


@dataclass(frozen=True, kw_only=True)
class PlanResults:
    """The numbers of each stage; None where a stage was not reached, or does not have the number."""

    floor: str | None = None
    floor_digest: str | None = None
    area_m2: float | None = None
    rooms: int | None = None
    openings: int | None = None
    findings: int | None = None
    """Number of findings of all stages so far."""
    passable_openings: int | None = None
    target_units: int | None = None
    candidates: int | None = None
    reachable_candidates: int | None = None
    strategy: str | None = None
    visible_units: int | None = None
    visibility: str | None = None
    stops: int | None = None
    stops_bound: int | None = None
    """Lower bound of the number of stops."""
    stops_bound_over: str | None = None
    """Range of the bound in words; None if it is over the candidates."""
    coverage: float | None = None
    coverage_required: float | None = None
    selector: str | None = None
    route_m: float | None = None
    route_bound_m: float | None = None
    tour: str | None = None
    router: str | None = None
    begins_at: str | None = None
    least_time_bound_s: float | None = None
    two_step_s: float | None = None
    """Seconds by the fewest stops and then a shortest route over them."""
    two_step_stops: int | None = None
    planned_s: float | None = None
    mission_id: str | None = None
    revision: int | None = None
    digest: str | None = None
    stopgo: str | None = None

    @classmethod
    def of(cls, stages: StageResults) -> PlanResults:
        """Return the numbers of the stages that were reached."""
        values: dict[str, Any] = {}
        for kind, numbers in _NUMBERS.items():
            if kind in stages:
                values.update(numbers(stages[kind]))
        return cls(**values)

    @classmethod
    def read(cls, properties: Mapping[str, Any]) -> PlanResults:
        """Return the numbers that `properties` wrote; others are left out."""
        names = {item.name for item in fields(cls)}
        return cls(**{name: value for name, value in properties.items() if name in names})

    @property
    def properties(self) -> dict[str, Any]:
        """The known numbers by name, rounded, as a recording has them."""
        known = {name: value for name, value in asdict(self).items() if value is not None}
        return {
            name: round(float(value), ROUNDED[name]) if name in ROUNDED else value
            for name, value in known.items()
        }

    @property
    def bound_text(self) -> str:
        """The lower bound of the stops in words; empty if it is not known."""
        over = self.stops_bound_over or "these candidates"
        return "" if self.stops_bound is None else f"of {over} at least {self.stops_bound} are needed"


def _floor(floor: FloorPlan) -> dict[str, Any]:
    counts = {"rooms": len(floor.rooms), "openings": len(floor.openings), "findings": len(floor.findings)}
    return {"floor": floor.name, "floor_digest": floor.digest, "area_m2": floor.area, **counts}


def _space(space: NavigableSpace) -> dict[str, Any]:
    return {
        "passable_openings": sum(state.passable for state in space.openings),
        "target_units": space.targets.total,
        "findings": len(space.findings),  # those of the floor are among them
    }


def _candidates(candidates: Candidates) -> dict[str, Any]:
    return {
        "candidates": candidates.generated,
        "reachable_candidates": candidates.reachable,
        "strategy": candidates.strategy,
    }


def _visibility(visibility: Visibility) -> dict[str, Any]:
    return {"visible_units": int(visibility.visible.sum()), "visibility": visibility.method}


def _selection(selection: Selection) -> dict[str, Any]:
    return {
        "stops": len(selection.chosen),
        "stops_bound": int(selection.bound),
        "stops_bound_over": selection.among if selection.everywhere else None,
        "coverage": selection.coverage,
        "coverage_required": float(selection.required),
        "selector": selection.method,
    }


def _route(route: Route) -> dict[str, Any]:
    time = {} if route.time is None else _least_time(route.time)
    return {
        "route_m": route.length,
        "route_bound_m": route.bound,
        "tour": route.tour,
        "router": route.method,
        "begins_at": route.start_reason,
        **time,
    }


def _least_time(time: LeastTime) -> dict[str, Any]:
    return {
        "least_time_bound_s": time.bound,
        "two_step_s": time.two_step_s,
        "two_step_stops": time.two_step_stops,
    }


def _mission(mission: Mission) -> dict[str, Any]:
    named = {"mission_id": mission.id, "revision": mission.revision, "digest": mission.digest}
    return {**named, "stopgo": mission.origin.stopgo}


_NUMBERS: dict[type, Any] = {
    FloorPlan: _floor,
    NavigableSpace: _space,
    Candidates: _candidates,
    Visibility: _visibility,
    Selection: _selection,
    Route: _route,
    Schedule: lambda schedule: {"planned_s": schedule.total_s},
    Mission: _mission,
    Figures: lambda figures: {"findings": len(figures.findings)},  # of all stages, not of the floor alone
}
