"""The base is commanded to stand before anything is decided, locked, read or written."""

from __future__ import annotations

import errno
import sqlite3
import threading
import time
from collections.abc import Callable

import msgspec
import pytest

from stopgo.bridge.conform.conform_robot import await_robot
from stopgo.bridge.link.protocol import Info, Watching, decode, encode
from stopgo.bridge.link.zenoh_link import connecting, listening
from stopgo.bridge.robot.agent import Agent, on_link
from stopgo.bridge.robot.lock_waits import LockWaits
from stopgo.bridge.robot.simulated_faults import Fault, Faults
from stopgo.bridge.robot.storage_watchdog import ANSWERS_WITHIN_S, LATE, LOOK_EVERY_S, StorageWatchdog
from stopgo.bridge.robot.work_control import WorkControl
from stopgo.bridge.station.station import Station
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.run.run_commands import FREE_VERBS, Answer, RunCommand, Verb
from stopgo.mission.run.states import Run
from tests.bridge.world import Field, corridor
from tests.ports import free_port

NET_S = 60.0
"""Longest wait of a test that has failed."""


def with_policy(policy: str) -> Mission:
    mission = corridor()
    return with_digest(
        msgspec.structs.replace(mission, policy=msgspec.structs.replace(mission.policy, link_loss=policy))
    )


def started(policy: str = "continue", *faults: Fault) -> Field:
    field = Field(faults=Faults(faults))
    field.station().push(with_policy(policy))
    field.order("start")
    return field


def until(reached: Callable[[Run], bool]) -> Callable[[Field], None]:
    return lambda field: field.work_until(reached)


def _homing(field: Field) -> None:
    field.work_until(lambda run: run.done == ("s1",))
    field.order("home")


def _ended(field: Field) -> None:
    field.order("abort")


STATES: dict[str, Callable[[Field], object]] = {
    "WAITING": lambda field: None,
    "NAVIGATING": until(lambda run: run.stop_state == "NAVIGATING"),
    "SETTLING": until(lambda run: run.stop_state == "SETTLING"),
    "SCANNING": until(lambda run: run.stop_state == "SCANNING"),
    "VERIFYING": until(lambda run: run.stop_state == "VERIFYING"),
    "HOMING": _homing,
    "PAUSED": lambda field: field.order("pause"),
    "HELD": lambda field: field.controller.hold("for a test"),
    "ABORTED": _ended,
}
RUNNING = ("WAITING", "NAVIGATING", "SETTLING", "SCANNING", "VERIFYING")


def calls_of(field: Field, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Order of the base's stops and of all access to the journal."""
    calls: list[str] = []
    rows, stop, read, select = field.journal.rows, field.base.stop, field.journal.rows.read, None
    select = rows.select

    def noted(name: str, call: Callable[..., object]) -> Callable[..., object]:
        return lambda *arguments: (calls.append(name), call(*arguments))[1]

    monkeypatch.setattr(field.base, "stop", noted("stop", stop))
    monkeypatch.setattr(rows, "read", noted("journal", read))
    monkeypatch.setattr(rows, "select", noted("journal", select))
    monkeypatch.setattr(rows, "commit_hook", noted("journal", lambda moment: None))
    return calls


@pytest.mark.parametrize("verb", FREE_VERBS)
@pytest.mark.parametrize("state", STATES)
def test_a_stop_reaches_the_base_before_the_journal(
    state: str, verb: Verb, monkeypatch: pytest.MonkeyPatch
) -> None:
    field = started()
    STATES[state](field)
    calls = calls_of(field, monkeypatch)
    field.order(verb)
    assert (calls[0], "journal" in calls) == ("stop", True)


@pytest.mark.parametrize("verb", FREE_VERBS)
def test_a_robot_without_a_mission_is_stopped_too(verb: Verb, monkeypatch: pytest.MonkeyPatch) -> None:
    field = Field()
    calls = calls_of(field, monkeypatch)
    assert field.order(verb).reason == "no_mission"
    assert calls[0] == "stop"


@pytest.mark.parametrize(
    ("named", "told"),
    [
        ({"run_id": "elsewhere"}, "the robot's run is"),
        ({"mission_id": "another"}, "the robot's mission is"),
        ({"revision": 7}, "the robot holds revision 1, not 7"),
        ({"expect_state": ("PAUSED",)}, "the robot is RUNNING, not PAUSED"),
        ({"boot_id": "another", "fence": 0, "issued_ns": 0}, ""),
    ],
)
@pytest.mark.parametrize(("verb", "state"), [("pause", "PAUSED"), ("abort", "ABORTED")])
def test_a_stop_counts_whatever_it_names(verb: Verb, state: str, named: dict[str, object], told: str) -> None:
    field = started()
    answer = field.order(verb, **named)
    assert (answer.outcome, answer.state, field.controller.run.state) == ("ok", state, state)
    assert told in answer.message
    assert bool(told) == bool(answer.message)


def test_a_refused_stop_reports_what_did_not_match_too() -> None:
    field = Field()
    field.station().push(corridor())
    answer = field.order("pause", run_id="elsewhere")
    assert answer.reason == "wrong_state"
    assert "the robot's run is None, not elsewhere" in answer.message


def test_nothing_drives_while_a_stop_is_decided(monkeypatch: pytest.MonkeyPatch) -> None:
    field, worked = started(), list[bool]()
    monkeypatch.setattr(field.base, "stop", lambda: worked.append(field.controller.step()))
    field.order("pause")
    assert worked == [False]
    assert field.controller.run.stop_state == "WAITING"


def test_a_stop_that_changes_nothing_lets_a_scan_end(monkeypatch: pytest.MonkeyPatch) -> None:
    field = started()
    field.clock.at(30.0, lambda: [field.order("pause"), field.order("pause")])
    field.work()
    assert (field.controller.run.state, field.controller.run.done) == ("PAUSED", ("s1",))


def test_a_stop_that_comes_again_does_not_stop_a_resumed_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    field = started()
    pause = field.command("pause")
    first = field.controller.execute(pause)
    field.order("resume")
    stops: list[str] = []
    monkeypatch.setattr(field.base, "stop", lambda: stops.append("stop"))
    assert field.controller.execute(pause) == first
    assert (stops, field.controller.run.state) == ([], "RUNNING")


class SlowDisk:
    """A commit that waits until the test lets it go on."""

    def __init__(self) -> None:
        self.entered, self.goes_on = threading.Event(), threading.Event()

    def __call__(self, moment: str) -> None:
        self.entered.set()
        assert self.goes_on.wait(NET_S)


@pytest.mark.parametrize(("verb", "state"), [("pause", "PAUSED"), ("abort", "ABORTED")])
def test_a_stop_waits_for_no_write_of_anybody(
    verb: Verb, state: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another command is being stored, so the lock is taken, and the disk does not answer."""
    field, disk, stopped = started(), SlowDisk(), threading.Event()
    stop = field.base.stop
    monkeypatch.setattr(field.base, "stop", lambda: (stop(), stopped.set()))
    monkeypatch.setattr(field.journal.rows, "commit_hook", disk)
    skip = threading.Thread(target=field.order, args=("skip",))
    skip.start()
    assert disk.entered.wait(NET_S)
    stopping = threading.Thread(target=field.order, args=(verb,))
    stopping.start()
    assert stopped.wait(NET_S)
    assert not disk.goes_on.is_set()
    disk.goes_on.set()
    skip.join(NET_S)
    stopping.join(NET_S)
    assert field.controller.run.state == state


def test_on_the_link_a_stop_waits_behind_no_other_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """zenoh answers the questions on one declared key one after another."""
    field, disk, stopped = started(), SlowDisk(), threading.Event()
    endpoint, skip, abort = f"tcp/127.0.0.1:{free_port()}", field.command("skip"), field.command("abort")
    answers: list[bytes | None] = []
    with listening(endpoint) as link, connecting(endpoint) as station:
        Agent(
            keys=field.keys, link=link, journal=field.journal, runner=field.controller, clock=field.clock,
            command_clock=field.clock,
        ).serve()  # fmt: skip
        link.announce(field.keys.alive)
        await_robot(station, field.keys, NET_S)
        monkeypatch.setattr(field.base, "stop", stopped.set)
        monkeypatch.setattr(field.journal.rows, "commit_hook", disk)

        def ask(order: RunCommand) -> None:
            answers.append(station.ask(field.keys.command(order.verb), encode(order), timeout_s=NET_S))

        asking = [threading.Thread(target=ask, args=(order,)) for order in (skip, abort)]
        asking[0].start()
        assert disk.entered.wait(NET_S)
        asking[1].start()
        assert stopped.wait(NET_S)
        disk.goes_on.set()
        for thread in asking:
            thread.join(NET_S)
    assert [decode(answer or b"", Answer).outcome for answer in answers] == ["ok", "ok"]
    assert field.controller.run.state == "ABORTED"


@pytest.mark.parametrize("verb", FREE_VERBS)
def test_a_stop_gets_one_answer(verb: Verb) -> None:
    field = started()
    field.serve()
    order = field.command(verb)
    assert len(field.board.link().ask_all(field.keys.command(verb), encode(order), timeout_s=0.1)) == 1


def test_a_driving_thread_stands_until_the_stop_is_stored(monkeypatch: pytest.MonkeyPatch) -> None:
    field, disk = started(), SlowDisk()
    drives, ended = threading.Event(), threading.Event()
    outcomes: list[str] = []

    def goto(path: object, *, heading: object, limits: object, interrupt: threading.Event) -> str:
        outcomes.append("goto")
        drives.set()
        assert interrupt.wait(NET_S)
        ended.set()
        return "interrupted"

    monkeypatch.setattr(field.base, "goto", goto)
    serving = threading.Thread(target=field.controller.serve)
    serving.start()
    assert drives.wait(NET_S)
    monkeypatch.setattr(field.journal.rows, "commit_hook", disk)
    pausing = threading.Thread(target=field.order, args=("pause",))
    pausing.start()
    assert ended.wait(NET_S)
    disk.goes_on.set()
    pausing.join(NET_S)
    field.controller.close()
    serving.join(NET_S)
    assert (outcomes, field.controller.run.state) == (["goto"], "PAUSED")


@pytest.mark.parametrize("policy", ["hold", "home"])
def test_a_lost_link_stops_the_base_before_the_journal(policy: str, monkeypatch: pytest.MonkeyPatch) -> None:
    field = started(policy)
    calls = calls_of(field, monkeypatch)
    field.controller.on_link_silence(31.0)
    assert (calls[0], "journal" in calls) == ("stop", True)


def test_a_twin_stops_the_base_before_the_journal(monkeypatch: pytest.MonkeyPatch) -> None:
    field = started()
    calls = calls_of(field, monkeypatch)
    field.controller.hold("another robot answers")
    assert (calls[0], "journal" in calls) == ("stop", True)


def test_an_internal_error_stops_the_base_and_ends_the_controller(monkeypatch: pytest.MonkeyPatch) -> None:
    field, stops = started(), list[str]()

    def broken() -> float:
        raise ZeroDivisionError

    monkeypatch.setattr(field.base, "battery", broken)
    monkeypatch.setattr(field.base, "stop", lambda: stops.append("stop"))
    with pytest.raises(ZeroDivisionError):
        field.order("skip")
    assert stops == ["stop"]
    assert not field.controller.step()
    with pytest.raises(ZeroDivisionError):
        field.controller.serve()


def test_a_thread_that_dies_stops_the_base_before_anybody_is_informed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    field, calls = Field(), list[str]()

    def broken() -> None:
        raise OSError("no such line")

    field.controller.works = (broken,)
    monkeypatch.setattr(field.base, "stop", lambda: calls.append("stop"))
    agent = Agent(
        keys=field.keys, link=field.board.link(), journal=field.journal, runner=field.controller,
        clock=field.clock, command_clock=field.clock, failed=lambda error: calls.append("told"),
    )  # fmt: skip
    with on_link(agent), pytest.raises(OSError, match="no such line"):
        agent.wait()
    assert calls[:2] == ["stop", "told"]


# A base that does not stop


def broken_stop() -> None:
    raise OSError("no such line")


@pytest.mark.parametrize(("verb", "state"), [("pause", "PAUSED"), ("abort", "ABORTED")])
def test_a_base_that_does_not_stop_is_reported_stored_and_never_driven_again(
    verb: Verb, state: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    field = started()
    monkeypatch.setattr(field.base, "stop", broken_stop)
    order = field.command(verb)
    answer = field.controller.execute(order)
    assert (answer.outcome, answer.reason, answer.state) == ("refused", "not_stopped", state)
    assert "(no such line): use the emergency stop" in answer.message
    assert field.controller.execute(order) == answer
    assert not field.controller.step()
    with pytest.raises(OSError, match="no such line"):
        field.controller.serve()
    monkeypatch.undo()
    field.boot()
    assert (field.controller.run.state, field.controller.execute(order)) == (state, answer)


@pytest.mark.parametrize(
    "stops",
    [
        lambda field: field.controller.on_link_silence(31.0),
        lambda field: field.controller.hold("another robot answers"),
    ],
)
def test_a_base_that_does_not_stop_ends_the_program_for_every_stop(
    stops: Callable[[Field], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    field = started("hold")
    monkeypatch.setattr(field.base, "stop", broken_stop)
    stops(field)
    assert field.controller.run.state == "HELD"
    with pytest.raises(OSError, match="no such line"):
        field.controller.serve()


def test_an_error_is_reported_though_the_base_does_not_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot whose thread has died must not look alive."""
    field, told = Field(), list[Exception]()

    def broken() -> None:
        raise ZeroDivisionError

    field.controller.works = (broken,)
    monkeypatch.setattr(field.base, "stop", broken_stop)
    agent = Agent(
        keys=field.keys, link=field.board.link(), journal=field.journal, runner=field.controller,
        clock=field.clock, command_clock=field.clock, failed=told.append,
    )  # fmt: skip
    with on_link(agent), pytest.raises(ZeroDivisionError):
        agent.wait()
    assert len(told) == 1


def test_a_base_that_does_not_stop_at_the_start_ends_the_program_unless_it_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    field = Field()
    monkeypatch.setattr(field.base, "stop", broken_stop)
    with pytest.raises(OSError, match="no such line"):
        field.boot()
    monkeypatch.setattr(field.base, "not_ready", lambda: "its motors do not answer")
    field.boot()
    field.station().push(corridor())
    assert field.order("start").reason == "not_ready"


# A journal that fails

FAILURES: dict[str, Callable[[], Exception]] = {
    "I/O error": lambda: sqlite3.OperationalError("disk I/O error"),
    "malformed": lambda: sqlite3.DatabaseError("database disk image is malformed"),
    "EIO": lambda: OSError(errno.EIO, "Input/output error"),
    "no space": lambda: sqlite3.OperationalError("database or disk is full"),
    "ENOSPC": lambda: OSError(errno.ENOSPC, "No space left on device"),
    "remounted read-only": lambda: sqlite3.OperationalError("attempt to write a readonly database"),
    "EROFS": lambda: OSError(errno.EROFS, "Read-only file system"),
}


def break_disk(
    field: Field, monkeypatch: pytest.MonkeyPatch, failure: str = "I/O error", *, reads: bool = False
) -> None:
    def fails(*arguments: object) -> None:
        raise FAILURES[failure]()

    monkeypatch.setattr(field.journal.rows, "commit_hook", fails)
    if reads:
        monkeypatch.setattr(field.journal.rows, "read", fails)
        monkeypatch.setattr(field.journal.rows, "select", fails)


@pytest.mark.parametrize("failure", FAILURES)
@pytest.mark.parametrize("policy", ["hold", "home"])
@pytest.mark.parametrize("state", ["WAITING", "NAVIGATING", "SETTLING"])
def test_a_link_lost_on_a_broken_disk_holds_the_robot(
    state: str, policy: str, failure: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    field = started(policy)
    STATES[state](field)
    break_disk(field, monkeypatch, failure)
    field.controller.on_link_silence(31.0)
    field.controller.on_link_silence(32.0)
    assert field.controller.run.state == "HELD"
    assert field.controller.run.reason.startswith("the journal cannot be written: ")
    assert field.work() == 0


@pytest.mark.parametrize("failure", FAILURES)
@pytest.mark.parametrize("state", [*RUNNING, "HOMING"])
def test_work_on_a_broken_disk_holds_the_robot(
    state: str, failure: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    field = started("hold")
    STATES[state](field)
    break_disk(field, monkeypatch, failure)
    while field.controller._step_if_storable():
        pass
    assert (field.controller.run.state, field.base.speed()) == ("HELD", 0.0)


READS_AND_WRITES = [(failure, False) for failure in FAILURES] + [
    (failure, True) for failure, made in FAILURES.items() if isinstance(made(), sqlite3.Error)
]
"""Failures of writes, and of reads too, which are SQLite's alone."""


@pytest.mark.parametrize(("failure", "reads"), READS_AND_WRITES)
@pytest.mark.parametrize("state", [state for state in STATES if state != "ABORTED"])
def test_a_robot_whose_disk_is_broken_obeys_stops_alone(
    state: str, reads: bool, failure: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    field = started("hold")
    STATES[state](field)
    station = field.station(commander="test")
    break_disk(field, monkeypatch, failure, reads=reads)
    for verb in ("resume", "retry", "skip", "home", "start"):
        answer = field.order(verb)
        assert answer.outcome == "refused"
    assert field.work() == 0 or state in ("SCANNING", "VERIFYING")
    assert station.status().state == field.controller.run.state
    assert field.order("pause").reason in (None, "wrong_state")
    assert field.order("abort").outcome == "ok"
    assert station.status().state == "ABORTED"


def test_a_push_on_a_broken_disk_holds_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    field = started("hold")
    field.station(commander="test").push(with_policy("hold"))
    break_disk(field, monkeypatch)
    manifest = field.journal.missions.newest_manifest(corridor().id)
    assert manifest is not None
    rejected = field.controller.take(field.commit(manifest), with_policy("hold"))
    assert rejected is not None
    assert (rejected.reason, field.controller.run.state) == ("storage", "HELD")


def test_a_lease_is_not_renewed_on_a_broken_disk_and_the_watch_is_answered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    field = started("hold")
    field.serve()
    field.clock.jump(45.0)
    break_disk(field, monkeypatch, reads=True)
    raw = field.board.link().ask(field.keys.keep, encode(Watching(commander="test")), timeout_s=0.3)
    assert raw is not None
    assert decode(raw, Info).state.state == "RUNNING"


def test_what_waits_for_a_broken_disk_does_not_grow(monkeypatch: pytest.MonkeyPatch) -> None:
    field = started("hold")
    with monkeypatch.context() as broken:
        break_disk(field, broken)
        for _ in range(50):
            field.order("skip")
            field.controller.on_link_silence(31.0)
    field.controller.on_link_silence(0.0)
    assert field.told() == ["Started", "Held"]


# The watchdog


class Bare:
    """A base that notes its stops."""

    def __init__(self) -> None:
        self.stops = 0

    def stop(self) -> None:
        self.stops += 1


class Watched:
    """A watchdog over a bare base, in time of its own."""

    def __init__(self) -> None:
        self.base, self.now_ns, self.calls = Bare(), 0, list[str]()
        self.control = WorkControl(self.base)  # type: ignore[arg-type]
        self.waits = LockWaits(lambda: self.now_ns)
        self.dog = StorageWatchdog(self.control, self.waits, self._hold, self.calls.append)

    def _hold(self, reason: str) -> None:
        assert not self.control.clear_for_work()
        self.calls.append(f"hold: {reason}")

    def look_for(self, seconds: float) -> None:
        """Look as often as its thread does in that time."""
        for _ in range(round(seconds / LOOK_EVERY_S)):
            self.now_ns += round(LOOK_EVERY_S * 1e9)
            self.dog.look()


def test_a_robot_whose_journal_does_not_answer_stands_and_is_then_held() -> None:
    watched = Watched()
    watched.control.driving = True
    section = watched.waits.begin()
    watched.look_for(ANSWERS_WITHIN_S)
    assert (watched.base.stops, watched.dog.late) == (0, False)
    watched.look_for(0.1)
    watched.control.driving = False
    watched.look_for(5.0)
    assert (watched.base.stops, watched.control.interrupt.is_set(), watched.dog.late) == (1, True, True)
    assert not watched.control.clear_for_work()
    watched.waits.end(section)
    watched.look_for(0.1)
    assert watched.control.clear_for_work() and not watched.dog.late
    assert watched.calls == [
        f"{LATE}: the robot stands", "the journal answers again: the robot is held until a command comes",
        f"hold: {LATE}",
    ]  # fmt: skip


def test_a_robot_whose_program_was_frozen_drives_on() -> None:
    """The section is old, but no look saw it: the disk did not delay it."""
    watched = Watched()
    watched.control.driving = True
    section = watched.waits.begin()
    watched.look_for(LOOK_EVERY_S)
    watched.now_ns += 10**10
    watched.look_for(LOOK_EVERY_S)
    assert watched.base.stops == 1
    watched.waits.end(section)
    watched.look_for(LOOK_EVERY_S)
    assert watched.control.clear_for_work()
    assert watched.calls[1:] == ["the journal answers again: the robot continues"]


@pytest.mark.parametrize("verb", [None, "abort"])
def test_a_run_waits_for_a_command_after_a_slow_disk(
    verb: Verb | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With its watchdog, on a disk that takes its time for a skip while the robot drives."""
    field, disk = started(), SlowDisk()
    drives, interrupted = threading.Event(), threading.Event()

    def goto(path: object, *, heading: object, limits: object, interrupt: threading.Event) -> str:
        drives.set()
        assert interrupt.wait(NET_S)
        interrupted.set()
        return "interrupted"

    monkeypatch.setattr(field.base, "goto", goto)
    threads = [threading.Thread(target=work) for work in field.controller.works]
    for thread in threads:
        thread.start()
    assert drives.wait(NET_S)
    station = field.station(timeout_s=NET_S)
    monkeypatch.setattr(field.journal.rows, "commit_hook", disk)
    orders = [threading.Thread(target=field.journal.store_nonce, args=("n", "d"))]
    orders[0].start()
    assert interrupted.wait(NET_S)
    await_state(station, "HELD")
    if verb is not None:
        orders.append(threading.Thread(target=field.order, args=(verb,)))
        orders[1].start()
    disk.goes_on.set()
    for thread in orders:
        thread.join(NET_S)
    await_state(station, "ABORTED" if verb == "abort" else "HELD", field)
    field.controller.close()
    for thread in threads:
        thread.join(NET_S)
    assert verb is not None or field.controller.run.reason == LATE


def await_state(station: Station, state: str, field: Field | None = None) -> None:
    """Wait until the robot reports the state, and its run has it if `field` is given."""
    deadline = time.monotonic() + NET_S
    while station.status().state != state or (field is not None and field.controller.run.state != state):
        assert time.monotonic() < deadline, station.status()


def test_a_stop_that_is_being_stored_is_not_held_too() -> None:
    watched = Watched()
    watched.control.driving = True
    watched.waits.begin()
    with watched.control.standing():
        watched.look_for(5.0)
    assert (watched.base.stops, watched.calls) == (1, [])


def test_a_long_drive_and_a_robot_that_stands_do_not_trip_the_watchdog() -> None:
    watched = Watched()
    watched.control.driving = True
    watched.now_ns = 10**13
    watched.dog.look()
    watched.control.driving = False
    watched.waits.begin()
    watched.look_for(10.0)
    assert (watched.base.stops, watched.calls) == (0, [])


def test_drives_and_scans_hold_no_lock() -> None:
    field, ages = started(), list[float]()
    for at_s in (2.0, 30.0, 60.0):
        field.clock.at(at_s, lambda: ages.append(field.journal.rows.waits.longest_s()))
    field.work()
    assert ages == [0.0, 0.0, 0.0]


def test_the_watchdog_sees_a_write_that_does_not_end(monkeypatch: pytest.MonkeyPatch) -> None:
    field, disk = started(), SlowDisk()
    monkeypatch.setattr(field.journal.rows, "commit_hook", disk)
    skip = threading.Thread(target=field.order, args=("skip",))
    skip.start()
    assert disk.entered.wait(NET_S)
    assert field.journal.rows.waits.longest_s() > 0.0
    disk.goes_on.set()
    skip.join(NET_S)
    assert field.journal.rows.waits.longest_s() == 0.0
