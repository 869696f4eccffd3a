"""Stops needed for a required fraction of every room and kind, and targets missed without one."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from benchmarks.table import put, table, versions
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Selection, Visibility
from stopgo.mission.stages.figures import Figures, GroupCoverage, percent
from stopgo.planner import plan
from stopgo.planner.candidates import candidates
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.selection.refine import select_refined
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility import visibility

HOME = Path(__file__).parents[1]
SHARED = HOME.parent / "shared" / "data"
FLOORS: dict[str, tuple[Path, dict[str, float]]] = {
    "office (sample)": (HOME / "recordings" / "samples" / "office.dxf", {}),
    **{name: (SHARED / "layered" / f"{name}.dxf", {}) for name in ("duplex-l1", "fzk-haus-eg", "office-l1")},
    **{
        f"case{case}_{stage}": (
            SHARED / "paper" / f"synthetic_case{case}_{stage}.dxf",
            {"robot_radius": 0.34} if (case, stage) == (1, "rooms") else {},
        )
        for case in (1, 2)
        for stage in ("structural", "rooms")
    },
}
SHARES = (0.0, 0.5, 0.6, 0.7, 0.8, 0.9)


def main() -> None:
    """Measure every floor at hand and put both tables into the README."""
    at_hand = {name: value for name, value in FLOORS.items() if value[0].exists()}
    costs = [cost_row(name, *value) for name, value in at_hand.items()]
    before = [row for name, value in at_hand.items() for row in plan_rows(name, *value)]
    text = "\n\n".join(
        (
            versions("numpy", "scipy", "shapely", "highspy"),
            "### What the least share of rooms and kinds costs",
            table(["floor", *(f"{share:g}" for share in SHARES)], costs),
            "Stops / bound, by the least share of every room and every kind, with 0.9 of the whole.",
            "### What is seen, by the paper's rule and by length with 0.7 of every room and kind",
            table(
                [
                    "floor",
                    "rule",
                    "stops",
                    "coverage by length",
                    "worst room",
                    "worst kind",
                    "floor reached",
                    "s",
                ],
                before,
            ),
            "Seconds of the whole plan without files.",
        )
    )
    put("shares", text)
    print(text)


def cost_row(name: str, path: Path, options: dict[str, float]) -> list[str]:
    """Stops and bound at each required fraction."""
    settings = Settings(register=False, **options)
    floor = read_floor(path, FloorOptions(d_dis=settings.d_dis))
    seen = visibility(candidates(navigable(floor, settings)))
    return [name, *(f"{len(s.chosen)} / {s.bound}" for s in _selections(seen))]


def _selections(seen: Visibility) -> Iterator[Selection]:
    for share in SHARES:
        space = seen.space
        settings = replace(space.settings, room_coverage=share, kind_coverage=share)
        again = replace(seen, candidates=replace(seen.candidates, space=replace(space, settings=settings)))
        yield select_refined(again)


def plan_rows(name: str, path: Path, options: dict[str, float]) -> Iterator[list[str]]:
    """Figures of a plan by either rule, counted by length."""
    for rule in ("paper", "length"):
        settings = Settings(**options, coverage_rule=rule, register=False)
        begin = time.perf_counter()
        made = plan(read_floor(path, FloorOptions(d_dis=settings.d_dis)), settings)
        took = time.perf_counter() - begin
        selection, figures = made.selection, made.figures
        told = _by_length(selection, figures)
        rooms = [share for share in told.rooms if share.name != "in no room"]
        yield [
            *(name, rule, str(len(selection.chosen)), percent(told.whole.coverage)),
            *(_told(rooms), _told(told.kinds)),
            *(f"{figures.reached_m2:.0f} of {figures.rooms_m2:.0f} m²", f"{took:.1f}"),
        ]


def _by_length(selection: Selection, figures: Figures) -> Figures:
    """The figures of a selection by length, for either rule."""
    from stopgo.planner.appraisal.figures_of_route import coverage_by_group

    space = selection.space
    by_length = replace(space, settings=replace(space.settings, coverage_rule="length"))
    found = replace(selection.candidates, space=by_length)
    again = replace(selection, visibility=replace(selection.visibility, candidates=found))
    found = coverage_by_group(again)
    return replace(figures, whole=found.whole, rooms=found.rooms, kinds=found.kinds)


def _told(groups: list[GroupCoverage] | tuple[GroupCoverage, ...]) -> str:
    seen = [group for group in groups if group.coverage is not None]
    return f"{percent(seen[0].coverage)} {seen[0].name}" if seen else "-"


if __name__ == "__main__":
    main()
