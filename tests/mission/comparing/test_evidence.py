"""Yes and no only from evidence; else undecided, with the stop and what is missing."""

from __future__ import annotations

import msgspec
import pytest

from stopgo.mission.comparing.compare import compare
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.comparison_text import comparison_table
from stopgo.mission.comparing.run_verdict import judge
from stopgo.mission.run.events import Aborted, Arrived, Finished, Held, Resumed, Skipped, Unconfirmed
from stopgo.mission.run.run_log import RunLog
from tests.mission.comparing.reports import at, told
from tests.mission.comparing.test_compare import START, planned, visit
from tests.mission.comparing.test_path_deviation import line
from tests.mission.worlds import square_tour

BLOCKED = {"reason": "the path to S2 is blocked at (4.00, 1.50): a pallet"}
END = (Finished, 140.0, {})


def compared(*events: tuple, poses: list[tuple] = []) -> Comparison:  # noqa: B006
    mission = square_tour()
    return compare(told(mission, START, *events, poses=poses), [mission])


def test_a_stop_that_was_skipped_while_its_path_was_blocked_says_where() -> None:
    skip = (Skipped, 90.0, {"stop": "S2", "reason": "skip by ann"})
    run = compared(*visit("S1", 0, 4, 0), (Held, 80.0, BLOCKED), skip, END)
    assert run.stops[1].reason == f"{BLOCKED['reason']}; skip by ann"
    assert BLOCKED["reason"] in comparison_table(run)
    assert run.stops[0].reason == ""
    driven_on = compared(
        *visit("S1", 0, 4, 0), (Held, 80.0, BLOCKED), (Resumed, 85.0, {"commander": "a"}), skip, END
    )
    assert driven_on.stops[1].reason == "skip by ann"


def test_a_hold_without_a_place_takes_it_from_the_poses() -> None:
    held = (Held, 80.0, {"reason": "an obstacle"})
    events = (*visit("S1", 0, 4, 0), held, (Skipped, 90.0, {"stop": "S2", "reason": "skip by ann"}), END)
    assert (
        compared(*events, poses=line(60, (4, 0), (4, 2))).stops[1].reason
        == "an obstacle at (4.00, 2.00); skip by ann"
    )
    assert compared(*events).stops[1].reason == "an obstacle; skip by ann"


def test_an_abort_while_the_path_was_blocked_says_so() -> None:
    run = compared(*visit("S1", 0, 4, 0), (Held, 80.0, BLOCKED), (Aborted, 90.0, {"reason": "abort by ann"}))
    assert (run.stops[1].outcome, run.stops[1].reason) == ("not reached", BLOCKED["reason"])
    assert judge(run).answer == "no"


@pytest.mark.parametrize(("x", "answer"), [(4.04, "yes"), (0.5, "unknown")])
def test_a_pose_in_an_event_is_compared_with_the_poses_sent(x: float, answer: str) -> None:
    """S1 is reported at (4, 0); the poses that the robot sent meanwhile say another place."""
    events = (*visit("S1", 0, 4, 0), *visit("S2", 70, 4, 3), END)
    run = compared(*events, poses=line(0, (x, 0), (x, 0), 64))
    assert judge(run).answer == answer
    assert (run.stops[0].disputed_m is None) == (answer == "yes")
    if answer == "unknown":
        assert judge(run).exit_code == 3
        assert "S1 is undecided: event and sent poses are 3500 mm apart" in judge(run).text
        assert "3500 mm apart" in comparison_table(run)


@pytest.mark.parametrize(("since_s", "answer"), [(0, "unknown"), (66, "yes")])
def test_events_made_later_are_compared_with_all_poses_or_with_none(since_s: int, answer: str) -> None:
    """Of a run that nobody watched: the camera says where it scanned, once somebody asks."""
    late = [(kind, 68.0 + 0.01 * s, fields) for kind, s, fields in visit("S1", 0, 4, 0)]
    events = (*late, *visit("S2", 70, 4, 3), END)
    run = compared(*events, poses=line(since_s, (4, 3), (4, 3), 140))
    assert judge(run).answer == answer
    assert (run.stops[0].disputed_m is None) == (answer == "yes")
    passed_by = compared(*events, poses=[*line(0, (4, 0), (4, 3), 66), *line(66, (4, 3), (4, 3), 140)])
    assert judge(passed_by).answer == "yes"


def test_a_scan_that_both_sources_place_outside_tolerance_is_a_no() -> None:
    """The event says 0.2 m off S1, the poses 3.5 m: one of both is wrong, and neither is within."""
    events = (*visit("S1", 0, 4.2, 0), *visit("S2", 70, 4, 3), END)
    run = compared(*events, poses=line(0, (7.5, 0), (7.5, 0), 64))
    assert run.stops[0].disputed_m is not None
    assert judge(run).answer == "no"
    assert "undecided" not in judge(run).text


def test_a_disputed_scan_is_not_counted_as_coverage() -> None:
    mission, sight = planned()
    log = told(
        mission,
        START,
        *visit("S1", 0, 1, 1),
        *visit("S2", 70, 3.2, 1),
        END,
        poses=line(0, (2, 1), (2, 1), 64),
    )
    run = compare(log, [mission], [sight])
    assert run.acquired is not None
    assert not run.acquired.coverage.whole.met
    assert (judge(run).answer, run.stops[0].disputed_m) == ("unknown", pytest.approx(1.0))


def test_an_unconfirmed_stop_may_be_reported_after_the_robot_left() -> None:
    events = (
        (Arrived, 0.0, {"stop": "S1", "pose": at(4, 0), "deviation_m": 0.0}),
        (Unconfirmed, 70.0, {"stop": "S1", "pose": at(4, 0), "reason": "no word"}),
    )
    run = compared(*events, poses=line(0, (4, 0), (4, 0), 64) + line(64, (4, 0), (4, 2), 6))
    assert run.stops[0].disputed_m is None


def test_a_stop_is_no_no_while_events_are_missing() -> None:
    mission = square_tour()
    log = told(mission, START, *visit("S1", 0, 4, 0), *visit("S2", 70, 4, 3), END)
    holed = tuple(event for event in log.events if getattr(event, "stop", "") != "S2")
    run = compare(without(log, holed), [mission])
    assert judge(run).answer == "unknown"
    assert "The recording lacks events 5 to 7" in judge(run).text
    late = compare(without(log, log.events[4:]), [mission])
    assert (judge(late).answer, late.stops[0].outcome) == ("unknown", "not reached")
    assert "lacks the events before its first" in judge(late).text
    skipped = msgspec.convert(
        {**msgspec.to_builtins(log.events[4]), "event": "Skipped", "reason": "x"}, Skipped
    )
    told_no = compare(without(log, (*log.events[:4], skipped, log.events[-1])), [mission])
    assert judge(told_no).answer == "no"


def without(log: RunLog, events: tuple) -> RunLog:
    return RunLog(log.robot, log.run_id, log.mission_id, log.revision, log.source, log.poses, events)
