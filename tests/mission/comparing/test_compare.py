"""Plan against run, stop by stop, and what the scans that were made really saw."""

from __future__ import annotations

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace as changed

from stopgo.mission.comparing.compare import compare
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.comparison_text import comparison_json, comparison_text
from stopgo.mission.comparing.run_verdict import judge
from stopgo.mission.comparing.spans import paused_s
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.run.events import (
    JUMPED_OVER,
    Aborted,
    Arrived,
    Failed,
    Finished,
    Held,
    Homing,
    Paused,
    Resumed,
    RevisionTaken,
    Scanned,
    Settled,
    Skipped,
    Started,
    Unconfirmed,
)
from stopgo.mission.run.run_log import RunLog
from stopgo.mission.stages import Route
from stopgo.mission.stages.coverage_totals import totals_of_plan
from stopgo.mission.stages.figures import Figures, worst_first
from stopgo.mission.stages.sight import Sight, sight_of
from tests.mission.comparing.reports import SCAN, at, told
from tests.mission.worlds import square_tour
from tests.recordings import world

START = (Started, 0.0, {"commander": "ann"})


def planned() -> tuple[Mission, Sight]:
    """Two stops: of 14 visible units of 0.1 m, S1 sees 8 and S2 three more; 70 % is asked."""
    *nouns, mission = world.nouns_at()
    route = next(noun for noun in nouns if isinstance(noun, Route))
    space = route.space
    settings = replace(space.settings, coverage=0.7, room_coverage=0.5, kind_coverage=0.5)
    object.__setattr__(space, "settings", settings)
    return mission, sight_of(route, mission, figures(route))


def figures(route: Route) -> Figures:
    found = totals_of_plan(route.visibility).coverage(np.zeros(32, dtype=bool))
    return Figures("length", found.whole, found.rooms, worst_first(found.kinds), 24.0, 24.0, (), ())


def visit(stop: str, seconds: float, x: float, y: float, *, scan: bool = True) -> list[tuple]:
    """Arrived, settled after 3 s, and scanned after 60."""
    events = [
        (Arrived, seconds, {"stop": stop, "pose": at(x, y), "deviation_m": 0.0}),
        (Settled, seconds + 3, {"stop": stop, "pose": at(x, y)}),
    ]
    return [*events, (Scanned, seconds + 63, {"stop": stop, "pose": at(x, y), **SCAN})] if scan else events


def run(*events: tuple) -> Comparison:
    mission, sight = planned()
    return compare(told(mission, START, *events), [mission], [sight])


def test_a_run_as_planned_saw_what_was_planned() -> None:
    whole = run(*visit("S1", 0, 1, 1), *visit("S2", 70, 3.2, 1), (Finished, 133.0, {}))
    assert whole.acquired is not None
    assert whole.acquired.coverage.whole == whole.acquired.planned.whole
    assert (whole.acquired.coverage.whole.seen, whole.acquired.coverage.whole.visible) == pytest.approx(
        (1.1, 1.4)
    )
    assert judge(whole).answer == "yes"
    assert (
        judge(whole).text
        == "Acquired. 78.5 % of what is visible was scanned; 70.0 % was required, 78.5 % planned."
    )


def test_a_skipped_stop_takes_what_it_alone_would_have_seen() -> None:
    skipped = run(
        *visit("S1", 0, 1, 1), (Skipped, 65.0, {"stop": "S2", "reason": "skip by ann"}), (Finished, 70.0, {})
    )
    assert skipped.acquired is not None
    assert skipped.acquired.coverage.whole.coverage == pytest.approx(8 / 14)
    (first, second) = skipped.stops
    assert (first.lost, second.outcome, second.reason) == (None, "skipped", "skip by ann")
    assert second.lost == pytest.approx(3 / 14)
    assert judge(skipped).answer == "no"
    assert "57.1 % of what is visible was scanned" in judge(skipped).text
    assert "S2 was skipped." in judge(skipped).text


def test_what_two_missing_stops_both_see_is_lost_by_each() -> None:
    missing = run((Aborted, 5.0, {"reason": "abort by ann"}))
    assert [item.lost for item in missing.stops] == pytest.approx([8 / 14, 7 / 14])
    assert "The run was aborted: abort by ann." in judge(missing).text


def test_nothing_is_lost_yet_while_the_run_goes_there() -> None:
    going = run(*visit("S1", 0, 1, 1))
    assert going.stops[1].lost is None
    assert (judge(going).answer, judge(going).exit_code) == ("unknown", 3)
    assert "The run has not ended." in judge(going).text


def test_rooms_kinds_and_elements_are_recomputed() -> None:
    acquired = run(*visit("S1", 0, 1, 1), (Aborted, 70.0, {"reason": "x"})).acquired
    assert acquired is not None
    ((planned_room, room),) = acquired.rooms
    assert (room.name, room.seen, planned_room.seen) == ("Room 1", pytest.approx(0.8), pytest.approx(1.1))
    assert [(item.name, item.seen) for item in acquired.elements] == [("c1", pytest.approx(0.8)), ("c2", 0.0)]


def test_a_stop_of_which_nobody_says_that_it_was_scanned_leaves_it_open() -> None:
    unsure = run(
        *visit("S1", 0, 1, 1),
        (Unconfirmed, 80.0, {"stop": "S2", "pose": None, "reason": "no word"}),
        (Finished, 90.0, {}),
    )
    assert unsure.acquired is not None
    assert unsure.acquired.coverage.whole.coverage == pytest.approx(8 / 14)
    assert (judge(unsure).answer, judge(unsure).exit_code) == ("unknown", 3)


def test_a_stop_that_a_revision_has_moved_is_not_counted_by_the_old_plan() -> None:
    mission, sight = planned()
    first, second = mission.stops
    moved = with_digest(
        msgspec.structs.replace(
            mission, revision=2, stops=(first, msgspec.structs.replace(second, x=second.x + 0.5))
        )
    )
    log = told(
        mission,
        START,
        *visit("S1", 0, 1, 1),
        (RevisionTaken, 64.0, {"before": 1, "revision": 2}),
        *[(kind, s, {**f, "revision": 2}) for kind, s, f in visit("S2", 70, 3.7, 1)],
        (Finished, 133.0, {"revision": 2}),
    )
    compared = compare(log, [mission, moved], [sight])
    assert compared.acquired is not None
    assert compared.acquired.unknown == ("S2",)
    assert compared.acquired.coverage.whole.coverage == pytest.approx(8 / 14)
    assert judge(compared).answer == "unknown"


def test_a_scan_from_outside_the_tolerance_is_none_of_the_plan() -> None:
    away = run(*visit("S1", 0, 1, 1), *visit("S2", 70, 3.2, 1.2), (Finished, 133.0, {}))
    assert judge(away).answer == "no"
    assert "S2 was scanned 200 mm from its stop (50 mm are tolerated)." in judge(away).text


@pytest.mark.parametrize(("degrees", "answer"), [(14.0, "no"), (-4.9, "yes")])
def test_a_scanner_that_sees_90_degrees_must_have_faced_as_planned(degrees: float, answer: str) -> None:
    mission, sight = planned()
    narrow = with_digest(changed(mission, scanner=changed(mission.scanner, fov_deg=90.0)))
    heading = next(stop.heading for stop in mission.stops if stop.id == "S2") + math.radians(degrees)
    visits = [
        (
            kind,
            s,
            {**fields, "pose": changed(fields["pose"], heading=heading)} if "pose" in fields else fields,
        )
        for kind, s, fields in visit("S2", 70, 3.2, 1)
    ]
    events = (START, *visit("S1", 0, 1, 1), *visits, (Finished, 133.0, {}))
    around, ahead = (compare(told(one, *events), [one], [sight]) for one in (mission, narrow))
    assert (judge(around).answer, judge(ahead).answer) == ("yes", answer)
    words = f"S2 was scanned turned {abs(degrees):.1f}° from its heading (5° are tolerated)."
    assert (words in judge(ahead).text) == (answer == "no")
    assert [item["outside_tolerance"] for item in comparison_json(ahead)["stops"]] == [False, answer == "no"]


def test_a_stop_passed_outside_its_tolerance_was_not_acquired_whether_it_was_scanned_or_not() -> None:
    passed = (Unconfirmed, 133.0, {"stop": "S2", "pose": at(3.2, 1.2), "reason": "no word"})
    away = run(*visit("S1", 0, 1, 1), *visit("S2", 70, 3.2, 1, scan=False), passed, (Finished, 134.0, {}))
    words = "passed 200 mm from its stop (50 mm are tolerated)"
    assert judge(away).answer == "no" and f"S2 was {words}." in judge(away).text
    assert f"{words}; no word" in comparison_text(away)
    assert [item["outside_tolerance"] for item in comparison_json(away)["stops"]] == [False, True]


def test_without_a_plan_all_stops_must_have_been_scanned() -> None:
    mission = square_tour()
    all_of_them = [*visit("S1", 0, 4, 0), *visit("S2", 70, 4, 3), (Finished, 133.0, {})]
    assert judge(compare(told(mission, START, *all_of_them), [mission])).answer == "yes"
    ended = (Finished, 133.0, {})
    assert judge(compare(told(mission, START, *all_of_them[:3], ended), [mission])).answer == "no"
    assert judge(compare(told(mission, START, ended), [mission])).answer == "no"
    assert judge(compare(told(mission, START), [mission])).answer == "unknown"


def test_offsets_are_along_across_and_in_heading() -> None:
    """S2 of the square tour is come to in the direction of +y and faces it."""
    mission = square_tour()
    pose = at(4.01, 3.02, math.pi / 2 + 0.1)
    log = told(mission, START, (Arrived, 9.0, {"stop": "S2", "pose": pose, "deviation_m": 0.0224}))
    item = compare(log, [mission]).stops[1]
    assert (item.along_m, item.across_m, item.heading_rad) == pytest.approx((0.02, -0.01, 0.1))
    assert (item.outcome, item.deviation_m) == ("arrived", pytest.approx(math.hypot(0.01, 0.02)))


def test_late_is_the_first_arrival_and_tries_are_counted() -> None:
    mission = square_tour()
    log = told(
        mission,
        START,
        *visit("S1", 10, 4, 0, scan=False),
        (Failed, 40.0, {"stop": "S1", "reason": "scan: timeout"}),
        *visit("S1", 100, 4, 0),
    )
    item = compare(log, [mission]).stops[0]
    assert (item.arrived_s, item.tries, item.settle_s, item.outcome) == (10.0, 2, 3.0, "scanned")
    assert item.late_s == pytest.approx(10.0 - 5.0)  # 4 m at 1 m/s and 1 m/s²
    assert item.reason == ""


def test_a_skip_after_a_failure_reports_both_reasons() -> None:
    mission = square_tour()
    log = told(
        mission,
        START,
        (Failed, 40.0, {"stop": "S1", "reason": "scan: timeout"}),
        (Skipped, 60.0, {"stop": "S1", "reason": "skip by ann"}),
    )
    assert compare(log, [mission]).stops[0].reason == "scan: timeout; skip by ann"


def test_the_states_of_a_run_follow_one_another_without_a_gap() -> None:
    log = told(
        square_tour(),
        START,
        (Paused, 10.0, {"reason": "pause by ann"}),
        (Resumed, 25.0, {"commander": "ann"}),
        (Held, 40.0, {"reason": "blocked"}),
        (Skipped, 70.0, {"stop": "S1", "reason": "skip by ann"}),
        (Homing, 80.0, {"reason": "all stops are behind"}),
        (Finished, 90.0, {}),
    )
    compared = compare(log, [square_tour()])
    assert [(s.state, s.begin_s, s.end_s) for s in compared.spans] == [
        ("RUNNING", 0.0, 10.0),
        ("PAUSED", 10.0, 25.0),
        ("RUNNING", 25.0, 40.0),
        ("HELD", 40.0, 70.0),
        ("RUNNING", 70.0, 80.0),
        ("HOMING", 80.0, 90.0),
    ]
    assert compared.seconds_in("PAUSED", "HELD") == 45.0


def test_what_is_reported_is_what_was_computed() -> None:
    skipped = run(
        *visit("S1", 0, 1, 1), (Skipped, 65.0, {"stop": "S2", "reason": "skip\x1b[31m"}), (Finished, 70.0, {})
    )
    text, told_json = comparison_text(skipped), comparison_json(skipped)
    assert "\x1b" not in text
    assert "57.1" in text
    assert "21.4" in text
    assert told_json["coverage"]["acquired"] == pytest.approx(8 / 14)
    assert told_json["stops"][1]["lost"] == pytest.approx(3 / 14)
    assert (told_json["answer"], told_json["scanned"], told_json["asked"]) == ("no", 1, 2)


def test_a_log_of_nothing_is_compared_too() -> None:
    mission = square_tour()
    empty = RunLog("r1", None, None, None, told(mission).source)
    compared = compare(empty, [mission])
    assert [item.outcome for item in compared.stops] == ["not reached", "not reached"]
    assert (compared.spans, compared.cross_track.greatest_m) == ((), None)
    assert comparison_text(compared)


def test_standing_still_is_counted_between_two_times() -> None:
    events = told(
        square_tour(),
        START,
        (Paused, 10.0, {"reason": "pause by ann"}),
        (Resumed, 25.0, {"commander": "ann"}),
        (Held, 40.0, {"reason": "blocked"}),
    ).events
    assert paused_s(events, since_s=0.0, until_s=30.0) == 15.0
    assert paused_s(events, since_s=20.0, until_s=50.0) == 5.0 + 10.0
    assert paused_s(events[:1], since_s=0.0, until_s=50.0) == 0.0


def test_of_repeated_visits_the_last_reason_counts_and_of_a_skip_after_a_failure_both() -> None:
    told_of = {"stop": "S1", "pose": at(0, 0)}
    again = [(Unconfirmed, s, {**told_of, "reason": f"stood {s:g} s; no word"}) for s in (8.0, 9.0)]
    assert run(*again).stops[0].reason == "stood 9 s; no word"
    given_up = run(
        (Failed, 8.0, {"stop": "S1", "reason": "scan: timeout"}),
        (Skipped, 9.0, {"stop": "S1", "reason": "skip by ann"}),
    )
    assert given_up.stops[0].reason == "scan: timeout; skip by ann"


def test_stops_that_somebody_jumped_over_are_named_with_the_commands_that_scan_them() -> None:
    skip = {"stop": "S2", "reason": f"{JUMPED_OVER}: the vehicle's current item was set beyond it"}
    text = comparison_text(run(START, *visit("S1", 0, 1, 1), (Skipped, 65.0, skip), (Finished, 70.0, {})))
    (line,) = [line for line in text.splitlines() if line.startswith("not scanned")]
    assert "jumped over by somebody: S2;" in line
    assert (
        "stopgo replay RECORDING" in line and "--top-up next.json" in line and "stopgo start --again" in line
    )


def test_a_stop_that_was_skipped_by_command_is_not_named_as_jumped_over() -> None:
    skip = {"stop": "S2", "reason": "skip by ann"}
    comparison = run(START, *visit("S1", 0, 1, 1), (Skipped, 65.0, skip), (Finished, 70.0, {}))
    assert "jumped over" not in comparison_text(comparison)
