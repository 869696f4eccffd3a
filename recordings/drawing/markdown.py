"""Markdown reports of a plan, and the properties that recordings contain."""

from __future__ import annotations

from typing import Any

import msgspec

from stopgo.mission.console.table import printable
from stopgo.mission.document import Mission
from stopgo.mission.files.stop_list import stop_list
from stopgo.mission.floor import FloorPlan
from stopgo.mission.stages import NavigableSpace
from stopgo.mission.stages.figures import Figures
from stopgo.mission.stages.plan_results import PlanResults, StageResults
from stopgo.recordings.drawing.canvas import LocalOrigin


def parameters(stages: StageResults) -> dict[str, Any] | None:
    """Return the parameters of the plan by name, if a stage result has them."""
    if NavigableSpace in stages:
        settings: dict[str, Any] = msgspec.to_builtins(stages[NavigableSpace].settings)
        return settings
    return stages[Mission].origin.parameters if Mission in stages else None


def parameter_values(values: dict[str, Any]) -> dict[str, str]:
    """Return the parameters as texts, so that each has one type whatever its value."""
    return {
        name: value if isinstance(value, str) else msgspec.json.encode(value).decode()
        for name, value in values.items()
    }


def plan_report(stages: StageResults, origin: LocalOrigin) -> str:
    """Return the plan as markdown."""
    results = PlanResults.of(stages).properties
    title = stages[Mission].name if Mission in stages else results.get("floor", "plan")
    lines = [f"# {title}", "", "| | |", "|---|---|"]
    lines += [f"| {name.replace('_', ' ')} | {_shown(value)} |" for name, value in _ordered(results)]
    lines += [
        "",
        *_coverage_table(stages.get(Figures)),
        *_stop_table(stages.get(Mission)),
        *_findings(stages),
    ]
    lines += ["## Colours", "", *_COLOURS, "", "## Looking around", "", *_GUIDE, *_origin_note(origin)]
    return "\n".join(lines)


FIRST = (
    *("stops", "stops_bound", "coverage", "coverage_required", "route_m", "route_bound_m"),
    *("planned_s", "least_time_bound_s", "two_step_s"),
)
"""Results listed first."""


def _ordered(results: dict[str, Any]) -> list[tuple[str, Any]]:
    names = [name for name in FIRST if name in results]
    names += [name for name in results if name not in FIRST]
    return [(name, results[name]) for name in names]


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    text = str(value)
    return f"`{text[:12]}…`" if len(text) >= 32 else text


def _stop_table(mission: Mission | None) -> list[str]:
    if mission is None or not mission.stops:
        return []
    lines = ["## Stops", "", "| stop | x m | y m | units covered | new |", "|---|---|---|---|---|"]
    names = ("stop", "x m", "y m", "units", "new")
    rows = (stop.cells for stop in stop_list(mission))
    return [*lines, *(f"| {' | '.join(row[name] for name in names)} |" for row in rows), ""]


def _coverage_table(figures: Figures | None) -> list[str]:
    """Return the coverage by room and kind, lowest first, and the rooms left out."""
    if figures is None:
        return []
    unit = figures.unit
    lines = ["## Coverage", "", f"| | all, {unit} | visible | covered | coverage |", "|---|---|---|---|---|"]
    for group in (figures.whole, *figures.kinds, *figures.rooms):
        lines.append(f"| {' | '.join((plain(group.name), *group.cells))} |")
    if figures.quality is not None:
        lines += ["", f"{figures.quality.text(unit)}:", ""]
        lines += [f"- {item.words}: {item.text}" for item in figures.quality.costs]
    if figures.unreached:
        lines += ["", "Not reached:", ""]
        lines += [f"- {plain(item.text)}" for item in figures.unreached]
    return [*lines, ""]


def plain(content: str) -> str:
    """Escape text from outside, so that markdown shows it letter by letter."""
    return "".join(f"\\{letter}" if letter in _MARKS else letter for letter in printable(content))


_MARKS = frozenset("\\`*_{}[]<>()#+-!|~")


def _findings(stages: StageResults) -> list[str]:
    holder = stages.get(Figures) or stages.get(NavigableSpace) or stages.get(FloorPlan)
    if holder is None or not holder.findings:
        return []
    return ["## Findings", "", *(f"- **{item.code}** {plain(item.message)}" for item in holder.findings), ""]


_COLOURS = (
    "- targets: blue covered, light grey not covered, dark grey visible from no candidate, yellow new",
    "- of a run: bold blue was scanned, thick orange-red was planned and lost; a cross is a stop left out",
    "- stops light green with their number, doorway stops light blue",
    "- route yellow, return path dark yellow; run purple",
    "- grey: stops and legs that a revision has withdrawn during a run",
    "- openings: white passable, orange-red not",
    "- candidates: yellow usable, reddish dropped; point at one for the reason",
    "- walls grey, columns orange, beams purple, stairs teal, windows and railings blue, holes rose",
)

_GUIDE = (
    "- timeline `mission_time`: the planned drive, and the field run when its recording is open too",
    "- timeline `candidate`: what each candidate sees (tab *Candidates*)",
    "- timeline `stage_step`: how the plan was made, step by step (tab *Planning*); the log describes each",
    "- timeline `stop`: why each stop is there (tab *Stops*); on `mission_time`, the stop that is driven to",
    "- walls in 3D are cut at a nominal 1.2 m: the drawing contains no heights",
)


def _origin_note(origin: LocalOrigin) -> list[str]:
    if origin == (0.0, 0.0):
        return []
    return [f"- positions shown are relative to x = {origin[0]:.0f} m, y = {origin[1]:.0f} m of the drawing"]
