"""Units outside the limits on views count as not seen in every stage; and the cost of limits."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from stopgo.mission.document import canonical
from stopgo.mission.document.problems import problems_of
from stopgo.mission.errors import NegativeResult
from stopgo.mission.files.mission_json import encode, parse
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace, Selection, Visibility
from stopgo.mission.stages.sight import Sight, sight_of
from stopgo.planner import plan
from stopgo.planner.commands.plan_report import PlanReport
from stopgo.planner.floors import read_floor
from stopgo.planner.visibility import limited
from stopgo.planner.visibility.limited import within_limits
from stopgo.planner.visibility.sight.sightlines import SightLines
from tests.faults.sizes import FULL, some
from tests.planner.worlds import LAYERED, SHARED, box, column, element, hall, planned, two_rooms

FLOOR = hall(7, 5, column("a", 3, 2), element("b", "beams", box(1, 3.4, 6, 3.6)))
QUALITY = Settings(
    max_incidence=62, near=1.1, density=4, angular_step=0.07, grid=1.4, refine=False, register=False
)
SAMPLE = Path(__file__).parents[3] / "recordings" / "samples" / "office.dxf"
WITHOUT_LIMITS = {
    "office": "78263333d44e823b",
    "duplex-l1": "75eb51a91cb843ab",
    "fzk-haus-eg": "e57277db7e3a4642",
    "office-l1": "373909485f6873dd",
}
"""Digests of plans as they were made before there were limits."""
PLANNED = LAYERED if FULL else LAYERED[:1]
"""office-l1 takes several seconds."""


@pytest.mark.parametrize("floor", [SAMPLE, *(SHARED / name for name in PLANNED)], ids=lambda path: path.stem)
def test_without_limits_a_plan_is_what_it_was_before(floor: Path) -> None:
    if not floor.exists():
        pytest.skip(f"{floor} is not at hand")
    document = msgspec.to_builtins(
        plan(read_floor(floor), Settings(register=False, max_incidence=90.0)).mission
    )
    told = {key: document[key] for key in ("robot", "scanner", "start", "stops", "return")}
    assert "limits" not in document
    assert not {"views", "near", "scanner"} & set(document["origin"]["parameters"])
    assert hashlib.sha256(canonical(told)).hexdigest()[:16] == WITHOUT_LIMITS[floor.stem]


@pytest.mark.parametrize("method", ["exact", "bresenham"])
def test_every_candidate_sees_what_each_line_of_sight_says(method: str) -> None:
    _, nouns = planned(FLOOR, replace(QUALITY, visibility=method))
    seen, lines = nouns[Visibility], SightLines(nouns[NavigableSpace])
    in_sight = seen.in_sight
    assert in_sight is not None
    for row, xy in enumerate(seen.candidates.xy[seen.candidates.kept]):
        well = set(lines.seen_from(xy).tolist())
        if method == "exact":
            assert set(seen.seen_by(row).tolist()) == well
        assert set(seen.seen_by(row).tolist()) <= set(in_sight.seen_by(row).tolist())
    assert len(seen.first) / len(in_sight.first) > 0.2
    assert len(np.unique(seen.first)) != len(np.unique(in_sight.first))


@pytest.mark.parametrize("views", some([2, 1, 3], every=2))
def test_no_set_of_candidates_is_smaller_than_the_bound(views: int) -> None:
    """Every set of candidates of a small hall, held against the demands one unit after the other."""
    settings = replace(QUALITY, views=views, selector="exact", coverage=0.8)
    _, nouns = planned(FLOOR, settings)
    chosen, seen = nouns[Selection], nouns[Visibility]
    assert 6 <= seen.rows <= 16
    sees = np.zeros((seen.rows, seen.targets.total), dtype=np.int64)
    for row in range(seen.rows):
        sees[row, seen.seen_by(row)] = 1
    asked = np.clip(sees.sum(axis=0), 1, views)
    fewest = next(
        count
        for count in range(seen.rows + 1)
        for rows in combinations(range(seen.rows), count)
        if enough(sees[list(rows)].sum(axis=0) >= asked, seen, settings)
    )
    assert chosen.bound == fewest == len(chosen.chosen)


def enough(counts: np.ndarray, seen: Visibility, settings: Settings) -> bool:
    """True if the required fractions of the whole, of the room and of every kind are met."""
    space, targets = seen.space, seen.targets
    kinds = np.array([item.kind for item in space.floor.elements])[targets.element][targets.unit_segment]
    groups = [(np.ones(targets.total, bool), settings.coverage), (space.unit_room == 0, 0.7)]
    groups += [(kinds == kind, 0.7) for kind in sorted(set(kinds))]
    length = targets.unit_length
    return all(
        length[counts & seen.visible & group].sum() >= share * length[seen.visible & group].sum() - 1e-9
        for group, share in groups
    )


def test_more_views_never_take_fewer_stops() -> None:
    for floor in (FLOOR, two_rooms(1.0)):
        stops = []
        for views in (1, 2, 3, 4):
            settings = Settings(
                range=4, grid=1.2, views=views, selector="exact", refine=False, register=False
            )
            found = planned(floor, settings)[1][Selection]
            assert found.bound == len(found.chosen)
            stops.append(found.bound)
        assert all(one <= other for one, other in pairwise(stops))
        assert stops[-1] > stops[0]


def test_a_mission_carries_its_limits_and_one_without_them_reads_as_before() -> None:
    mission, _ = planned(FLOOR, replace(QUALITY, views=2, scanner="rtc360-low"))
    read = parse(encode(mission), "mission.json")
    assert read == mission
    document = msgspec.to_builtins(read)
    assert document["limits"] == {"max_incidence_deg": 62, "near": 1.1, "density_mm": 4, "views": 2}
    assert document["scanner"]["step_deg"] == 0.07
    assert document["scanner"]["model"] == "rtc360-low"
    assert not problems_of(read)
    wrong = msgspec.structs.replace(read, limits=msgspec.structs.replace(read.limits, density_mm=-1.0))
    assert [problem.path for problem in problems_of(wrong)] == ["$.limits.density_mm"]


def test_what_a_run_acquires_counts_views_too() -> None:
    mission, nouns = planned(FLOOR, replace(QUALITY, views=2))
    made = plan(FLOOR, replace(QUALITY, views=2)).first
    sight: Sight = sight_of(made.route, made.mission, made.figures)
    assert sight.planned.whole == made.figures.whole
    assert not sight.planned.short
    one = sight.coverage([mission.stops[0].id])
    assert one.whole.seen < 0.05 * sight.planned.whole.seen
    views = sight.views_from(sight.ids[:-1])
    assert sight.brings(sight.ids[-1], views) > 0
    claimed = sum(stop.sees.new_units for stop in mission.stops)
    assert claimed == nouns[Visibility].seen_from(nouns[Selection].chosen).sum()


def test_each_limit_is_reported_with_about_what_it_costs() -> None:
    made = plan(FLOOR, replace(QUALITY, views=2)).first
    quality = made.figures.quality
    assert quality is not None
    assert [item.limit for item in quality.costs] == ["max_incidence", "near", "density", "views"]
    assert all(item.bound <= item.without for item in quality.costs)
    assert quality.costs[-1].without < quality.costs[-1].stops
    assert 0 < quality.possible < quality.in_sight
    report = PlanReport(made, {}, {})
    assert len(report.as_json()["limits"]["costs"]) == 4
    assert "from 2 stops" in report.as_text()
    assert plan(FLOOR, Settings(max_incidence=90.0)).first.figures.quality is None


def test_a_limit_is_not_blamed_for_what_registration_costs() -> None:
    """A scanner that sees 100° takes two more stops to register."""
    floor = hall(14, 5)
    made = plan(floor, Settings(fov=100.0, range=4.0)).first
    alone = plan(floor, Settings(fov=100.0, range=4.0, register=False)).first
    assert len(made.mission.stops) > len(alone.mission.stops)
    quality = made.figures.quality
    assert quality is not None
    assert [(item.limit, item.stops - item.without) for item in quality.costs] == [("max_incidence", 0)]


def test_what_cannot_be_seen_as_asked_is_reported_and_strict_refuses_it() -> None:
    closet = hall(2.2, 2.2)
    made = plan(closet, Settings(views=9)).first
    assert [item.code for item in made.figures.grave] == ["limits_not_met"]
    assert "from 9 stops" in made.figures.grave[0].message
    assert PlanReport(made, {}, {}).strict_exit_code == 1
    assert made.figures.whole.coverage >= 0.9


@pytest.mark.parametrize(
    ("limits", "told"),
    [
        ({"near": 40.0}, r"from 40 m on; lower --min-range or --blind-cone, or lower --grid"),
        (
            {"density": 0.1, "angular_step": 0.036},
            r"at most 0.1 mm apart; raise --density or scan finer",
        ),
        ({"max_incidence": 1e-6}, r"up to 1e-06°; raise --max-incidence"),
    ],
)
def test_limits_that_leave_nothing_are_named(limits: dict[str, Any], told: str) -> None:
    with pytest.raises(NegativeResult, match=rf"^test: no visible target is within the limits: .*{told}"):
        plan(FLOOR, replace(Settings(), **limits))


def test_runs_are_within_the_limits_in_whatever_blocks_they_are_tested(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    in_sight = planned(FLOOR, QUALITY)[1][Visibility].in_sight
    assert in_sight is not None and len(in_sight.first) > 50
    whole = within_limits(in_sight)
    monkeypatch.setattr(limited, "BLOCK", 17)
    parts = within_limits(in_sight)
    for name in ("pointer", "segment", "first", "last"):
        assert np.array_equal(getattr(parts, name), getattr(whole, name)), name
