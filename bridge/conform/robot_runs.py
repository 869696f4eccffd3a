"""Requirements on a run: the robot drives in each, half a metre ahead of its position and back."""

from __future__ import annotations

import msgspec

from stopgo.bridge.conform.command_requirements import as_another, ready, refuses_what_means_nothing
from stopgo.bridge.conform.requirements import NotTried, Requirement, must
from stopgo.bridge.conform.robot_bench import OVER, RobotBench
from stopgo.bridge.conform.robot_queries import describe, must_reject, read, read_event
from stopgo.bridge.conform.robot_questions import keeps_a_record, states_are_bounded
from stopgo.bridge.link.capabilities import RECORD
from stopgo.bridge.link.protocol import POSE_PAGE, RECORD_PAGE, Accepted, PosePage, RecordEntry, RecordPage
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.run.events import (
    AnyEvent,
    Arrived,
    Finished,
    Scanned,
    Settled,
    Skipped,
    Started,
    StateReport,
)
from stopgo.mission.run.run_commands import LONGEST_VALID_S, Answer, Verb

RUN_S = 180.0
"""Longest time of a run of the trial mission."""
MANY_STOPS, MANY_SKIPPED = 110, 105
"""More stops than a state lists, and more events than a page has."""
RECORD_S = 10.0
"""Longest time until the telemetry log has the end of a run."""
NEAR_M = 0.1


def _started(bench: RobotBench) -> tuple[Mission, Answer]:
    mission = ready(bench)
    return mission, bench.commands.must_execute("start")


def _arrived(bench: RobotBench, since: int) -> None:
    """Wait until the robot has arrived at a stop."""

    def arrived() -> bool | None:
        return any(isinstance(event, Arrived) for event in bench.log(since)) or None

    bench.wait(arrived, RUN_S, "the robot did not arrive at the first stop")


def a_run_goes_to_its_end(bench: RobotBench) -> None:
    newest = bench.info().state.last_event
    bench.published.events.clear()
    mission, answer = _started(bench)
    state = bench.wait_for_state(*OVER, within_s=RUN_S)
    must(state.state == "FINISHED", f"the run ended {state.state}")
    must(state.run_id == answer.run_id, "the answer to start and the state report different runs")
    stops = tuple(stop.id for stop in mission.stops)
    must(state.done == stops, f"`done` is {state.done}, not {stops}")
    events = [event for event in bench.log(newest) if event.run_id == answer.run_id]
    _tells_every_step(events, stops)
    _told_once_in_order(bench, events)


def _tells_every_step(events: list[AnyEvent], stops: tuple[str, ...]) -> None:
    must(events and isinstance(events[0], Started), "a run's first event is not Started")
    must(isinstance(events[-1], Finished), "a finished run's last event is not Finished")
    for stop in stops:
        kinds = [type(event) for event in events if getattr(event, "stop", None) == stop]
        must(kinds == [Arrived, Settled, Scanned], f"stop {stop} reports {[kind.__name__ for kind in kinds]}")
    files = {event.file for event in events if isinstance(event, Scanned)}
    must(len(files) == len(stops), "two stops' scans have one file")


def _told_once_in_order(bench: RobotBench, events: list[AnyEvent]) -> None:
    wanted = [event.number for event in events]

    def all_heard() -> list[int] | None:
        numbers = [read_event(raw).number for raw in bench.published.events]
        mine = [number for number in numbers if number >= wanted[0]]
        return mine if mine and mine[-1] >= wanted[-1] else None

    heard = bench.wait(all_heard, 5.0, "tel/event did not report the run's last event")
    must(heard == wanted, f"tel/event reported {heard}, and the log has {wanted}")


def poses_have_no_gaps(bench: RobotBench) -> None:
    """Check the poses of the last run, or of a new one."""
    state = bench.info().state
    if state.state != "FINISHED":
        _started(bench)
        state = bench.wait_for_state(*OVER, within_s=RUN_S)
    seqs, since = [], 0
    while True:
        page = bench.ask_for(PosePage, bench.keys.poses, since=str(since), run=str(state.run_id))
        seqs += [pose.seq for pose in page.poses]
        if len(page.poses) < POSE_PAGE:
            break
        must(seqs[-1] > since, "a page of poses does not go on behind `since`")
        since = seqs[-1]
    must(seqs, "no poses of the run are stored")
    missing = set(range(seqs[0], seqs[-1] + 1)) - set(seqs)
    must(not missing, f"{len(missing)} poses of the run are missing in the stored ones")


def a_start_is_carried_out_once(bench: RobotBench) -> None:
    newest = bench.info().state.last_event
    ready(bench)
    order = bench.commands.order("start")
    first, again = bench.commands.give(order), bench.commands.give(order)
    must(first.outcome == "ok", f"start was refused: {first.reason}")
    must(first == again, "the same start again got another answer")
    bench.commands.must_refuse(bench.commands.order("start"), "wrong_state")
    started = [event for event in bench.log(newest) if isinstance(event, Started)]
    must(len(started) == 1, f"one start was reported as {len(started)} Started")
    bench.end_run()
    after = bench.commands.give(order)
    must(after == first, "the same start after the run's end got another answer")
    must(bench.info().state.state in OVER, "the same start after the run's end drove again")


def orders_mean_what_the_table_says(bench: RobotBench) -> None:
    newest = bench.info().state.last_event
    _started(bench)
    refuses_what_means_nothing(bench, "RUNNING")
    bench.commands.must_execute("pause")
    bench.wait_for_state("PAUSED")
    refuses_what_means_nothing(bench, "PAUSED")
    bench.commands.must_execute("resume")
    bench.wait_for_state("RUNNING")
    _arrived(bench, newest)
    bench.commands.must_execute("pause")
    bench.wait_for_state("PAUSED")
    bench.commands.must_execute("home")
    answer = bench.commands.give(bench.commands.order("pause"))
    if answer.outcome == "refused" and bench.info().state.state in OVER:
        raise NotTried("the path home ended before it could be paused; all before it passed")
    must(answer.outcome == "ok", f"pause on the path home was refused: {answer.reason}")
    refuses_what_means_nothing(bench, "PAUSED homing")
    bench.commands.must_execute("resume")
    bench.wait_for_state("HOMING", *OVER)
    bench.wait_for_state("ABORTED", within_s=RUN_S)
    refuses_what_means_nothing(bench, "ABORTED")
    bench.commands.must_refuse(bench.commands.order("start"), "finished_before")


def an_abort_ends_a_run(bench: RobotBench) -> None:
    _started(bench)
    answer = bench.commands.must_execute("abort", issued_ns=0, boot_id=None, valid_for_s=LONGEST_VALID_S)
    must(answer.state == "ABORTED", f"an abort was answered with state {answer.state}")
    bench.wait_for_state("ABORTED")


def a_stop_counts_always(bench: RobotBench) -> None:
    _started(bench)
    stops: tuple[tuple[Verb, str], ...] = (("pause", "PAUSED"), ("abort", "ABORTED"))
    for verb, state in stops:
        answer = bench.commands.must_execute(
            verb, run_id="another-run", mission_id="another", revision=10**6, expect_state=("HELD",)
        )
        must(answer.message, f"{verb} for another run was answered without a message")
        bench.wait_for_state(state)


def anybody_may_pause(bench: RobotBench) -> None:
    _started(bench)
    with as_another(bench):
        bench.commands.must_execute("pause")
        bench.wait_for_state("PAUSED")
        bench.commands.must_refuse(bench.commands.order("resume"), "not_the_commander")
    must(bench.info().state.state == "PAUSED", "another's resume was carried out though it was refused")


def a_late_start_does_not_drive(bench: RobotBench) -> None:
    ready(bench)
    info = bench.info()
    assert info.lease is not None
    for reason, details in (
        ("expired", {"issued_ns": info.clock_ns - 10 * 10**9, "valid_for_s": 5.0}),
        ("expired", {"boot_id": "another-boot"}),
        ("fenced", {"fence": info.lease.fence - 1}),
        ("wrong_state", {"expect_state": ("PAUSED",)}),
        ("wrong_mission", {"revision": 10**6}),
    ):
        bench.commands.must_refuse(bench.commands.order("start", **details), reason)
        must(bench.info().state.state == "READY", f"a start that was refused as {reason} drove")


def a_start_from_elsewhere_is_refused(bench: RobotBench) -> None:
    mission = bench.missions.mission()
    far = msgspec.structs.replace(mission.start, x=mission.start.x + 5.0)
    first = mission.stops[0]
    moved = msgspec.structs.replace(first, approach=((far.x, far.y), (first.x, first.y)))
    bench.missions.store(
        with_digest(
            msgspec.structs.replace(mission, start=far, stops=(moved, *mission.stops[1:]), return_=None)
        )
    )
    bench.commands.must_refuse(bench.commands.order("start"), "not_at_start")


def a_long_run_is_told_in_little(bench: RobotBench) -> None:
    newest = bench.info().state.last_event
    bench.missions.store(bench.missions.mission(stops=MANY_STOPS, reach_m=NEAR_M))
    bench.wait_for_state("READY")
    bench.commands.must_execute("start")
    bench.commands.must_execute("pause")
    bench.wait_for_state("PAUSED")
    for _ in range(MANY_SKIPPED):
        bench.commands.must_execute("skip")
    state = bench.info().state
    must(state.skipped_count == MANY_SKIPPED, f"skipped_count is {state.skipped_count}, not {MANY_SKIPPED}")
    states_are_bounded(bench)
    events = bench.log(newest)
    numbers = [event.number for event in events]
    must(numbers == list(range(newest + 1, newest + 1 + len(numbers))), "the log of the run has gaps")
    told = sum(isinstance(event, Skipped) for event in events)
    must(told == MANY_SKIPPED, f"{MANY_SKIPPED} skips were reported as {told} Skipped")


def a_revision_waits_for_the_next_stop(bench: RobotBench) -> None:
    mission, _ = _started(bench)
    bench.commands.must_execute("pause")
    bench.wait_for_state("PAUSED")
    later = _next(bench, mission, stops=mission.stops[:-1], return_=None)
    reply = bench.missions.push(later)
    if not isinstance(reply, Accepted) and getattr(reply, "reason", "") == "running":
        raise NotTried("the robot takes no revision during a run")
    must(isinstance(reply, Accepted) and reply.waits, f"a revision during a run: {describe(reply)}")
    state: StateReport = bench.info().state
    must(state.next_revision == later.revision, f"next_revision is {state.next_revision}")


def a_path_that_differs_is_refused(bench: RobotBench) -> None:
    mission, _ = _started(bench)
    bench.commands.must_execute("pause")
    bench.wait_for_state("PAUSED")
    first = mission.stops[0]
    renamed = msgspec.structs.replace(first, id=f"{first.id}-other")
    reply = bench.missions.push(_next(bench, mission, stops=(renamed, *mission.stops[1:])))
    must_reject(reply, "way_differs", "running")


def another_mission_is_refused_during_a_run(bench: RobotBench) -> None:
    mission, _ = _started(bench)
    other = with_digest(msgspec.structs.replace(mission, id=f"{mission.id}-other"))
    must_reject(bench.missions.push(other), "running")


def _next(bench: RobotBench, mission: Mission, **changes: object) -> Mission:
    revision = bench.missions.mission().revision
    return with_digest(msgspec.structs.replace(mission, revision=revision, **changes))


def the_record_has_no_gaps(bench: RobotBench) -> None:
    """The link verifies the signature of every page, as of every answer."""
    if not keeps_a_record(bench):
        raise NotTried(f"the robot does not name the capability `{RECORD}`")
    _, answer = _started(bench)
    run_id = answer.run_id or ""
    bench.wait_for_state(*OVER, within_s=RUN_S)
    entries = bench.wait(lambda: _record(bench, run_id), RECORD_S, f"the record has no end of run {run_id}")
    seqs = [pose.seq for entry in entries for pose in entry.poses]
    must(seqs, "the record has no pose")
    must(seqs == list(range(seqs[0], seqs[-1] + 1)), "poses are missing from the record, or are there twice")
    times = [pose.robot_ns for entry in entries for pose in entry.poses]
    must(times == sorted(times), "the times of the record's poses go back")
    middle = len(entries) // 2
    page = bench.ask_for(RecordPage, bench.keys.record, run=run_id, since=str(middle))
    again = list(page.entries)
    must(again == entries[middle:][: len(again)], "an entry is another when it is read again")
    late = bench.ask_for(RecordPage, bench.keys.record, run=run_id, time=str(times[-1] - 1))
    later = [pose.robot_ns for entry in late.entries[:1] for pose in entry.poses]
    must(later and later[-1] >= times[-1], "`time` has no effect")


def _record(bench: RobotBench, run_id: str) -> list[RecordEntry] | None:
    """Read all entries; `None` until the last one shows the end of the run."""
    entries: list[RecordEntry] = []
    newest = 1
    while len(entries) < newest:
        since = entries[-1].number if entries else 0
        page = bench.ask_for(RecordPage, bench.keys.record, run=run_id, since=str(since))
        must(
            page.run_id == run_id and page.since == since,
            "a page is of another run or number than requested",
        )
        must(
            len(page.entries) <= RECORD_PAGE, f"a page has {len(page.entries)} entries; at most {RECORD_PAGE}"
        )
        numbers = [entry.number for entry in page.entries]
        must(
            numbers == list(range(since + 1, since + 1 + len(numbers))), f"the entries are numbered {numbers}"
        )
        must(not page.missing, "the robot has written nothing of the run's end")
        if not page.entries:
            return None
        entries += page.entries
        newest = page.newest
    over = any(state.state in OVER for entry in entries for state in entry.states)
    return entries if over else None


def poses_tell_run_and_boot(bench: RobotBench) -> None:
    _, answer = _started(bench)
    bench.pose()
    told = read(bench.published.poses[-1], dict, "a pose")
    must(told.get("boot_id") == bench.info().boot_id, "a pose reports another boot than info")
    must(told.get("run_id") == answer.run_id, "a pose reports another run than the answer to start")


RUNS: tuple[Requirement[RobotBench], ...] = tuple(
    Requirement(section, text, test, drives=True)
    for section, text, test in (
        ("Commands", "a start late, fenced or meant otherwise does not drive", a_late_start_does_not_drive),
        ("Commands", "a start away from the mission's: `not_at_start`", a_start_from_elsewhere_is_refused),
        ("States of a run", "a run goes stop by stop to FINISHED", a_run_goes_to_its_end),
        ("Events", "the poses of a run are stored without gaps", poses_have_no_gaps),
        ("Events", "a pose reports run and boot", poses_tell_run_and_boot),
        ("The record of a run", "every entry and pose once, and the same again", the_record_has_no_gaps),
        ("Commands", "a start that comes again is carried out once", a_start_is_carried_out_once),
        ("Commands", "RUNNING to ABORTED: commands as in the table", orders_mean_what_the_table_says),
        ("Commands", "an abort that knows nothing ends a run", an_abort_ends_a_run),
        ("Commands", "a stop counts whatever run, mission or state it names", a_stop_counts_always),
        ("Commands", "anybody may pause; only the commander resumes", anybody_may_pause),
        ("Messages", "110 stops are reported in a small state, without gaps", a_long_run_is_told_in_little),
        ("Pushing a mission", "a new revision during a run waits", a_revision_waits_for_the_next_stop),
        ("Pushing a mission", "a revision of the path so far: `way_differs`", a_path_that_differs_is_refused),
        ("Pushing a mission", "another mission in a run: `running`", another_mission_is_refused_during_a_run),
    )
)  # fmt: skip
