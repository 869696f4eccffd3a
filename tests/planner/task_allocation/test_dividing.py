"""Stops divided among robots and tours, compared with every division on small floors."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import UNSET
from msgspec.structs import replace as replace_struct

from stopgo.command_line import main
from stopgo.mission.document import MissionAllocation
from stopgo.mission.document.problems import problems_of
from stopgo.mission.document.schedule import schedule
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.coverage_json import coverage_json
from stopgo.mission.files.plan_svg import plan_svg
from stopgo.mission.files.plan_toml import read_settings
from stopgo.mission.plan import DividedPlan, Plan
from stopgo.mission.settings import Settings, recorded_values
from stopgo.mission.settings.parameter import seconds
from stopgo.mission.stages import Route
from stopgo.mission.stages.network import network_of
from stopgo.planner import pipeline, plan
from stopgo.planner.checking.network_claims import network_overclaims
from stopgo.planner.commands.plan_report import PlanReport
from stopgo.planner.commands.shared_report import shared_report
from stopgo.planner.covering_tour import least_time_bound
from stopgo.planner.pipeline.follow_up_mission import PlannedFloor, top_up
from stopgo.planner.task_allocation import dividing
from stopgo.planner.task_allocation import tour_times as tour_times_module
from stopgo.planner.task_allocation.least_times import driven_and_turned, least_makespan, least_tours
from stopgo.planner.task_allocation.tour_times import TourTimes, tour_times
from tests.planner.worlds import column, hall, planned, two_rooms

SAMPLE = Path(__file__).parents[3] / "recordings" / "samples" / "office.dxf"
WORLDS = {
    "hall": hall(14.0, 9.0, column("c1", 5.0, 4.0, 1.5), column("c2", 9.5, 5.0, 1.5)),
    "rooms": two_rooms(1.0),
}
START = (1.5, 1.5, 0.0)


@cache
def route_of(world: str, **changes: Any) -> Route:
    _, nouns = planned(WORLDS[world], Settings(range=3.5, start=START, **changes))
    route: Route = nouns[Route]
    return route


def clock_of(route: Route, *, starts: int = 1, closed: bool = True) -> TourTimes:
    places = np.array([START[:2], route.selection.xy[0]])[:starts]
    return tour_times(route.selection, places, (0.0, 1.0)[:starts], closed=closed)


def partitions(items: tuple[int, ...]) -> Iterator[list[list[int]]]:
    """Every way of putting items in groups."""
    if not items:
        yield []
        return
    first, rest = items[0], items[1:]
    for groups in partitions(rest):
        yield [[first], *groups]
        for k, group in enumerate(groups):
            yield [*groups[:k], [first, *group], *groups[k + 1 :]]


def best_time(clock: TourTimes, group: list[int], start: int, known: dict[Any, float]) -> float:
    key = (tuple(sorted(group)), start)
    if key not in known:
        known[key] = min(clock.seconds(order, start) for order in permutations(key[0]))
    return known[key]


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("starts", [1, 2])
@pytest.mark.parametrize("world", WORLDS)
def test_no_sharing_out_among_robots_goes_below_the_bound(world: str, starts: int, closed: bool) -> None:
    clock = clock_of(route_of(world), starts=starts, closed=closed)
    known: dict[Any, float] = {}
    numbers = [0, starts - 1]
    best = math.inf
    for groups in partitions(tuple(range(clock.stops))):
        if len(groups) == 2:
            for pair in (groups, groups[::-1]):
                times = [best_time(clock, g, k, known) for g, k in zip(pair, numbers, strict=True)]
                best = min(best, max(times))
    assert (0.5 if closed else 0.7) * best < least_makespan(clock, np.array(numbers)) <= best


@pytest.mark.parametrize("limit", [100.0, 150.0, 220.0, 400.0, 1000.0])
@pytest.mark.parametrize("world", WORLDS)
def test_the_tours_of_a_shift_are_as_few_as_any(world: str, limit: float) -> None:
    route = route_of(world)
    clock = clock_of(route)
    known: dict[Any, float] = {}
    fewest = min(
        (
            len(groups)
            for groups in partitions(tuple(range(clock.stops)))
            if all(best_time(clock, group, 0, known) <= limit for group in groups)
        ),
        default=None,
    )
    made = settled(world, shift=limit) if fewest else None
    if made is None or fewest is None:
        return
    assert least_tours(clock, limit) <= made.bound + 1e-9 <= fewest + 1e-9
    assert len(made.shares) == fewest
    assert all(schedule(share.mission).total_s <= limit for share in made.shares)


def test_the_number_of_searches_grows_slower_than_that_of_tours(monkeypatch: pytest.MonkeyPatch) -> None:
    route = route_of("hall")
    counts: list[int] = []
    monkeypatch.setattr(dividing, "least_tours", lambda clock, limit_s: 1)
    monkeypatch.setattr(dividing, "vehicle_tours", lambda times, *, depots, **_: counts.append(len(depots)))
    made = dividing._shifts(route, replace(route.settings, shift=160.0))
    assert len(counts) <= math.ceil(math.log2(len(made.routes) + 1))


def test_bounds_without_detours_hold_too(monkeypatch: pytest.MonkeyPatch) -> None:
    with_detours = [least_makespan(clock_of(route_of("hall")), np.zeros(k, np.int64)) for k in (1, 2)]
    monkeypatch.setattr(tour_times_module, "DETOURS_UP_TO", 0)
    clock = clock_of(route_of("hall"))
    known: dict[Any, float] = {}
    assert [least_makespan(clock, np.zeros(k, np.int64)) for k in (1, 2)] >= with_detours
    assert least_makespan(clock, np.zeros(1, np.int64)) <= best_time(clock, [*range(clock.stops)], 0, known)


@pytest.mark.parametrize("robots", [1, 2, 3])
def test_bounds_from_near_paths_hold_too(robots: int, monkeypatch: pytest.MonkeyPatch) -> None:
    starts, known, stops = np.zeros(robots, np.int64), {}, tuple(range(clock_of(route_of("hall")).stops))
    bound = least_makespan(clock_of(route_of("hall")), starts)
    for name, value in (("ALL_PAIRS_UP_TO", 0), ("NEAR", 3), ("DETOURS_UP_TO", 0)):
        monkeypatch.setattr(tour_times_module, name, value)
    clock = clock_of(route_of("hall"))
    best = min(
        max(best_time(clock, group, 0, known) for group in groups)
        for groups in partitions(stops)
        if len(groups) == robots
    )
    assert 0.5 * bound < least_makespan(clock, starts) <= best + 1e-6


def test_many_stops_are_divided_by_the_paths_near_them(monkeypatch: pytest.MonkeyPatch) -> None:
    route = route_of("hall", robots=2)
    monkeypatch.setattr(tour_times_module, "ALL_PAIRS_UP_TO", 0)
    made = dividing.divided(route)
    assert sorted(np.concatenate([part.selection.chosen for part in made.routes])) == sorted(
        route.selection.chosen
    )
    assert made.bound <= dividing.division_cost(made)[0]


@cache
def settled(world: str, **changes: Any) -> DividedPlan:
    made = plan(WORLDS[world], Settings(range=3.5, start=START, **changes))
    assert made.divided is not None
    return made.divided


@pytest.mark.parametrize(
    "changes", [{"robots": 2}, {"robots": 2, "tour": "open"}, {"shift": 220.0}, {"robots": 1}], ids=str
)
def test_every_stop_is_in_one_mission(changes: dict[str, Any]) -> None:
    divided = settled("hall", **changes)
    whole = sorted((stop.x, stop.y) for stop in divided.whole.mission.stops)
    assert sorted((s.x, s.y) for part in divided.shares for s in part.mission.stops) == whole
    missions = [share.mission for share in divided.shares]
    assert all(mission.stops for mission in missions)
    assert len({mission.id for mission in (*missions, divided.whole.mission)}) == len(missions) + 1
    assert [m.share for m in missions] == [
        MissionAllocation(kind=divided.kind, number=k, of=len(missions)) for k in range(1, len(missions) + 1)
    ]
    for share in divided.shares:
        assert not list(problems_of(share.mission))
        assert share.route.length >= share.route.bound - 1e-9
        if changes.get("tour") != "open" and share.mission.return_ is not None:
            assert share.mission.return_[-1] == START[:2]


def test_a_tour_takes_as_long_as_its_mission() -> None:
    route = route_of("hall")
    divided = settled("hall", robots=2)
    clock = clock_of(route)
    for share in divided.shares:
        at = {tuple(np.round(xy, 6)): k for k, xy in enumerate(route.selection.xy.tolist())}
        tour = [at[stop.x, stop.y] for stop in share.mission.stops]
        assert clock.seconds(tour) == pytest.approx(schedule(share.mission).total_s, abs=1e-4)


def test_the_same_plan_is_shared_out_the_same() -> None:
    again = plan(WORLDS["hall"], Settings(range=3.5, start=START, robots=2)).divided
    assert again is not None
    assert [s.mission.digest for s in again.shares] == [
        s.mission.digest for s in settled("hall", robots=2).shares
    ]


def test_missions_that_are_not_shared_out_report_nothing_of_it() -> None:
    told = recorded_values(Settings(start=START))
    assert not {"robots", "shift", "battery", "further_starts"} & set(told)


def test_all_tours_are_in_one_picture() -> None:
    divided = settled("hall", robots=2)
    made = Plan(divided.shares, divided)
    whole = divided.whole
    svg = plan_svg(whole.route, whole.mission, whole.figures, made.shared, date="").decode()
    assert 'id="route-A"' in svg and 'id="route-B"' in svg
    assert ">A1<" in svg and ">B1<" in svg and "robot 2 of 2" in svg
    assert svg.count('id="start"') == 1
    assert 'stroke-dasharray="4 1.2"' in svg


def test_more_robots_start_where_they_are_put() -> None:
    made = settled("hall", robots=2, further_starts=((12.0, 7.0, 90.0),))
    starts = [(share.mission.start.x, share.mission.start.y) for share in made.shares]
    assert starts == [START[:2], (12.0, 7.0)]
    assert made.shares[1].mission.start.heading == pytest.approx(math.pi / 2, abs=1e-6)


def test_the_scans_of_all_robots_are_one_network_reported_by_mission_and_stop() -> None:
    made = settled("rooms", robots=2, overlap=0.1, d_sec=0.4)
    files = {name: Path(name) for name in ("mission", "recording", "picture", "coverage")}
    report = shared_report(made, [PlanReport(part, files, {}) for part in made.shares])
    network = report.network
    assert network is not None
    assert len(network.pieces) == 1
    stops = {f"{k}:{stop.id}" for k, part in enumerate(made.shares, 1) for stop in part.mission.stops}
    assert set(network.stops) == stops
    (line,) = [line for line in report.as_text().splitlines() if line.startswith("    error ")]
    errors = {stop.id: stop.error.major_m for stop in made.whole.mission.stops if stop.error}
    assert f": {1000 * max(errors.values()):.1f} mm" in line
    frame, worst = re.findall(r"[0-9]+:s[0-9]+", line)
    assert frame != worst and {frame, worst} <= stops
    own = [network_of(part.mission) for part in made.shares]
    for k, of_one in enumerate(own, 1):
        assert of_one is not None
        names = {stop: f"{k}:{stop}" for stop in of_one.stops}
        assert set(of_one.renamed(names).overlaps) == set(network.among(set(names.values())).overlaps)
    across = [item for item in network.overlaps if item.a[0] != item.b[0]]
    assert across, "the robots' scans join"
    assert not [item for part in made.shares for item in network_overclaims(part.mission, part.space)]


def test_a_stop_too_far_for_a_shift_is_named() -> None:
    with pytest.raises(NegativeResult, match=r"--shift 66 s: stop \d+ at \(\d"):
        settled("hall", shift=66.0)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"robots": 2, "start": None}, "no robot has a start"),
        ({"robots": 3, "further_starts": [[1, 1, 0]]}, "--robots 3: 2 starts are given"),
        ({"further_starts": [[1, 1, 0]]}, "--robots 1: 2 starts are given"),
        ({"robots": 0}, "--robots 0: must be between 1 and 50"),
        ({"shift": 30.0}, "--shift 30 s: is shorter than one stop"),
        ({"battery": 30.0, "shift": 600.0}, "--battery-life 30 s: is shorter than one stop"),
        ({"shift": math.nan}, "--shift nan: must be a finite number"),
        ({"robots": 2, "shift": 600.0}, "--robots and --shift are both given"),
        ({"shift": 600.0, "tour": "open"}, "--tour open"),
        ({"robots": 2, "end": [1, 1]}, "--end and --robots are both given"),
    ],
    ids=str,
)
def test_what_cannot_be_shared_out_is_refused(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        read_settings(None, {"start": [1.5, 1.5, 0], **changes})


def test_more_robots_than_stops_are_refused() -> None:
    with pytest.raises(InputError, match=r"--robots 50: more than the plan's \d+ stops"):
        settled("hall", robots=50)


def test_a_start_off_the_floor_is_refused() -> None:
    with pytest.raises(InputError, match="start = 99,99: the robot does not fit there"):
        settled("hall", robots=2, further_starts=((99.0, 99.0, 0.0),))


@pytest.mark.parametrize(
    ("text", "value"), [("1800", 1800), ("30min", 1800), ("1h30min", 5400), ("1.5h", 5400), ("90s", 90)]
)
def test_durations_are_read_as_people_write_them(text: str, value: float) -> None:
    assert seconds(text) == value


@pytest.mark.parametrize("text", ["", "30 minutes", "min", "1h30"])
def test_other_words_are_no_duration(text: str) -> None:
    with pytest.raises(ValueError, match="could not convert"):
        seconds(text)


def test_a_command_writes_a_mission_for_each_robot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    floor = str(SAMPLE)
    out = str(tmp_path)
    assert (
        main(["plan", floor, "-o", out, "--robots", "2", "--start", "10,8.5,0", "--no-register", "--json"])
        == 0
    )
    told = json.loads(capsys.readouterr().out)
    shared = told["shared"]
    assert (shared["kind"], shared["count"]) == ("robot", 2)
    assert shared["least_s"] <= shared["longest_s"] <= shared["alone_s"]
    assert sum(item["stops"] for item in shared["missions"]) == told["selection"]["stops"]
    assert sorted(path.name for path in tmp_path.glob("*.svg")) == ["plan.svg"]
    for name in ("mission", "mission-2"):
        path = tmp_path / f"{name}.json"
        coverage = path.with_name(path.name.replace("mission", "coverage"))
        assert main(["check", str(path), "--floor", floor, "--coverage-file", str(coverage)]) == 0
    assert main(["export", str(tmp_path / "mission-2.json"), "-o", str(tmp_path / "stops.csv")]) == 0


def test_the_coverage_of_a_mission_is_its_own() -> None:
    share = settled("hall", robots=2).shares[1]
    told = json.loads(coverage_json(share.route, share.mission, share.figures))
    assert 0 < told["total"]["coverage"] < settled("hall", robots=2).whole.figures.whole.coverage


def test_the_follow_up_of_one_share_needs_the_others() -> None:
    share = settled("hall", robots=2).shares[1]
    known = PlannedFloor(share.floor, share.space.settings, share.mission)
    with pytest.raises(InputError, match="divides its floor with 1 more; give also mission 1 of 2"):
        top_up(known, np.empty((0, 3)))


def test_a_follow_up_of_all_shares_scans_only_what_the_lost_robot_left() -> None:
    """Robot 2 was lost before its first scan; after both shares nothing is left."""
    one, two = settled("hall", robots=2).shares
    known = PlannedFloor(one.floor, one.space.settings, one.mission)
    poses = [
        np.array([(stop.x, stop.y, stop.heading) for stop in share.mission.stops]) for share in (one, two)
    ]
    assert top_up(known, np.concatenate(poses), others=[two.mission]) is None
    left = top_up(known, poses[0], others=[two.mission])
    assert left is not None and left.share is UNSET
    assert 0 < len(left.stops) <= len(two.mission.stops)


def test_a_mission_of_another_plan_is_no_share() -> None:
    one, two = settled("hall", robots=2).shares
    origin = replace_struct(two.mission.origin, floor_digest="e" * 64)
    known = PlannedFloor(one.floor, one.space.settings, one.mission)
    with pytest.raises(InputError, match="not of the same divided plan"):
        top_up(known, np.empty((0, 3)), others=[replace_struct(two.mission, origin=origin)])


def test_of_many_stops_only_the_route_of_least_time_is_divided(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(least_time_bound, "MOST_STEPS", 40)
    selection, divisions = route_of("rooms", minimise="time").selection, []
    monkeypatch.setattr(dividing, "divided", divisions.append)
    monkeypatch.setattr(pipeline, "BOTH_UP_TO", 0)
    route, _ = pipeline._divided(selection)
    assert divisions == [route]
    assert route.time is not None and route.time.seconds <= route.time.two_step_s


def test_of_many_stops_equal_stretches_are_improved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dividing, "SEARCH_UP_TO", 0)
    monkeypatch.setattr(dividing, "vehicle_tours", None)
    route = route_of("hall", robots=2)
    made = dividing.divided(route)
    assert sorted(np.concatenate([part.selection.chosen for part in made.routes])) == sorted(
        route.selection.chosen
    )
    assert made.bound <= dividing.division_cost(made)[0]


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("world", WORLDS)
def test_no_tours_together_take_less_than_the_bound_with_turns(world: str, closed: bool) -> None:
    clock = clock_of(route_of(world), closed=closed)
    known: dict[Any, float] = {}
    for tours in range(1, min(3, clock.stops) + 1):
        least = min(
            sum(best_time(clock, group, 0, known) for group in groups)
            for groups in partitions(tuple(range(clock.stops)))
            if len(groups) == tours
        )
        assert driven_and_turned(clock, tours) <= least - clock.stops * clock.pause_s


def test_the_coverage_of_all_tours_is_counted_in_one_cover(monkeypatch: pytest.MonkeyPatch) -> None:
    route, made, build = route_of("hall", robots=3), [], dividing.cover_of
    monkeypatch.setattr(dividing, "cover_of", lambda *given: made.append(given) or build(*given))
    assert len(dividing.divided(route).routes) == 3
    assert len(made) == 1
