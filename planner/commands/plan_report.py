"""Report of a plan that `stopgo plan` prints: one JSON object, or a few lines for a person."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from stopgo.mission.console.table import duration, printable
from stopgo.mission.document import Mission
from stopgo.mission.document.problems import Problem
from stopgo.mission.document.schedule import schedule
from stopgo.mission.floor import Finding, Rank
from stopgo.mission.plan import PartPlan
from stopgo.mission.stages import Route
from stopgo.mission.stages.figures import Figures, GroupCoverage, percent
from stopgo.mission.stages.network import (
    CONTROL_FRAME,
    Network,
    frame_of,
    network_lines,
    network_of,
    network_table,
)
from stopgo.mission.stages.seen_area import SeenSurface


@dataclass(frozen=True, eq=False)
class PlanReport:
    """A finished plan with its files and the seconds each stage took."""

    part: PartPlan
    files: dict[str, Path]
    times_s: dict[str, float]
    too_near: tuple[Problem, ...] = field(default=(), kw_only=True)
    """Stops and legs nearer to a body of the model than promised."""
    surface: SeenSurface | None = field(default=None, kw_only=True)
    """Area that the stops see by the model's solids; None for a floor that is no model."""

    @property
    def mission(self) -> Mission:
        return self.part.mission

    @property
    def figures(self) -> Figures:
        return self.part.figures

    @property
    def network(self) -> Network | None:
        """The overlaps that connect the scans; None if the plan has no overlap requirement."""
        return network_of(self.mission)

    @property
    def exit_code(self) -> int:
        """Exit code of the plan: 1 if it is one that `check` refuses.

        It comes too near a body, drives over lines that were not read, or is less accurate than required.
        """
        figures = self.figures
        return 1 if self.too_near or figures.crosses_ignored or figures.is_inaccurate else 0

    @property
    def strict_exit_code(self) -> int:
        """Exit code with `--strict`: also 1 if the plan leaves floor out or is doubtful."""
        return 1 if self.figures.unreached or self.figures.grave else self.exit_code

    def as_json(self) -> dict[str, Any]:
        """Return the object that `--json` prints."""
        results = self.part.results
        return {
            "floor": self._floor(),
            "mission": _attributes(self.mission, "id", "revision", "digest"),
            **self._stage_results(),
            **network_table(self.network),
            "coverage": coverage_table(self.figures),
            **quality_table(self.figures),
            "route": {
                "length_m": results.route_m,
                "bound_m": results.route_bound_m,
                "method": results.router,
                "tour": results.tour,
                "start": results.begins_at,
            },
            "schedule": _attributes(
                schedule(self.mission), "drive_s", "turn_s", "settle_s", "scan_s", "total_s"
            ),
            **time_table(self.part.route),
            "unreached": [_attributes(item, "room", "why", "area_m2") for item in self.figures.unreached],
            **({"too_near": [str(item) for item in self.too_near]} if self.too_near else {}),
            **({} if self.surface is None else {"surface": self.surface.as_json()}),
            "times_s": {key: round(value, 4) for key, value in self.times_s.items()},
            "files": {key: str(path) for key, path in self.files.items()},
        }

    def _stage_results(self) -> dict[str, Any]:
        """Counts of targets, candidates, visible units and stops, for JSON."""
        results, targets = self.part.results, self.part.visibility.targets
        by_kind = targets.by_kind(self.part.floor.elements)
        return {
            "targets": {
                "total": results.target_units,
                "raw": sum(targets.raw.get(kind, 0) for kind in by_kind),
                "by_kind": by_kind,
                "raw_by_kind": targets.raw,
            },
            "candidates": {
                "generated": results.candidates,
                "reachable": results.reachable_candidates,
                "strategy": results.strategy,
            },
            "visibility": {"visible": results.visible_units, "method": results.visibility},
            "selection": {
                "stops": results.stops,
                "coverage": results.coverage,
                "bound": results.stops_bound,
                "bound_over": self.part.selection.among,
                "method": results.selector,
            },
        }

    def _floor(self) -> dict[str, Any]:
        floor = self.part.space.floor
        return {
            "name": floor.name,
            "area_m2": floor.area,
            "reached_m2": self.figures.reached_m2,
            "rooms": len(floor.rooms),
            "openings": len(floor.openings),
            **({"status": dict(floor.status)} if floor.status else {}),
            "findings": [
                {"rank": f.rank.name.lower(), "code": f.code, "message": f.message}
                | {"element": f.element, "at": f.at}
                for f in self.figures.findings
            ],
        }

    @property
    def joined_mission(self) -> Mission:
        """The mission of all scans in the network."""
        return self.mission

    def _error_lines(self) -> list[str]:
        """Line on the scan with the greatest predicted error in the frame of its network."""
        mission = self.joined_mission
        errors = {stop.id: stop.error.major_m for stop in mission.stops if stop.error}
        if self.network is None or not self.network.overlaps or not errors:
            return []
        worst = max(errors, key=errors.__getitem__)
        at = f"{worst}: {1000 * errors[worst]:.1f} mm (standard deviation)"
        frame = frame_of(mission) or CONTROL_FRAME
        return [f"    error     predicted, in the frame of {frame}, at most at {at}"]

    def as_text(self) -> str:
        """Return the lines for a person: the plan, its coverage, the floor left out, and the findings."""
        result, figures = self.as_json(), self.figures
        floor, times = result["floor"], result["schedule"]
        lines = [
            f"{printable(floor['name'])}: {floor['area_m2']:.0f} m², {floor['rooms']} rooms, "
            f"{floor['openings']} openings; {floor['reached_m2']:.0f} of {figures.rooms_m2:.0f} m² reached",
            f"  targets     {result['targets']['total']} units, "
            f"{result['visibility']['visible']} visible from {result['candidates']['reachable']} candidates",
            f"  stops       {self.part.results.stops} ({self.part.results.bound_text})",
            *self._route_lines(result["route"]),
            f"  time        {times['total_s'] / 60:.0f} min: drive {times['drive_s']:.0f} s, "
            f"turn {times['turn_s']:.0f} s, settle {times['settle_s']:.0f} s, scan {times['scan_s']:.0f} s",
            *self._time_lines(),
            *quality_lines(figures),
            *network_lines(self.network),
            *self._error_lines(),
            *coverage_lines(figures),
            *([] if self.surface is None else self.surface.lines()),
        ]
        lines += [f"  unreached   {printable(room.text)}" for room in figures.unreached]
        lines += finding_lines(figures.findings)
        lines += [f"  too near    {printable(item.message)}" for item in self.too_near]
        return "\n".join([*lines, *self._file_lines()])

    def _route_lines(self, route: dict[str, Any]) -> list[str]:
        return [
            f"  route       {route['length_m']:.1f} m {route['tour']} "
            f"(no route is below {route['bound_m']:.1f} m), from {route['start']}"
        ]

    def _time_lines(self) -> list[str]:
        return time_lines(self.part.route)

    def _file_lines(self) -> list[str]:
        return [f"  {key:<11} {path}" for key, path in self.files.items()]


def time_table(route: Route) -> dict[str, Any]:
    """Time saved and the lower bound of the time, for JSON; empty if the plan minimises stops."""
    time = route.time
    if time is None:
        return {}
    return {
        "least_time": {
            "total_s": time.seconds,
            "bound_s": time.bound,
            "bound_over": "these candidates",
            "bound_paths": "shortest" if _is_by_shortest_paths(route) else "any",
            "two_step_s": time.two_step_s,
            "two_step_stops": time.two_step_stops,
            "saved_s": time.saved_s,
        }
    }


def time_lines(route: Route, whose: str = "") -> list[str]:
    """Lines on the time saved against the fewest stops with the shortest route, and on its lower bound."""
    time = route.time
    if time is None:
        return []
    before = f"{duration(time.two_step_s)} with {time.two_step_stops} stops"
    saved = f"{duration(time.saved_s)} less than" if time.saved_s >= 0.5 else "not less than"
    less = "less by shortest paths" if _is_by_shortest_paths(route) else "less"
    return [
        f"  least time  {whose}{duration(time.seconds)}, {saved} by fewest stops first ({before}); "
        f"no plan over these candidates takes {less} than {duration(math.floor(time.bound))}"
    ]


def _is_by_shortest_paths(route: Route) -> bool:
    """True if the lower bound of the time holds for shortest paths only, not for straight lines too."""
    return route.settings.graph == "exact"


def quality_table(figures: Figures) -> dict[str, Any]:
    """Limits on views and their cost in stops, for JSON; empty if every view counts."""
    quality = figures.quality
    if quality is None:
        return {}
    costs = [
        {"limit": item.limit, "stops": item.stops, "without": item.without, "bound_without": item.bound}
        for item in quality.costs
    ]
    return {"limits": {"in_sight": quality.in_sight, "possible": quality.possible, "costs": costs}}


def quality_lines(figures: Figures) -> list[str]:
    """Lines on the limits on views, and on the approximate cost of each limit in stops."""
    quality = figures.quality
    if quality is None:
        return []
    lines = [f"  limits      {quality.text(figures.unit)}"]
    return lines + [f"    {item.words:<29} {item.text}" for item in quality.costs]


MOST_ROOMS = 12
"""Rooms listed on a terminal; coverage.json and --json have all."""
MOST_FINDINGS = 12


def coverage_table(figures: Figures) -> dict[str, Any]:
    """Every row of the coverage table, for JSON."""
    return {
        "rule": figures.rule,
        "total": _row(figures.whole),
        "rooms": [_row(group) for group in figures.rooms],
        "kinds": [_row(group) for group in figures.kinds],
    }


def _row(group: GroupCoverage) -> dict[str, Any]:
    return _attributes(group, "name", "total", "visible", "seen", "coverage", "required", "why")


def _attributes(source: object, *names: str) -> dict[str, Any]:
    """Return attributes of an object by their names, for JSON."""
    return {name: getattr(source, name) for name in names}


def coverage_lines(figures: Figures) -> list[str]:
    """The coverage table: the whole, then kinds and rooms, the one least seen first."""
    whole, unit = figures.whole, figures.unit
    lines = [
        f"  coverage    {percent(whole.coverage)} of the {percent(whole.visible_fraction)} that is visible "
        f"(covered {whole.seen:.0f} of visible {whole.visible:.0f} of all {whole.total:.0f} {unit})"
    ]
    lines += [_line("kind", group, unit) for group in figures.kinds]
    lines += [_line("room", group, unit) for group in figures.rooms[:MOST_ROOMS]]
    rest = figures.rooms[MOST_ROOMS:]
    if rest:
        lines.append(
            f"    rooms     {len(rest)} more, none below {percent(rest[0].coverage)} of what is visible"
        )
    return lines


def _line(kind: str, group: GroupCoverage, unit: str) -> str:
    seen = f"{group.seen:.1f} of {group.visible:.1f} of {group.total:.1f} {unit}"
    return f"    {kind:<9} {printable(group.name):<24} {percent(group.coverage):>7}  {seen}"


def finding_lines(findings: Sequence[Finding]) -> list[str]:
    """Lines of the most important findings, and the number of the others by code."""
    shown = [item for item in findings if item.rank != Rank.NOTE][:MOST_FINDINGS]
    lines = [f"  {_word(item):<11} {printable(item.message)}" for item in shown]
    rest = Counter(item.code for item in findings if item not in shown)
    if rest:
        counts = ", ".join(f"{count} {code}" for code, count in sorted(rest.items()))
        lines.append(f"  finding     {rest.total()} more: {counts} (--json lists them)")
    return lines


def _word(finding: Finding) -> str:
    return "warning" if finding.rank == Rank.GRAVE else "finding"
