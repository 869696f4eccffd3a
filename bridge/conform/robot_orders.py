"""How a robot must judge orders, on a mission that lies ready: every one of these is to be refused."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import get_args

from stopgo.bridge.conform.requirements import NotTried, Requirement, must
from stopgo.bridge.conform.robot_bench import RobotBench, rejects, told_of
from stopgo.bridge.link.protocol import Accepted, encode
from stopgo.mission.document import Mission
from stopgo.mission.run.decision import STATES
from stopgo.mission.run.events import TakenOver
from stopgo.mission.run.orders import LONGEST_VALID_S, Verb
from stopgo.mission.run.states import DetailedState

VERBS: tuple[Verb, ...] = get_args(Verb)


def refuses_what_means_nothing(bench: RobotBench, place: DetailedState) -> None:
    """Give every order that means nothing in this place; each must be refused."""
    for verb in VERBS:
        if place not in STATES[verb]:
            bench.refused(bench.order(verb), "wrong_state")


def ready(bench: RobotBench) -> Mission:
    """A mission that lies ready, and is commanded from here."""
    mission = bench.has(bench.mission())
    bench.wait_for_state("READY")
    return mission


@contextmanager
def as_another(bench: RobotBench) -> Iterator[None]:
    """Another station in this one's place."""
    if bench.other is None:
        raise NotTried("needs a second station: --other-keys DIR")
    own = bench.commander, bench.link
    bench.commander, bench.link = bench.other.name, bench.other.link
    try:
        yield
    finally:
        bench.commander, bench.link = own


def idle_has_no_mission(bench: RobotBench) -> None:
    if bench.info().state.state != "IDLE":
        raise NotTried("the robot holds a mission already")
    for verb in VERBS:
        if verb != "start":
            bench.refused(bench.order(verb), "no_mission")


def ready_refuses(bench: RobotBench) -> None:
    ready(bench)
    refuses_what_means_nothing(bench, "READY")


def an_answer_is_stored(bench: RobotBench) -> None:
    """Asked again when another mission lies ready, which it would be judged by anew."""
    mission = ready(bench)
    order, key = bench.order("skip", revision=mission.revision), bench.keys.command("skip")
    first = bench.ask_raw(key, encode(order))
    ready(bench)
    again = bench.ask_raw(key, encode(order))
    must(first is not None and first == again, "the same order again got another answer")


def an_id_is_for_one_order(bench: RobotBench) -> None:
    ready(bench)
    order = bench.order("skip")
    bench.give(order)
    bench.refused(bench.order("skip", cmd_id=order.cmd_id, stop="another"), "id_reused")


def late_orders_are_expired(bench: RobotBench) -> None:
    ready(bench)
    now_ns = bench.info().clock_ns
    for details in (
        {"issued_ns": now_ns - 10 * 10**9, "valid_for_s": 5.0},
        {"issued_ns": 0},
        {"issued_ns": now_ns + 60 * 10**9},
        {"valid_for_s": LONGEST_VALID_S + 1},
        {"valid_for_s": 0.0},
        {"boot_id": "another-boot"},
    ):
        bench.refused(bench.order("skip", **details), "expired")


def a_stop_is_never_late(bench: RobotBench) -> None:
    """Where it means nothing it is refused for that, and not for its age."""
    ready(bench)
    for verb in ("pause", "abort"):
        bench.refused(bench.order(verb, issued_ns=0, boot_id=None, valid_for_s=60.0), "wrong_state")


def what_was_meant_is_heeded(bench: RobotBench) -> None:
    ready(bench)
    bench.refused(bench.order("skip", expect_state=("RUNNING",)), "wrong_state")
    bench.refused(bench.order("skip", run_id="another-run"), "wrong_run")
    bench.refused(bench.order("skip", mission_id="another"), "wrong_mission")
    bench.refused(bench.order("skip", revision=10**6), "wrong_mission")


def an_older_fence_is_fenced(bench: RobotBench) -> None:
    ready(bench)
    lease = bench.info().lease
    must(lease is not None, "after a push Info tells of no lease")
    assert lease is not None
    must(lease.commander == bench.commander, f"after a push {lease.commander} holds the lease")
    bench.refused(bench.order("skip", fence=lease.fence - 1), "fenced")


def another_is_not_the_commander(bench: RobotBench) -> None:
    ready(bench)
    with as_another(bench):
        bench.refused(bench.order("skip"), "not_the_commander")
        reply = bench.push(bench.mission())
        rejects(reply, "not_the_commander")


def anybody_may_stop(bench: RobotBench) -> None:
    """In a mission that lies ready a stop means nothing; it must be refused for that alone."""
    ready(bench)
    with as_another(bench):
        for verb in ("pause", "abort"):
            bench.refused(bench.order(verb), "wrong_state")


def taking_over_is_recorded(bench: RobotBench) -> None:
    ready(bench)
    lease, newest = bench.info().lease, bench.info().state.last_event
    mission = bench.mission()
    with as_another(bench):
        other = bench.commander
        reply = bench.push(mission, take_over=True)
        must(isinstance(reply, Accepted), f"a push that takes over: {told_of(reply)}")
    try:
        now = bench.info().lease
        must(now is not None and now.commander == other, "a push that takes over does not get the lease")
        must(lease is None or now is None or now.fence > lease.fence, "`fence` does not grow with the hands")
        told = [event for event in bench.log(newest) if isinstance(event, TakenOver)]
        must(told and told[-1].commander == other, "the log tells no TakenOver")
        stale = bench.order("skip", fence=lease.fence if lease else 0)
        bench.refused(stale, "fenced")
    finally:
        bench.push(bench.mission(), take_over=True)


ORDERS: tuple[Requirement[RobotBench], ...] = tuple(
    Requirement("Orders", text, test)
    for text, test in (
        ("READY: every order but `start` is `wrong_state`", ready_refuses),
        ("the same order again gets the stored answer", an_answer_is_stored),
        ("another order under a used id: `id_reused`", an_id_is_for_one_order),
        ("orders too late, too long, of another boot: `expired`", late_orders_are_expired),
        ("`pause` and `abort` are never late", a_stop_is_never_late),
        ("what an order was meant for is heeded", what_was_meant_is_heeded),
        ("an older fence: `fenced`", an_older_fence_is_fenced),
        ("without the lease: `not_the_commander`", another_is_not_the_commander),
        ("`pause` and `abort` need no lease", anybody_may_stop),
        ("a change of hands is recorded, and fences", taking_over_is_recorded),
    )
)
IDLE: tuple[Requirement[RobotBench], ...] = (
    Requirement("Orders", "IDLE: every order is `no_mission`", idle_has_no_mission),
)
