"""Report of a plan whose stops are divided among robots or tours: the floor once, then every mission."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from msgspec.structs import replace

from stopgo.mission.console.table import counted, duration
from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule
from stopgo.mission.plan import DividedPlan, PartPlan
from stopgo.mission.stages.network import Network, network_of
from stopgo.planner.commands.plan_report import PlanReport, time_lines


def shared_report(divided: DividedPlan, reports: Sequence[PlanReport]) -> SharedReport:
    """Return the report of all missions; the mission reports name their files."""
    first = reports[0]
    return SharedReport(
        part=divided.whole, files=first.files, times_s=reports[-1].times_s, divided=divided,
        reports=tuple(reports),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class SharedReport(PlanReport):
    """A finished plan of several missions that together cover a floor."""

    divided: DividedPlan
    reports: tuple[PlanReport, ...]
    """One for each mission."""

    @property
    def mission(self) -> Mission:
        """The first of the missions."""
        return self.reports[0].mission

    @property
    def network(self) -> Network | None:
        """The network of the scans of all missions; stop s03 of the first mission is 1:s03."""
        joined = network_of(self.divided.whole.mission)
        return None if joined is None else joined.renamed(self._names())

    @property
    def joined_mission(self) -> Mission:
        """The stops of all missions, with names as in the network."""
        whole, names = self.divided.whole.mission, self._names()
        return replace(whole, stops=tuple(replace(stop, id=names[stop.id]) for stop in whole.stops))

    def _names(self) -> dict[str, str]:
        """Return the name of each stop of the whole plan by its mission: s03 of the first one is 1:s03."""
        whole = self.divided.whole
        name = {
            row: f"{number}:{stop.id}"
            for number, report in enumerate(self.reports, 1)
            for row, stop in zip(_rows(report.part), report.mission.stops, strict=True)
        }
        return {stop.id: name[row] for row, stop in zip(_rows(whole), whole.mission.stops, strict=True)}

    @property
    def exit_code(self) -> int:
        return max(report.exit_code for report in self.reports)

    @property
    def strict_exit_code(self) -> int:
        return max(report.strict_exit_code for report in self.reports)

    def as_json(self) -> dict[str, Any]:
        """Return the object that `--json` prints; route and schedule are those of all missions together."""
        each = [report.as_json() for report in self.reports]
        sums = {key: sum(its["schedule"][key] for its in each) for key in each[0]["schedule"]}
        whole = {key: value for key, value in super().as_json().items() if key not in ("mission", "files")}
        route = {
            "length_m": sum(its["route"]["length_m"] for its in each),
            "method": self.divided.method,
            "tour": each[0]["route"]["tour"],
            "start": each[0]["route"]["start"],
        }
        return {**whole, "route": route, "schedule": sums, "shared": self._shared(each)}

    def _shared(self, each: list[dict[str, Any]]) -> dict[str, Any]:
        divided = self.divided
        robots = divided.kind == "robot"
        return {
            "kind": divided.kind,
            "count": len(each),
            "least": None if robots else int(divided.bound),
            "longest_s": divided.longest_s,
            "least_s": divided.bound if robots else None,
            "limit_s": divided.limit_s,
            "alone_s": schedule(divided.whole.mission).total_s,
            "missions": [
                {
                    "number": number,
                    "name": report.mission.name,
                    **{key: its[key] for key in ("mission", "route", "schedule", "files")},
                    "stops": its["selection"]["stops"],
                    "coverage": its["selection"]["coverage"],
                }
                for number, (report, its) in enumerate(zip(self.reports, each, strict=True), 1)
            ],
        }

    def _route_lines(self, route: dict[str, Any]) -> list[str]:
        divided = self.divided
        count = len(self.reports)
        if divided.limit_s is None:
            head = (
                f"  robots      {count}; the last is done after {duration(divided.longest_s)} "
                f"(never before {duration(math.floor(divided.bound))}; one robot alone: {self._alone()})"
            )
        else:
            head = (
                f"  tours       {count} of at most {duration(divided.limit_s)} "
                f"(at least {divided.bound:.0f} are needed; in one: {self._alone()})"
            )
        return [head, *map(self._line, self.reports), f"  route       {route['length_m']:.1f} m together"]

    def _time_lines(self) -> list[str]:
        return time_lines(self.divided.whole.route, "for one robot alone ")

    def _alone(self) -> str:
        return duration(schedule(self.divided.whole.mission).total_s)

    def _line(self, report: PlanReport) -> str:
        mission, route = report.mission, report.part.route
        assert mission.share
        name = f"{mission.share.kind} {mission.share.number}"
        taken = duration(schedule(mission).total_s)
        return (
            f"    {name:<9} {counted(len(mission.stops), 'stop')}, {route.length:.1f} m, {taken}, "
            f"{report.files['mission'].name}"
        )

    def _file_lines(self) -> list[str]:
        return [line for report in self.reports for line in PlanReport._file_lines(report)]


def _rows(part: PartPlan) -> list[int]:
    """Candidate numbers of the stops, in the order of driving."""
    rows: list[int] = part.selection.chosen[part.route.order].tolist()
    return rows
