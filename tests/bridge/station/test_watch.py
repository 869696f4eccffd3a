"""Display of a run, and the data that a recording receives."""

from __future__ import annotations

import json
import queue
import threading
import time
from contextlib import nullcontext
from pathlib import Path

import pytest

from stopgo.bridge.commands import watch_commands
from stopgo.bridge.console import print_line, say
from stopgo.bridge.link.clock import WallClock
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.robot import agent as agents
from stopgo.bridge.robot.agent import Agent
from stopgo.bridge.robot.controller import Controller
from stopgo.bridge.robot.inbox import Inbox
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.journal_file import memory_journal
from stopgo.bridge.robot.recorder import RunRecorder
from stopgo.bridge.robot.robot_hardware import pose_of
from stopgo.bridge.robot.simulator import SimulatedBase, SimulatedScanner
from stopgo.bridge.station.finished_run import past_reports
from stopgo.bridge.station.follow import Report, Silence
from stopgo.bridge.station.station import Station
from stopgo.bridge.station.watch import (
    HINT,
    EventLines,
    EventObjects,
    RunTable,
    clock,
    remaining_s,
    table_lines,
    watch_with,
)
from stopgo.command_line import main
from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule
from stopgo.mission.errors import NegativeResult, OutcomeUnknown
from stopgo.mission.run.events import (
    AnyEvent,
    Event,
    Health,
    Held,
    PoseReport,
    PosesMissing,
    ReportsMissing,
    Scanned,
    StateReport,
)
from tests.bridge.world import Field, corridor
from tests.disk import small_disk

pytestmark = pytest.mark.usefixtures("own_time")


def test_the_time_left_at_the_start_is_the_plan() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    left = remaining_s(corridor(), field.report(), (), 0.0)
    assert left == schedule(corridor()).total_s


def test_the_time_left_counts_down_and_ends_at_zero() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    left = []
    while field.controller.step():
        events = field.journal.events()
        left.append(remaining_s(corridor(), field.report(), events, events[-1].mission_time_s))
    assert left == sorted(left, reverse=True)
    assert left[-1] < 0.1


def test_the_time_left_stands_still_while_the_run_does() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    field.order("pause")
    events = field.journal.events()
    now = events[-1].mission_time_s
    left = [remaining_s(corridor(), field.report(), events, now + waited) for waited in (0.0, 100.0, 3600.0)]
    assert left == [schedule(corridor()).total_s] * 3


def test_the_table_names_stop_state_battery_link_and_time() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    for _ in range(3):
        field.controller.step()
    lines = "\n".join(table_lines(corridor(), field.report(), None, field.journal.events(), 4.0))
    for said in (
        "RUNNING  s1 SCANNING",
        "0 done, 0 skipped of 3",
        "100%",
        "no data for 4 s",
        "left as planned",
    ):
        assert said in lines


def test_the_table_is_drawn_in_place() -> None:
    written: list[str] = []
    table = RunTable(written.append)
    field = Field()
    for _ in range(2):
        table.show(field.report())
    height = written[0].count("\n")
    assert written[1].startswith(f"\x1b[{height}A")
    assert written[1].count("\n") == height


def test_lines_report_events_and_silence_but_not_every_pose() -> None:
    said: list[str] = []
    lines = EventLines(said.append)
    field = Field()
    field.station().push(corridor())
    field.order("start")
    field.work()
    for report in (field.report(), *field.journal.events()):
        lines.show(report)
    assert len(said) == len(field.journal.events())


def test_lines_report_a_lost_link_once_and_its_return_once() -> None:
    said: list[str] = []
    lines = EventLines(said.append)
    for seconds in (1.0, 2.0, 3.0, 4.0, 5.0, 29.0):
        lines.show(Silence(seconds=seconds))
    assert said == ["no data for 2 s; retrying"]
    lines.show(Field().report())
    assert said[1:] == ["data again after 29 s", "r1 is IDLE; waiting for a run"]
    lines.show(Silence(seconds=1.0))
    lines.show(Field().report())
    assert len(said) == 3


def held(reason: str) -> Held:
    return Held(
        number=1, robot="r1", boot_id="b", run_id="1", mission_id="m", revision=1, robot_ns=0,
        mission_time_s=0.0, reason=reason,
    )  # fmt: skip


def test_a_held_robot_is_reported_with_what_it_waits_for() -> None:
    said: list[str] = []
    EventLines(said.append).show(held("the way is blocked"))
    assert said[0].endswith("the way is blocked")
    assert said[1].strip() == HINT.strip()
    assert HINT.endswith("held: the robot waits for stopgo skip, stopgo retry, stopgo abort or stopgo home")


def test_every_event_is_an_object() -> None:
    streamed: list[dict[str, object]] = []
    field = Field()
    field.station().push(corridor())
    field.order("start")
    field.work()
    for report in (field.report(), *field.journal.events(), Silence(seconds=3.0)):
        EventObjects(streamed.append).show(report)
    assert [event["number"] for event in streamed] == [event.number for event in field.journal.events()]
    assert streamed[-1]["event"] == "Finished"
    json.dumps(streamed)


def test_a_robot_cannot_colour_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    written: list[str] = []
    table = RunTable(written.append)
    table.show(Field().report())
    table.show(held(RED))
    EventLines(say).show(held(RED))
    print_line(f"one\n{RED}")
    assert RED not in written[-1]
    assert RED not in "".join(capsys.readouterr())


RED = "\x1b[31m"


def test_a_duration_reads_as_a_clock() -> None:
    assert clock(3725.9) == "1:02:05"


def fast_robot(board: Switchboard, journal: Journal, folder: Path) -> tuple[Agent, Controller]:
    """A robot whose time runs 200 times as fast, with records of its runs."""
    wall = WallClock(speed_up=200)
    base, scanner = SimulatedBase(clock=wall), SimulatedScanner(clock=wall)
    controller = Controller(
        robot="r1", journal=journal, base=base, scanner=scanner, clock=wall, command_clock=WallClock(),
        mission_taken=lambda mission: base.stand_at_start(pose_of(mission.start)),
    )  # fmt: skip
    agent = Agent(
        keys=KeyExpressions("r1"), link=board.link(), journal=journal, runner=controller,
        inbox=Inbox(journal, controller, scanner.profiles), clock=wall, command_clock=WallClock(),
        speed_up=200, recorder=RunRecorder(folder),
    )  # fmt: skip
    return agent, controller


def test_what_was_missed_while_the_link_was_cut_is_reported_once_and_in_order_and_again_of_the_past_run(
    tmp_path: Path,
) -> None:
    board, journal = Switchboard(), memory_journal()
    agent, controller = fast_robot(board, journal, tmp_path)
    with agents.on_link(agent):
        station = Station(board.link(), KeyExpressions("r1"), commander="test")
        station.push(corridor())
        told: queue.Queue[Report] = queue.Queue()
        watching = threading.Thread(target=lambda: [told.put(report) for report in station.reports()])
        watching.start()
        station.command("start")
        heard: list[Report] = []
        while not (heard and isinstance(heard[-1], Scanned)):
            heard.append(told.get(timeout=60))
        board.cut = True
        while controller.run.state != "FINISHED":
            time.sleep(0.01)
        board.cut = False
        watching.join(20)
        past = list(past_reports(station, str(controller.run.run_id), station.mission))
        with pytest.raises(NegativeResult, match=f"no run x; its runs are {controller.run.run_id}"):
            next(past_reports(station, "x", station.mission))
    heard += [told.get() for _ in range(told.qsize())]
    events = [report for report in heard if isinstance(report, Event)]
    assert [event.number for event in events] == list(range(events[0].number, journal.newest + 1))
    poses = [report for report in past if isinstance(report, PoseReport)]
    assert [pose.seq for pose in poses] == list(range(poses[0].seq, poses[0].seq + len(poses)))
    told_live = [report for report in heard if isinstance(report, PoseReport)]
    assert told_live[: len(poses)] == poses  # and then, perhaps, how it stands there
    assert [report for report in past if isinstance(report, Event)] == list(journal.events())
    assert isinstance(past[-1], StateReport)
    assert (past[-1].state, past[-1].done) == ("FINISHED", ("s1", "s2", "s3"))
    assert heard[-1] is not None
    assert [report.state for report in heard if isinstance(report, StateReport)][-1] == "FINISHED"


def test_a_forged_publication_is_left_out() -> None:
    field = Field()
    station = field.station()
    station.push(corridor())
    field.order("start")
    field.work()
    reports = station.reports()
    first = next(reports)
    field.board.link().publisher(field.keys.state)(b"{}")
    field.board.link().publisher(field.keys.event)(b"\xff")
    for key in (field.keys.state, field.keys.event, field.keys.pose, field.keys.health):
        field.board.link().publisher(key)(b'{"later": ' + b"[" * 20_000)
    rest = [first, *reports]
    assert [report.state for report in rest if isinstance(report, StateReport)][-1] == "FINISHED"


def test_an_answer_in_unknown_words_is_unknown() -> None:
    field = Field()
    station = field.station()
    field.board.link().serve(field.keys.info, lambda request: b'{"is": "Info", "protocol": 9}')
    with pytest.raises(OutcomeUnknown, match="unknown answer"):
        station.status()


def test_a_robot_whose_work_has_failed_does_not_look_alive() -> None:
    field = Field()
    field.station().push(corridor())
    agent = Agent(
        keys=KeyExpressions("r1"), link=Switchboard().link(), journal=field.journal,
        runner=field.controller, clock=field.clock, command_clock=WallClock(),
    )  # fmt: skip

    def broken(*arguments: object, **options: object) -> None:
        raise ZeroDivisionError

    field.base.goto = broken  # type: ignore[method-assign, assignment]
    with agents.on_link(agent), pytest.raises(ZeroDivisionError):
        field.order("start")
        agent.wait()


class Taken:
    """A recording that keeps the revisions it is handed."""

    def __init__(self) -> None:
        self.revisions: list[int] = []

    def mission(self, mission: Mission) -> None:
        self.revisions.append(mission.revision)

    def state(self, report: StateReport) -> None: ...

    def pose(self, report: PoseReport) -> None: ...

    def event(self, event: AnyEvent) -> None: ...

    def health(self, told: Health) -> None: ...

    def missing(self, gap: PosesMissing) -> None: ...

    def incomplete(self, report: ReportsMissing) -> None: ...


def test_a_recording_is_handed_every_revision_in_turn_also_when_it_comes_late() -> None:
    field, record = Field(), Taken()
    field.station().push(corridor(stops=2))
    field.order("start")
    for revision in (2, 3):
        field.station().push(corridor(stops=1 + revision, revision=revision))
        while field.controller.run.revision != revision:
            field.controller.step()
    field.work()
    watch_with(field.station(), record, EventLines(lambda line: None))
    assert record.revisions == [1, 2, 3]


@pytest.mark.parametrize(("verb", "code"), [("pause", 2), ("abort", 1)])
def test_a_run_is_followed_to_its_end_though_its_recording_finds_no_room(
    verb: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    field.order(verb)
    field.order("resume")
    field.work()
    monkeypatch.setattr(watch_commands, "reached", lambda way: nullcontext(field.station()))
    rrd = tmp_path / "field.rrd"
    with small_disk(0):
        assert main(["watch", "--robot", "r1", "--rrd", str(rrd), "--json"]) == code
    told = capsys.readouterr()
    assert json.loads(told.out.splitlines()[-1])["state"] == {2: "FINISHED", 1: "ABORTED"}[code]
    assert [line for line in told.err.splitlines() if "field" in line] == [
        f"{rrd.with_name('field.partial.rrd')}: cannot be written (File too large); "
        "the recording waits in memory for room",
        f"{'stopgo: ' * (code == 2)}{rrd}: could not be written completely (File too large); "
        "the file was not saved",
    ]
