"""Requirements on answers to queries, also to malformed ones; the robot does not move in these tests."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

from stopgo.bridge.conform.requirements import Nonconforming, NotTried, Requirement, must
from stopgo.bridge.conform.robot_bench import RobotBench
from stopgo.bridge.conform.robot_queries import read, read_event
from stopgo.bridge.conform.trial_mission import trial_mission
from stopgo.bridge.conform.trial_pushes import manifest_of
from stopgo.bridge.link.capabilities import RECORD
from stopgo.bridge.link.protocol import (
    LOG_PAGE,
    POSE_PAGE,
    VERSION,
    Booted,
    Commit,
    Info,
    LogPage,
    Malformed,
    PosePage,
    RecordIndex,
    RecordPage,
    Rejected,
    Watching,
    encode,
)
from stopgo.mission.document import Mission
from stopgo.mission.run.events import STOPS_LISTED, UNKNOWN_CHARGE, Pose, StateReport
from stopgo.mission.run.run_commands import RunCommand

STATE_BYTES = 16 * 1024
"""Largest size of a state, with fifty stops done and fifty skipped."""
STATES_S = 3.5
"""Time in which a robot publishes at least three states, one every second."""
OVERSIZE = 2_000_000
"""Bytes of a message that no robot can accept."""
LATER = {"later": {"than": [1, 2, 3]}, "also": None}
"""Fields that a newer peer may add to a message."""


def info_names_the_robot(bench: RobotBench) -> None:
    info = bench.info()
    must(info.protocol == VERSION, f"Info.protocol is {info.protocol}, on keys of version {VERSION}")
    must(info.robot == bench.keys.robot, f"Info.robot is {info.robot}, on keys of {bench.keys.robot}")
    must(info.boot_id and info.state.boot_id == info.boot_id, "Info and its state report different boots")


def boot_is_the_one_of_info(bench: RobotBench) -> None:
    if bench.ask_raw(bench.keys.boot) is None:
        raise NotTried("not answered; a router's rules let nobody but robots ask it: try it without a router")
    booted = bench.ask_for(Booted, bench.keys.boot)
    must(booted.boot_id == bench.info().boot_id, "boot and info report different boots")


def clock_and_state_go_on(bench: RobotBench) -> None:
    first, second = bench.info(), bench.info()
    must(second.clock_ns > first.clock_ns, "Info.clock_ns does not grow")
    must(second.state.seq > first.state.seq, "StateReport.seq does not grow")


def keep_is_answered_with_info(bench: RobotBench) -> None:
    bench.ask_for(Info, bench.keys.keep, encode(Watching(commander=bench.commander)))


def state_is_told_every_second(bench: RobotBench) -> None:
    before = len(bench.published.states)
    time.sleep(STATES_S)
    told = [read(raw, StateReport, "a state") for raw in bench.published.states[before:]]
    must(len(told) >= 3, f"{len(told)} states came in {STATES_S:g} s{_why(bench)}")
    grows = all(one.seq < next_.seq for one, next_ in pairwise(told))
    must(grows, "the `seq` of the published states does not grow")


def _why(bench: RobotBench) -> str:
    return f" that could be believed ({bench.link.distrusted})" if bench.link.distrusted else ""


def states_are_bounded(bench: RobotBench) -> None:
    state = bench.info().state
    size = len(encode(state))
    listed = max(len(state.done), len(state.skipped))
    must(size <= STATE_BYTES, f"a state has {size} bytes")
    must(listed <= STOPS_LISTED, f"a state lists {listed} stops; at most {STOPS_LISTED} are")
    must(state.done_count >= len(state.done), "done_count is less than what `done` lists")
    charge = state.battery
    must(charge == UNKNOWN_CHARGE or 0 <= charge <= 1, f"battery is {charge}; 0 to 1, or -1, is meant")


def log_has_no_gaps(bench: RobotBench) -> None:
    numbers = [event.number for event in bench.log()]
    wanted = list(range(1, len(numbers) + 1))
    gap = next((want for want, number in zip(wanted, numbers, strict=True) if want != number), None)
    must(gap is None, f"event {gap} is missing from the log, or is there twice")
    last = bench.info().state.last_event
    must(last >= len(numbers), f"last_event is {last}, and the log has {len(numbers)} events")


def log_comes_in_pages(bench: RobotBench) -> None:
    page = bench.ask_for(LogPage, bench.keys.log, since="0")
    must(len(page.bodies) <= LOG_PAGE, f"a page has {len(page.bodies)} events; at most {LOG_PAGE}")
    beyond = bench.ask_for(LogPage, bench.keys.log, since=str(page.newest))
    must(not beyond.bodies, "there are events behind the newest")
    for body in page.bodies:
        read_event(bytes(body))


def poses_come_in_pages(bench: RobotBench) -> None:
    page = bench.ask_for(PosePage, bench.keys.poses, since="0")
    must(len(page.poses) <= POSE_PAGE, f"a page has {len(page.poses)} poses; at most {POSE_PAGE}")
    must(page.boot_id == bench.info().boot_id, "poses are of another boot than info reports")
    seqs = [pose.seq for pose in page.poses]
    must(seqs == sorted(set(seqs)), "the `seq` of past poses does not grow")


def parameters_must_be_numbers(bench: RobotBench) -> None:
    keys = (bench.keys.log, bench.keys.poses, *((bench.keys.record,) if keeps_a_record(bench) else ()))
    for key in keys:
        for value in ("-1", "1.5", "many", "9" * 30):
            bench.must_be_malformed(key, b"", f"since={value}", since=value)


def keeps_a_record(bench: RobotBench) -> bool:
    return RECORD in bench.info().capabilities


def record_tells_its_runs(bench: RobotBench) -> None:
    if not keeps_a_record(bench):
        raise NotTried(f"the robot does not name the capability `{RECORD}`")
    runs = [kept.run_id for kept in bench.ask_for(RecordIndex, bench.keys.record).runs]
    must(len(runs) == len(set(runs)), "the record reports a run twice")
    unknown = bench.ask_for(RecordPage, bench.keys.record, run="not-there", since="0")
    must(not unknown.entries and not unknown.newest, "there are entries of a run that never was")


def a_mission_that_is_not_there_is_no_mission(bench: RobotBench) -> None:
    reply = bench.ask(bench.keys.mission("not-there", "part/0"), revision="1")
    told = reply.reason if isinstance(reply, Rejected) else type(reply).__name__
    must(told == "no_mission", f"answered with {told}, not Rejected no_mission")


def unknown_keys_are_malformed(bench: RobotBench) -> None:
    bench.must_be_malformed(bench.keys.mission("not-there", "later"), b"", "a step that is not known")
    later = encode({**_fields(_stop_order(bench)), "verb": "later"})
    bench.must_be_malformed(bench.keys.command("later"), later, "a verb that is not known")


def a_verb_counts_on_its_own_key(bench: RobotBench) -> None:
    order = encode(_stop_order(bench))
    bench.must_be_malformed(bench.keys.command("abort"), order, "a pause")


def unknown_fields_are_passed_over(bench: RobotBench) -> None:
    for what, (key, message) in _messages(bench).items():
        plain, later = (bench.ask(key, encode(told)) for told in (message, {**message, **LATER}))
        must(
            not isinstance(later, Malformed) or isinstance(plain, Malformed),
            f"{what} with fields that are not known was answered with Malformed: they are to be passed over",
        )
        must(type(later) is type(plain), f"{what} with fields that are not known got another answer")


def cut_messages_are_malformed(bench: RobotBench) -> None:
    for what, (key, message) in _messages(bench).items():
        whole = encode(message)
        for length in (0, 1, len(whole) // 2, len(whole) - 1):
            bench.must_be_malformed(key, whole[:length], f"{what} cut to {length} bytes")


def missing_fields_are_malformed(bench: RobotBench) -> None:
    for what, (key, message) in _messages(bench).items():
        needed = "commander" if "commander" in message else "sha256"
        less = {name: value for name, value in message.items() if name != needed}
        bench.must_be_malformed(key, encode(less), f"{what} without {needed}")


def wrong_types_are_malformed(bench: RobotBench) -> None:
    wrong: dict[str, tuple[str, Any]] = {
        "a revision of text": ("begin", {"revision": "1"}),
        "a revision of 5.0": ("begin", {"revision": 5.0}),
        "a revision below 0": ("begin", {"revision": -1}),
        "a size beyond 2^53": ("begin", {"size": 2**53 + 1}),
        "a commander of 201 letters": ("keep", {"commander": "x" * 201}),
        "an empty commander": ("keep", {"commander": ""}),
        "a command id that is a number": ("pause", {"cmd_id": 7}),
        "a fence of text": ("pause", {"fence": "1"}),
    }
    messages = _messages(bench)
    for what, (name, change) in wrong.items():
        key, message = messages[name]
        bench.must_be_malformed(key, encode({**message, **change}), what)


def what_is_no_json_is_malformed(bench: RobotBench) -> None:
    for what, (key, _) in _messages(bench).items():
        for name, payload in NO_JSON.items():
            bench.must_be_malformed(key, payload, f"{name} for {what}")


NO_JSON = {
    "bytes that are not UTF-8": b'{"is": "Watching", "commander": "\xff\xfe"}',
    "brackets nested 20 000 deep": b"[" * 20_000,
    "NaN": b"NaN",
    "a list": b"[]",
}


def oversize_does_no_harm(bench: RobotBench) -> None:
    """The message may be answered or not; the robot must answer after it."""
    payload = encode({"is": "Watching", "commander": "x", "later": "x" * OVERSIZE})
    bench.link.ask(bench.keys.keep, payload, timeout_s=1.0)
    bench.wait(lambda: _info_if_there(bench), 20.0, "the robot did not answer after a message of 2 MB")


def _info_if_there(bench: RobotBench) -> Info | None:
    try:
        return bench.info()
    except Nonconforming:
        return None


def _messages(bench: RobotBench) -> dict[str, tuple[str, dict[str, Any]]]:
    """Return key expression and fields of a message of each kind; none has an effect if it is executed."""
    mission = _unsent(bench)
    manifest = manifest_of(mission, json.dumps(json.loads(encode(mission))).encode())
    info = bench.info()
    commit = Commit(
        manifest=manifest, commander=bench.commander, nonce="n", not_after_ns=info.clock_ns,
        boot_id=info.boot_id,
    )  # fmt: skip
    order: Callable[[str], str] = lambda step: bench.keys.mission(mission.id, step)  # noqa: E731
    return {
        "keep": (bench.keys.keep, _fields(Watching(commander=bench.commander))),
        "begin": (order("begin"), _fields(manifest)),
        "commit": (order("commit"), _fields(commit)),
        "pause": (bench.keys.command("pause"), _fields(_stop_order(bench))),
    }


def _unsent(bench: RobotBench) -> Mission:
    return trial_mission(f"{bench.missions.mission_id}-unsent", 1, Pose(x=0.0, y=0.0, heading=0.0))


def _stop_order(bench: RobotBench) -> RunCommand:
    return bench.commands.order("pause", issued_ns=0)


def _fields(message: Any) -> dict[str, Any]:
    fields = json.loads(encode(message))
    assert isinstance(fields, dict)
    return fields


QUESTIONS: tuple[Requirement[RobotBench], ...] = (
    Requirement("Keys", "`info` reports protocol, name and boot", info_names_the_robot),
    Requirement("Keys", "`boot` reports the boot that `info` reports", boot_is_the_one_of_info),
    Requirement("Keys", "`keep` is answered with Info", keep_is_answered_with_info),
    Requirement("Keys", "the clock and the states' `seq` go on", clock_and_state_go_on),
    Requirement("Keys", "the state is published at least every second", state_is_told_every_second),
    Requirement("Keys", "the log comes in pages of at most 100 events", log_comes_in_pages),
    Requirement("Keys", "past poses come in pages of at most 50", poses_come_in_pages),
    Requirement("Keys", "parameters are plain numbers, else Malformed", parameters_must_be_numbers),
    Requirement("Keys", "steps and verbs that are not known are Malformed", unknown_keys_are_malformed),
    Requirement("Keys", "a verb on another verb's key is Malformed", a_verb_counts_on_its_own_key),
    Requirement("Messages", "fields that are not known are passed over", unknown_fields_are_passed_over),
    Requirement("Messages", "messages that are cut off are Malformed", cut_messages_are_malformed),
    Requirement("Messages", "a missing field is Malformed", missing_fields_are_malformed),
    Requirement("Messages", "wrong types and ranges are Malformed", wrong_types_are_malformed),
    Requirement("Messages", "what is no JSON is Malformed", what_is_no_json_is_malformed),
    Requirement("Messages", "a state is small, whatever the mission", states_are_bounded),
    Requirement("Required zenoh configuration", "a message above 1 MB does no harm", oversize_does_no_harm),
    Requirement("The record of a run", "it reports the runs it has, each once", record_tells_its_runs),
    Requirement("Events", "numbered from 1 without gaps", log_has_no_gaps),
    Requirement("Why something was refused", "a mission that is not there: `no_mission`",
                a_mission_that_is_not_there_is_no_mission),
)  # fmt: skip
