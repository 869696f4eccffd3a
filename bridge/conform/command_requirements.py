"""Requirements on the judgement of commands, with a mission in READY: each of these must be refused."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import get_args

from stopgo.bridge.conform.requirements import NotTried, Requirement, must
from stopgo.bridge.conform.robot_bench import RobotBench
from stopgo.bridge.conform.robot_queries import describe, must_reject
from stopgo.bridge.link.protocol import Accepted, encode
from stopgo.mission.document import Mission
from stopgo.mission.run.decision import STATES
from stopgo.mission.run.events import TakenOver
from stopgo.mission.run.run_commands import LONGEST_VALID_S, Verb
from stopgo.mission.run.states import DetailedState

VERBS: tuple[Verb, ...] = get_args(Verb)


def refuses_what_means_nothing(bench: RobotBench, state: DetailedState) -> None:
    """Send every command that has no meaning in this state; each must be refused."""
    for verb in VERBS:
        if state not in STATES[verb]:
            bench.commands.must_refuse(bench.commands.order(verb), "wrong_state")


def ready(bench: RobotBench) -> Mission:
    """Push a mission, wait for READY, and return the mission; this station is the commander."""
    mission = bench.missions.store(bench.missions.mission())
    bench.wait_for_state("READY")
    return mission


@contextmanager
def as_another(bench: RobotBench) -> Iterator[None]:
    """Act as the second station within the block."""
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
            bench.commands.must_refuse(bench.commands.order(verb), "no_mission")


def ready_refuses(bench: RobotBench) -> None:
    ready(bench)
    refuses_what_means_nothing(bench, "READY")


def an_answer_is_stored(bench: RobotBench) -> None:
    """The command is repeated after another mission was pushed; a new judgement would be different."""
    mission = ready(bench)
    order, key = bench.commands.order("skip", revision=mission.revision), bench.keys.command("skip")
    first = bench.ask_raw(key, encode(order))
    ready(bench)
    again = bench.ask_raw(key, encode(order))
    must(first is not None and first == again, "the same command again got another answer")


def an_id_is_for_one_order(bench: RobotBench) -> None:
    ready(bench)
    order = bench.commands.order("skip")
    bench.commands.give(order)
    bench.commands.must_refuse(bench.commands.order("skip", cmd_id=order.cmd_id, stop="another"), "id_reused")


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
        bench.commands.must_refuse(bench.commands.order("skip", **details), "expired")


def a_stop_is_never_late(bench: RobotBench) -> None:
    """In a state where a stop command has no meaning it is refused for the state, not for its age."""
    ready(bench)
    for verb in ("pause", "abort"):
        bench.commands.must_refuse(
            bench.commands.order(verb, issued_ns=0, boot_id=None, valid_for_s=60.0), "wrong_state"
        )


def what_was_meant_is_heeded(bench: RobotBench) -> None:
    ready(bench)
    bench.commands.must_refuse(bench.commands.order("skip", expect_state=("RUNNING",)), "wrong_state")
    bench.commands.must_refuse(bench.commands.order("skip", run_id="another-run"), "wrong_run")
    bench.commands.must_refuse(bench.commands.order("skip", mission_id="another"), "wrong_mission")
    bench.commands.must_refuse(bench.commands.order("skip", revision=10**6), "wrong_mission")


def an_older_fence_is_fenced(bench: RobotBench) -> None:
    ready(bench)
    lease = bench.info().lease
    must(lease is not None, "after a push Info reports no lease")
    assert lease is not None
    must(lease.commander == bench.commander, f"after a push {lease.commander} holds the lease")
    bench.commands.must_refuse(bench.commands.order("skip", fence=lease.fence - 1), "fenced")


def another_is_not_the_commander(bench: RobotBench) -> None:
    ready(bench)
    with as_another(bench):
        bench.commands.must_refuse(bench.commands.order("skip"), "not_the_commander")
        reply = bench.missions.push(bench.missions.mission())
        must_reject(reply, "not_the_commander")


def anybody_may_stop(bench: RobotBench) -> None:
    """In READY a stop command has no meaning; it must be refused for the state alone."""
    ready(bench)
    with as_another(bench):
        for verb in ("pause", "abort"):
            bench.commands.must_refuse(bench.commands.order(verb), "wrong_state")


def taking_over_is_recorded(bench: RobotBench) -> None:
    ready(bench)
    lease, newest = bench.info().lease, bench.info().state.last_event
    mission = bench.missions.mission()
    with as_another(bench):
        other = bench.commander
        reply = bench.missions.push(mission, take_over=True)
        must(isinstance(reply, Accepted), f"a push that takes over: {describe(reply)}")
    try:
        now = bench.info().lease
        must(now is not None and now.commander == other, "a push that takes over does not get the lease")
        must(
            lease is None or now is None or now.fence > lease.fence,
            "`fence` does not grow with the commander",
        )
        told = [event for event in bench.log(newest) if isinstance(event, TakenOver)]
        must(told and told[-1].commander == other, "the journal has no TakenOver")
        stale = bench.commands.order("skip", fence=lease.fence if lease else 0)
        bench.commands.must_refuse(stale, "fenced")
    finally:
        bench.missions.push(bench.missions.mission(), take_over=True)


ORDERS: tuple[Requirement[RobotBench], ...] = tuple(
    Requirement("Commands", text, test)
    for text, test in (
        ("READY: every command except `start` is `wrong_state`", ready_refuses),
        ("the same command again gets the stored answer", an_answer_is_stored),
        ("another command under a used id: `id_reused`", an_id_is_for_one_order),
        ("commands too late, too long, of another boot: `expired`", late_orders_are_expired),
        ("`pause` and `abort` are never late", a_stop_is_never_late),
        ("a command counts only for its intended state", what_was_meant_is_heeded),
        ("an older fence: `fenced`", an_older_fence_is_fenced),
        ("without the lease: `not_the_commander`", another_is_not_the_commander),
        ("`pause` and `abort` need no lease", anybody_may_stop),
        ("a change of hands is recorded, and fences", taking_over_is_recorded),
    )
)
IDLE: tuple[Requirement[RobotBench], ...] = (
    Requirement("Commands", "IDLE: every command is `no_mission`", idle_has_no_mission),
)
