"""Requirements on a station when answers are lost, late, forged, or of a newer version."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import count
from typing import Any

import msgspec

from stopgo.bridge.conform.fake_robot import lost, no_answer, plainly
from stopgo.bridge.conform.requirements import Requirement, must
from stopgo.bridge.conform.station_bench import DONE, NO, UNKNOWN, StationBench, changed_answer, must_exit
from stopgo.bridge.link.link import Answering, Request, Unanswered
from stopgo.bridge.link.protocol import Booted, ChunkHeld, Rejected, encode
from stopgo.mission.run.run_commands import LONGEST_VALID_S

LATE_S = 2.0
"""Delay of a late answer: longer than the timeout of one try, shorter than that of the request."""
WATCHED_SCAN_S = 40.0
"""Scan time with which a run of two stops, at ten times the speed, outlasts the start of a slow watch."""
STOP_BYTES = 1000
"""Largest size of a pause or an abort."""


def _on(part: str, instead: Callable[[Request, Answering], bytes]) -> Callable[[Request, Answering], bytes]:
    """Put a fault into queries whose key contains `part`."""

    def fault(request: Request, answer: Answering) -> bytes:
        return instead(request, answer) if part in request.key else plainly(request, answer)

    return fault


def _first(part: str, instead: Callable[[Request, Answering], bytes]) -> Any:
    """Put a fault into the first query whose key contains `part`."""
    seen: list[Request] = []

    def fault(request: Request, answer: Answering) -> bytes:
        if part not in request.key or seen:
            return plainly(request, answer)
        seen.append(request)
        return instead(request, answer)

    return fault


# Orders


def an_order_is_for_one_boot_and_state(bench: StationBench) -> None:
    mission = bench.ready()
    before_ns = bench.robot.wall.now_ns()
    must_exit(bench.does("start"), DONE, "a start that was carried out is not reported as done")
    orders = bench.orders("start")
    must(orders, "no start came")
    order = orders[0]
    must(order.boot_id == bench.robot.controller.boot_id, f"boot_id is {order.boot_id}, not the one of info")
    must(0 < order.valid_for_s <= LONGEST_VALID_S, f"valid_for_s is {order.valid_for_s}")
    must(before_ns <= order.issued_ns, "issued_ns is not the clock that info reported")
    must(order.mission_id in (None, mission.id), "mission_id is another mission's")
    must(
        order.expect_state is None or "READY" in order.expect_state, "expect_state is not the state reported"
    )
    must(len(order.cmd_id) >= 16, "cmd_id is too short to be nobody else's")


def an_order_keeps_its_id(bench: StationBench) -> None:
    bench.ready()
    with bench.faults(_first("/cmd/start", lost)):
        code = bench.does("start")
    ids = {order.cmd_id for order in bench.orders("start")}
    must(len(ids) == 1, f"a start without an answer was sent under {len(ids)} ids")
    payloads = {request.payload for request in bench.asked("cmd/start")}
    must(len(payloads) == 1, "a start that was sent again under one id is another")
    must_exit(code, DONE, "a start whose first answer was lost is not reported as done")


def silence_is_unknown(bench: StationBench) -> None:
    bench.ready()
    with bench.faults(_on("/cmd/start", lost)):
        must_exit(bench.does("start"), UNKNOWN, "a start without an answer is not reported as unknown")
    must(bench.orders("start"), "no start came")
    ids = {order.cmd_id for order in bench.orders("start")}
    must(len(ids) == 1, f"a start without an answer was sent under {len(ids)} ids")


def a_late_answer_counts(bench: StationBench) -> None:
    bench.ready()

    def late(request: Request, answer: Answering) -> bytes:
        reply = answer(request)
        time.sleep(LATE_S)
        return reply

    with bench.faults(_first("/cmd/start", late)):
        must_exit(bench.does("start"), DONE, "a start that was answered late is not reported as done")
    must(len({order.cmd_id for order in bench.orders("start")}) == 1, "a late answer made a second command")


def a_refusal_is_told_and_left_at_that(bench: StationBench) -> None:
    bench.ready()
    must_exit(bench.does("resume"), NO, "a resume that was refused is not reported as refused")
    ids = {order.cmd_id for order in bench.orders("resume")}
    must(len(ids) <= 1, f"a resume that was refused was ordered {len(ids)} times")


def the_lease_is_not_taken_unasked(bench: StationBench) -> None:
    bench.ready()
    bench.leased_to("somebody-else")
    must_exit(bench.does("start"), NO, "a start under another's lease is not reported as refused")
    must(bench.orders("start"), "no start came")
    must(not any(order.take_over for order in bench.orders("start")), "it takes over though nobody said so")
    lease = bench.robot.controller.lease
    must(lease is not None and lease.commander == "somebody-else", "it has taken the lease")


def a_stop_asks_nothing_first(bench: StationBench) -> None:
    bench.long_run()
    with bench.faults(lambda request, answer: _only("/cmd/", request, answer)):
        must_exit(bench.does("pause"), DONE, "a pause without a state of the robot is not reported as done")
    must(bench.orders("pause"), "a robot that reports no state gets no pause")
    size = max(len(request.payload) for request in bench.asked("cmd/pause"))
    must(size <= STOP_BYTES, f"a pause has {size} bytes")
    must(bench.robot.controller.run.state == "PAUSED", "the robot was not paused")


def _only(part: str, request: Request, answer: Answering) -> bytes:
    return plainly(request, answer) if part in request.key else no_answer(request, answer)


# Missions


def a_push_is_whole_and_read_back(bench: StationBench) -> None:
    bench.at_rest()
    mission = bench.large()
    must_exit(bench.does("push", mission), DONE, "a push that was taken is not reported as done")
    must(bench.robot.holds(mission), "the robot does not hold what was to be pushed")
    manifest = bench.announced()[-1]
    numbers = bench.chunks()
    must(sorted(set(numbers)) == list(range(manifest.chunks)), f"chunks {numbers} came of {manifest.chunks}")
    tails = bench.tails()
    committed = max(index for index, tail in enumerate(tails) if tail.endswith("/commit"))
    must(
        any(tail == "info" or "/part/" in tail for tail in tails[committed + 1 :]),
        "nothing was read back after the commit",
    )
    commit = bench.commits()[-1]
    must(commit.boot_id == bench.robot.controller.boot_id, "a commit does not name the boot it is for")


def a_push_goes_on_where_it_was_cut(bench: StationBench) -> None:
    bench.at_rest()
    mission = bench.large()

    def cut(request: Request, answer: Answering) -> bytes:
        if request.key.endswith(("/chunk/0", "/begin", "/info", "/keep")):
            return plainly(request, answer)
        raise Unanswered

    with bench.faults(cut):
        must_exit(bench.does("push", mission), UNKNOWN, "a push that was cut off is not reported as unknown")
    must(not bench.commits(), "a commit was sent before all chunks were held")
    must_exit(bench.does("push", mission), DONE, "a push that went on is not reported as done")
    must(0 not in bench.chunks(), "a chunk that is held was sent again")
    must(bench.robot.holds(mission), "the robot does not hold what was to be pushed")


def a_commit_is_repeated_as_it_is(bench: StationBench) -> None:
    bench.at_rest()
    mission = bench.mission()
    with bench.faults(_first("/commit", lost)):
        must_exit(
            bench.does("push", mission),
            DONE,
            "a push whose commit is answered late is not reported as done",
        )
    nonces = {commit.nonce for commit in bench.commits()}
    must(len(nonces) == 1, f"one commit was sent under {len(nonces)} nonces")


def a_damaged_chunk_is_not_committed(bench: StationBench) -> None:
    bench.at_rest()
    mission = bench.mission()
    damaged = encode(ChunkHeld(index=0, sha256="0" * 64))
    with bench.faults(_on("/chunk/", lambda request, answer: damaged)):
        code = bench.does("push", mission)
    must(code != DONE, "a push whose chunk arrived damaged is reported as done")
    must(not bench.commits(), "what arrived damaged was committed")


def a_rejection_is_told(bench: StationBench) -> None:
    bench.at_rest()
    no = encode(Rejected(reason="later_reason", messages=("for a reason that nobody knows yet",)))
    with bench.faults(_on("/commit", lambda request, answer: no)):
        code = bench.does("push", bench.mission())
    must(bench.commits(), "no commit came")
    must_exit(code, NO, "a push that was rejected is not reported as rejected")


def acceptance_is_not_believed_blindly(bench: StationBench) -> None:
    """The robot reports another mission after the commit, as if somebody else had pushed."""
    bench.at_rest()
    mission = bench.mission()
    seen: list[Request] = []

    def another_since(request: Request, answer: Answering) -> bytes:
        if request.key.endswith("/commit"):
            seen.append(request)
        if not seen or not request.key.endswith(("/info", "/keep")):
            return plainly(request, answer)
        told = msgspec.json.decode(answer(request))
        told["state"]["mission_id"] = "another"
        return encode(told)

    with bench.faults(another_since):
        code = bench.does("push", mission)
    must(code != DONE, "a push is reported as done although the robot reports another mission")


# A newer robot


def newer_fields_are_passed_over(bench: StationBench) -> None:
    bench.ready()

    def newer(request: Request, answer: Answering) -> bytes:
        return changed_answer(answer, later={"than": [1, 2]}, also="new")(request)

    with bench.faults(newer):
        must_exit(bench.does("start"), DONE, "a robot that adds fields to its answers cannot be started")
    must(bench.orders("start"), "to a robot that adds fields to its answers no start comes")


def an_unknown_state_is_no_hindrance(bench: StationBench) -> None:
    bench.long_run()

    def hovering(request: Request, answer: Answering) -> bytes:
        told = msgspec.json.decode(answer(request))
        told["state"]["state"] = "HOVERING"
        return encode(told)

    with bench.faults(_on("/info", hovering)):
        must_exit(bench.does("status"), DONE, "a robot in an unknown state cannot be queried")
        must_exit(bench.does("pause"), DONE, "a robot in a state that is not known cannot be paused")
    must(bench.orders("pause"), "to a robot in a state that is not known no pause comes")


def unknown_events_are_passed_over(bench: StationBench) -> None:
    bench.ready()
    bench.gives("start")

    def newer(request: Request, answer: Answering) -> bytes:
        page = msgspec.json.decode(answer(request))
        for event in page["events"]:
            if event["event"] == "Settled":
                event["event"], event["later"] = "Levelled", 1
        return encode(page)

    with bench.faults(_on("/log", newer)):
        must_exit(bench.does("watch"), DONE, "a run with unknown events is not followed to its end")


# Following


def missed_events_are_asked_for(bench: StationBench) -> None:
    bench.ready()
    bench.gives("start")
    with bench.faults(publish=lambda key, payload: None if key.endswith("/tel/event") else payload):
        must_exit(bench.does("watch"), DONE, "a run whose events were lost is not followed to its end")
    must(bench.asked("log"), "events that were lost are not requested")


def missed_poses_are_asked_for(bench: StationBench) -> None:
    """During the watch of a run, the poses of every second half second are lost."""
    bench.ready(scan_s=WATCHED_SCAN_S)
    bench.gives("start")
    told = count()

    def half(key: str, payload: bytes) -> bytes | None:
        return None if key.endswith("/tel/pose") and next(told) // 10 % 2 else payload

    with bench.faults(publish=half):
        bench.does("watch")
    must(bench.asked("poses") or bench.asked("record"), "poses that were lost are not requested")


def a_watch_is_known_to_the_robot(bench: StationBench) -> None:
    bench.ready()
    bench.gives("start")
    bench.link.watchers.clear()
    must_exit(bench.does("watch"), DONE, "a run that finished is not reported as done")
    must(bench.link.watchers, "no token on watch/<name> was shown")
    must(bench.asked("keep"), "`keep` was not requested")


# Whom it believes


def two_of_one_name_are_stopped(bench: StationBench) -> None:
    bench.long_run()
    there = True
    other = {"boot_id": "twin"}

    def twin(request: Request) -> bytes:
        if not there:
            raise Unanswered
        told = bench.info()
        return encode({**told, **other, "state": {**told["state"], **other}})

    bench.link.serve_beside(bench.robot.keys.info, twin)
    bench.link.serve_beside(bench.robot.keys.boot, lambda request: _boot_of(there))
    try:
        code = bench.does("resume")
    finally:
        there = False
    must(code != DONE, "a command to two robots of one name is reported as done")
    must(not bench.orders("resume"), "a command was sent although two robots have the name")
    must(bench.orders("pause"), "two robots of one name are not paused")


def _boot_of(there: bool) -> bytes:
    if not there:
        raise Unanswered
    return encode(Booted(boot_id="twin"))


def questions_are_signed(bench: StationBench) -> None:
    with bench.forging("no such key"):
        bench.ready()
        must_exit(bench.does("start"), DONE, "a start that was carried out is not reported as done")
    holders = {request.holder for request in bench.asked("cmd/start")}
    must(holders and None not in holders, "a start without a valid message signature")


def forged_states_are_not_believed(bench: StationBench) -> None:
    bench.ready()
    with bench.forging("/info"):
        code = bench.does("start")
    must(code != DONE, "a start after a forged Info is reported as done")
    must(not bench.orders("start"), "a command was made from an Info without a valid message signature")


def forged_answers_are_not_believed(bench: StationBench) -> None:
    bench.ready()
    with bench.forging("/cmd/"):
        must_exit(bench.does("start"), UNKNOWN, "a start with a forged answer is not reported as unknown")


STATION_REQUIREMENTS: tuple[Requirement[StationBench], ...] = tuple(
    Requirement(section, text, test)
    for section, text, test in (
        ("Commands", "a command names boot, clock and state as reported", an_order_is_for_one_boot_and_state),
        (
            "Commands",
            "an answer lost: the same command again, under its id",
            an_order_keeps_its_id,
        ),
        ("Commands", "no answer: reported as unknown, one id", silence_is_unknown),
        ("Commands", "a late answer makes no second command", a_late_answer_counts),
        ("Commands", "a refusal is reported, and not tried again", a_refusal_is_told_and_left_at_that),
        ("Commands", "another's lease is not taken without a request", the_lease_is_not_taken_unasked),
        ("Commands", "`pause` is sent without asking, and small", a_stop_asks_nothing_first),
        ("Pushing a mission", "every chunk, then the commit, then a look", a_push_is_whole_and_read_back),
        ("Pushing a mission", "a cut: goes on with what is missing", a_push_goes_on_where_it_was_cut),
        ("Pushing a mission", "a commit is repeated under its nonce", a_commit_is_repeated_as_it_is),
        ("Pushing a mission", "a chunk with another hash is not committed", a_damaged_chunk_is_not_committed),
        ("Pushing a mission", "a rejection is reported, for unknown reasons too", a_rejection_is_told),
        ("Pushing a mission", "done only when the state reports so", acceptance_is_not_believed_blindly),
        ("Messages", "fields that are not known are passed over", newer_fields_are_passed_over),
        ("Messages", "a state that is not known is no hindrance", an_unknown_state_is_no_hindrance),
        ("Events", "events that are not known are passed over", unknown_events_are_passed_over),
        ("Events", "events that were missed are requested", missed_events_are_asked_for),
        ("Events", "poses that were missed are requested", missed_poses_are_asked_for),
        ("Keys", "who watches shows a token and asks `keep`", a_watch_is_known_to_the_robot),
        ("One robot, one name", "two boots: no command, both paused", two_of_one_name_are_stopped),
        ("Signatures", "queries are signed", questions_are_signed),
        ("Signatures", "an Info without a valid signature: no command", forged_states_are_not_believed),
        ("Signatures", "an answer without a valid signature: unknown", forged_answers_are_not_believed),
    )
)
