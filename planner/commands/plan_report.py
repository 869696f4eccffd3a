"""What `stopgo plan` tells of a plan: one object for machines, a few lines for a person."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stopgo.mission.console.table import duration, printable
from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule
from stopgo.mission.floor import Finding, Rank
from stopgo.mission.plan import PartPlan
from stopgo.mission.stages import Route
from stopgo.mission.stages.figures import Figures, Share, percent
from stopgo.mission.stages.network import Network, network_lines, network_of, network_table


@dataclass(frozen=True, eq=False)
class PlanReport:
    """A finished plan with its files and the seconds each stage took."""

    part: PartPlan
    files: dict[str, Path]
    times_s: dict[str, float]

    @property
    def mission(self) -> Mission:
        return self.part.mission

    @property
    def figures(self) -> Figures:
        return self.part.figures

    @property
    def network(self) -> Network | None:
        """How the scans hang together; None where nobody asked for it."""
        return network_of(self.mission)

    @property
    def answer(self) -> int:
        """Exit code of a plan: 1 where the robot would drive over lines that nobody has read."""
        return 1 if self.figures.crosses_ignored else 0

    @property
    def strict_answer(self) -> int:
        """Exit code where nothing may be left out or doubtful."""
        return 1 if self.figures.unreached or self.figures.grave else self.answer

    def as_json(self) -> dict[str, Any]:
        """The object that `--json` prints."""
        selection = self.part.selection
        visibility = selection.visibility
        candidates = visibility.candidates
        space, targets = candidates.space, visibility.targets
        times = schedule(self.mission)
        return {
            "floor": self._floor(),
            "mission": {
                "id": self.mission.id,
                "revision": self.mission.revision,
                "digest": self.mission.digest,
            },
            "targets": {
                "total": targets.total,
                "raw": sum(targets.raw.get(kind, 0) for kind in targets.by_kind(space.floor.elements)),
                "by_kind": targets.by_kind(space.floor.elements),
                "raw_by_kind": targets.raw,
            },
            "candidates": {
                "generated": candidates.generated,
                "reachable": candidates.reachable,
                "strategy": candidates.strategy,
            },
            "visibility": {"visible": int(visibility.visible.sum()), "method": visibility.method},
            "selection": {
                "stops": len(selection.chosen),
                "coverage": selection.coverage,
                "bound": selection.bound,
                "bound_over": selection.among,
                "method": selection.method,
            },
            **network_table(self.network),
            "coverage": coverage_table(self.figures),
            **quality_told(self.figures),
            "route": {
                "length_m": self.part.route.length,
                "bound_m": self.part.route.bound,
                "method": self.part.route.method,
                "tour": self.part.route.tour,
                "start": self.part.route.start_reason,
            },
            "schedule": {
                "drive_s": times.drive_s,
                "turn_s": times.turn_s,
                "settle_s": times.settle_s,
                "scan_s": times.scan_s,
                "total_s": times.total_s,
            },
            **time_told(self.part.route),
            "unreached": [
                {"room": item.room, "why": item.why, "area_m2": item.area_m2}
                for item in self.figures.unreached
            ],
            "times_s": {key: round(value, 4) for key, value in self.times_s.items()},
            "files": {key: str(path) for key, path in self.files.items()},
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

    def as_text(self) -> str:
        """What a person reads: the plan, what it sees, what it leaves out, and what is doubtful."""
        told, figures = self.as_json(), self.figures
        floor, times, chosen = told["floor"], told["schedule"], told["selection"]
        lines = [
            f"{printable(floor['name'])}: {floor['area_m2']:.0f} m², {floor['rooms']} rooms, "
            f"{floor['openings']} openings; {floor['reached_m2']:.0f} of {figures.rooms_m2:.0f} m² reached",
            f"  targets     {told['targets']['total']} units, "
            f"{told['visibility']['visible']} visible from {told['candidates']['reachable']} candidates",
            f"  stops       {chosen['stops']} "
            f"(of {chosen['bound_over']} at least {chosen['bound']} are needed)",
            *self._way_lines(told["route"]),
            f"  time        {times['total_s'] / 60:.0f} min: drive {times['drive_s']:.0f} s, "
            f"turn {times['turn_s']:.0f} s, settle {times['settle_s']:.0f} s, scan {times['scan_s']:.0f} s",
            *self._time_lines(),
            *quality_lines(figures),
            *network_lines(self.network),
            *coverage_lines(figures),
        ]
        lines += [
            f"  unreached   {printable(u.room)} ({u.area_m2:.1f} m²): {printable(u.why)}"
            for u in figures.unreached
        ]
        lines += finding_lines(figures.findings)
        return "\n".join([*lines, *self._file_lines()])

    def _way_lines(self, route: dict[str, Any]) -> list[str]:
        return [
            f"  route       {route['length_m']:.1f} m {route['tour']} "
            f"(no route is below {route['bound_m']:.1f} m), from {route['start']}"
        ]

    def _time_lines(self) -> list[str]:
        return time_lines(self.part.route)

    def _file_lines(self) -> list[str]:
        return [f"  {key:<11} {path}" for key, path in self.files.items()]


def time_told(route: Route) -> dict[str, Any]:
    """What was saved and what can be, for JSON; nothing where stops were to be fewest."""
    time = route.time
    if time is None:
        return {}
    return {
        "least_time": {
            "total_s": time.seconds,
            "bound_s": time.bound,
            "bound_over": "these candidates",
            "two_step_s": time.two_step_s,
            "two_step_stops": time.two_step_stops,
            "saved_s": time.saved_s,
        }
    }


def time_lines(route: Route, whose: str = "") -> list[str]:
    """What was saved against fewest stops and then the shortest way, and what no plan is below."""
    time = route.time
    if time is None:
        return []
    before = f"{duration(time.two_step_s)} with {time.two_step_stops} stops"
    saved = f"{duration(time.saved_s)} less than" if time.saved_s >= 0.5 else "not less than"
    return [
        f"  least time  {whose}{duration(time.seconds)}, {saved} by fewest stops first ({before}); "
        f"no plan over these candidates takes less than {duration(math.floor(time.bound))}"
    ]


def quality_told(figures: Figures) -> dict[str, Any]:
    """How well targets are to be seen, for JSON; nothing where any view counts."""
    quality = figures.quality
    if quality is None:
        return {}
    costs = [
        {"limit": item.limit, "stops": item.stops, "without": item.without, "bound_without": item.bound}
        for item in quality.costs
    ]
    return {"limits": {"in_sight": quality.in_sight, "possible": quality.possible, "costs": costs}}


def quality_lines(figures: Figures) -> list[str]:
    """How well targets are to be seen, and about how many stops each limit costs."""
    quality = figures.quality
    if quality is None:
        return []
    lines = [f"  seen well   {quality.text(figures.unit)}"]
    return lines + [f"    {item.words:<29} {item.text}" for item in quality.costs]


MOST_ROOMS = 12
"""Rooms listed on a terminal; coverage.json and --json have all."""
MOST_FINDINGS = 12


def coverage_table(figures: Figures) -> dict[str, Any]:
    """Every row of the coverage table, for JSON."""
    return {
        "rule": figures.rule,
        "total": _row(figures.whole),
        "rooms": [_row(share) for share in figures.rooms],
        "kinds": [_row(share) for share in figures.kinds],
    }


def _row(share: Share) -> dict[str, Any]:
    keys = ("name", "total", "visible", "seen", "coverage", "required", "why")
    return {key: getattr(share, key) for key in keys}


def coverage_lines(figures: Figures) -> list[str]:
    """The coverage table: the whole, then kinds and rooms, the one least seen first."""
    whole, unit = figures.whole, figures.unit
    lines = [
        f"  coverage    {percent(whole.coverage)} of the {percent(whole.visible_share)} that can be seen "
        f"(seen {whole.seen:.0f} of visible {whole.visible:.0f} of all {whole.total:.0f} {unit})"
    ]
    lines += [_line("kind", share, unit) for share in figures.kinds]
    lines += [_line("room", share, unit) for share in figures.rooms[:MOST_ROOMS]]
    rest = figures.rooms[MOST_ROOMS:]
    if rest:
        lines.append(
            f"    rooms     {len(rest)} more, none below {percent(rest[0].coverage)} of what can be seen"
        )
    return lines


def _line(what: str, share: Share, unit: str) -> str:
    seen = f"{share.seen:.1f} of {share.visible:.1f} of {share.total:.1f} {unit}"
    return f"    {what:<9} {printable(share.name):<24} {percent(share.coverage):>7}  {seen}"


def finding_lines(findings: Sequence[Finding]) -> list[str]:
    """The findings that bear on the plan most, and how many more there are of what."""
    shown = [item for item in findings if item.rank != Rank.NOTE][:MOST_FINDINGS]
    lines = [f"  {_word(item):<11} {printable(item.message)}" for item in shown]
    rest = Counter(item.code for item in findings if item not in shown)
    if rest:
        told = ", ".join(f"{count} {code}" for code, count in sorted(rest.items()))
        lines.append(f"  finding     {rest.total()} more: {told} (--json lists them)")
    return lines


def _word(finding: Finding) -> str:
    return "warning" if finding.rank == Rank.GRAVE else "finding"
