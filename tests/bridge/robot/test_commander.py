"""One commander at a time, and nobody's order carried out twice or too late."""

from __future__ import annotations

import contextlib
import json
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.console import print_line, refusals_printed, reporting_done
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import encode
from stopgo.mission.errors import NegativeResult, OutcomeUnknown
from stopgo.mission.run.events import STOPS_LISTED, TakenOver
from stopgo.mission.run.lease import LEASE_S, Lease, claimed
from stopgo.mission.run.run_commands import Answer, Refused, Verb
from tests.bridge.world import Field, corridor

ALICE = Lease(commander="alice", fence=3, until_ns=10_000_000_000)


def claim(lease: Lease | None, who: str, *, now_s: float = 0.0, **details: object) -> Lease | Refused:
    given = {"fence": None, "take_over": False} | details
    return claimed(lease, who, now_ns=round(now_s * 1e9), **given)  # type: ignore[arg-type]


def test_a_free_robot_is_anyones() -> None:
    assert claim(None, "bob") == Lease(commander="bob", fence=1, until_ns=round(LEASE_S * 1e9))


def test_a_command_renews_the_lease_and_keeps_its_number() -> None:
    assert claim(ALICE, "alice", now_s=5) == Lease(
        commander="alice", fence=3, until_ns=round((5 + LEASE_S) * 1e9)
    )


def test_another_is_denied_until_the_lease_has_run_out() -> None:
    denied = claim(ALICE, "bob", now_s=4)
    assert isinstance(denied, Refused)
    assert "alice commands it for 6 s more" in denied.message
    assert claim(ALICE, "bob", now_s=10) == Lease(commander="bob", fence=4, until_ns=round(70e9))


def test_taking_over_raises_the_fence_and_older_commands_stay_outside() -> None:
    taken = claim(ALICE, "bob", take_over=True)
    assert isinstance(taken, Lease)
    assert (taken.commander, taken.fence) == ("bob", 4)
    late = claim(taken, "alice", now_s=100, fence=3)
    assert isinstance(late, Refused)
    assert late.reason == "fenced"


def test_a_clock_that_jumped_back_does_not_lengthen_a_lease() -> None:
    far = Lease(commander="alice", fence=1, until_ns=round(1e15))
    denied = claim(far, "bob")
    assert isinstance(denied, Refused)
    assert "60 s more" in denied.message


def test_pause_and_abort_need_no_lease_but_resume_does() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    assert field.order("pause", commander="bob").outcome == "ok"
    assert field.order("resume", commander="bob").reason == "not_the_commander"
    assert field.order("abort", commander="bob").outcome == "ok"
    assert field.controller.lease == field.journal.fact("lease", Lease)
    assert field.controller.lease is not None
    assert field.controller.lease.commander == "test"


def test_a_take_over_is_recorded_with_both_names() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    assert field.order("skip", commander="bob", take_over=True).outcome == "ok"
    events = [event for event in field.journal.events() if isinstance(event, TakenOver)]
    assert [(event.before, event.commander) for event in events] == [("test", "bob")]


def test_the_lease_outlives_a_reboot() -> None:
    field = Field()
    field.station().push(corridor())
    field.boot()
    assert field.order("start", commander="bob").reason == "not_the_commander"


def test_a_push_needs_the_lease_too() -> None:
    field = Field()
    field.station().push(corridor())
    station = field.station()
    station.commander = "bob"
    with pytest.raises(NegativeResult, match="not_the_commander: test commands it"):
        station.push(corridor(revision=2))
    assert station.push(corridor(revision=2), take_over=True).revision == 2


def test_a_command_is_carried_out_once_though_it_comes_three_times_and_over_a_reboot() -> None:
    field = Field()
    field.station().push(corridor())
    start = field.command("start")
    first = field.controller.execute(start)
    field.boot()
    assert field.controller.execute(start) == first
    field.clock.wait(3600)
    assert field.controller.execute(start) == first
    assert field.told() == ["Started", "Paused"]


def test_an_id_used_for_another_order_is_refused() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start", cmd_id="once")
    assert field.order("pause", cmd_id="once").reason == "id_reused"
    assert field.controller.run.state == "RUNNING"


@pytest.mark.parametrize("valid_for_s", [0.0, -1.0, 61.0, 1e300])
def test_a_command_may_not_be_valid_for_ever(valid_for_s: float) -> None:
    field = Field()
    field.station().push(corridor())
    assert field.order("start", valid_for_s=valid_for_s).reason == "expired"


def test_a_station_sends_commands_for_the_robot_as_it_saw_it() -> None:
    field = Field()
    station = field.station()
    station.push(corridor())
    assert station.command("start").state == "RUNNING"
    with pytest.raises(NegativeResult, match="wrong_state"):
        station.command("resume")
    assert station.command("pause").state == "PAUSED"


def test_a_refusal_is_printed_as_json_where_json_is_wanted(capsys: pytest.CaptureFixture[str]) -> None:
    station = Field().station()
    station.push(corridor())
    for as_json in (False, True):
        with pytest.raises(NegativeResult) as no, refusals_printed(as_json=as_json):
            station.command("resume")
        printed = capsys.readouterr().out
        told = {"outcome": "refused", "reason": "wrong_state", "message": str(no.value)}
        assert (json.loads(printed) if as_json else printed) == (told if as_json else "")


class Mute:
    """A link that passes orders on, and no question."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self.asked: list[str] = []

    def ask(self, key: str, payload: bytes = b"", **options: Any) -> bytes | None:
        self.asked.append(key)
        return self._link.ask(key, payload, **options) if "/cmd/" in key else None


@pytest.mark.parametrize(("verb", "state"), [("pause", "PAUSED"), ("abort", "ABORTED")])
def test_a_stop_needs_nothing_that_the_robot_reports(verb: Verb, state: str) -> None:
    field = Field()
    station = field.station()
    station.push(corridor())
    field.order("start")
    station.link = mute = Mute(station.link)  # type: ignore[assignment]
    assert station.command(verb).state == state
    assert len(mute.asked) == 1


def test_a_stop_is_small_whatever_the_mission() -> None:
    order = Field().station().stop_order("pause")
    assert len(encode(order)) < 400


def test_a_stop_that_comes_very_late_still_stops() -> None:
    field = Field()
    field.station().push(corridor())
    late = field.station().stop_order("pause")
    field.order("start")
    field.clock.jump(3600.0)
    assert field.controller.execute(late).state == "PAUSED"


def test_a_state_is_small_whatever_the_mission_and_status_reports_every_stop() -> None:
    field = Field()
    station = field.station()
    names = tuple(f"s{number}" for number in range(1, 61))
    station.push(corridor(stops=60))
    field.order("start")
    for _ in names:
        field.order("skip")
    assert station.info().state.skipped == names[-STOPS_LISTED:]
    assert station.status().skipped == names


def watched(field: Field, who: str, *, seconds: float) -> None:
    """The robot works, and somebody watches it, and says so every 5 s."""
    station = field.station(commander=who)
    for _ in range(round(seconds / 5)):
        field.clock.wait(5.0)
        assert station.keep() is not None


def test_whoever_runs_a_mission_keeps_it_by_watching() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    watched(field, "test", seconds=600)
    assert field.order("skip", commander="bob").reason == "not_the_commander"
    assert field.order("skip", commander="bob", take_over=True).outcome == "ok"


def test_others_who_watch_keep_nobody_s_lease_and_a_run_that_is_over_keeps_none() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    watched(field, "bob", seconds=LEASE_S + 5)
    assert field.order("pause", commander="bob").outcome == "ok"
    assert field.order("resume", commander="bob").outcome == "ok"
    field.work()
    watched(field, "bob", seconds=LEASE_S + 5)
    assert field.order("start", commander="carl", again=True).reason != "not_the_commander"


def test_watching_writes_the_lease_down_twice_a_minute() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    written: list[str] = []
    field.journal.rows.commit_hook = written.append
    watched(field, "test", seconds=300)
    assert written.count("committed") == 10


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_what_a_robot_has_done_and_cannot_be_reported_is_unknown_not_unsent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        with (
            pytest.raises(OutcomeUnknown, match="start was carried out"),
            reporting_done("start was carried out"),
        ):
            print_line("r1: start ok")
        monkeypatch.undo()
        with contextlib.suppress(OSError):
            full.close()


def test_a_stop_does_not_wait_until_it_is_decided_whether_a_robot_may_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As of a mission of thousands of stops, whose schedule takes a second."""
    field, weighing, go_on = Field(), threading.Event(), threading.Event()
    field.station().push(corridor())

    def endurance_s() -> float:
        weighing.set()
        assert go_on.wait(60)
        return 1e6

    monkeypatch.setattr(field.base, "endurance_s", endurance_s)
    answers: list[Answer] = []
    starting = threading.Thread(target=lambda: answers.append(field.order("start")))
    starting.start()
    assert weighing.wait(60)
    monkeypatch.setattr(field.base, "endurance_s", lambda: 1e6)
    stopping = threading.Thread(target=lambda: answers.append(field.order("abort")))
    stopping.start()
    stopping.join(60)
    assert [answer.verb for answer in answers] == ["abort"]
    go_on.set()
    starting.join(60)
    assert [answer.verb for answer in answers] == ["abort", "start"]


def test_a_command_that_was_weighed_before_the_run_changed_is_weighed_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    field, given = Field(), iter(range(2))
    field.station().push(corridor())
    known = field.base.endurance_s

    def endurance_s() -> float | None:
        if next(given, None) == 0:  # somebody else starts it meanwhile
            assert field.order("start").outcome == "ok"
        return known()

    monkeypatch.setattr(field.base, "endurance_s", endurance_s)
    answer = field.order("start")
    assert (answer.outcome, answer.reason) == ("refused", "wrong_state")
    assert field.told().count("Started") == 1
