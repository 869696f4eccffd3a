"""The date is set forward, at the robot or at the station, while they run and over a reboot.

While a program runs, its clock counts on from where it began, so that a new date moves nothing. Over a
reboot the robot takes the new date: what was meant for an earlier time is refused, and nothing else is lost.
"""

from __future__ import annotations

import random
import time
from datetime import timedelta
from itertools import pairwise
from pathlib import Path

import pytest

from stopgo.bridge.link import keys as site_keys
from stopgo.bridge.link.clock import WallClock
from stopgo.bridge.link.keys import now_utc, read_keys
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions, Rejected
from stopgo.bridge.link.signatures import KeySigning
from stopgo.bridge.robot import agent as agents
from stopgo.bridge.robot.agent import Agent
from stopgo.bridge.robot.controller import Controller
from stopgo.bridge.robot.inbox import Inbox
from stopgo.bridge.robot.journal_file import memory_journal
from stopgo.bridge.robot.robot_hardware import pose_of
from stopgo.bridge.robot.simulator import SimulatedBase, SimulatedScanner
from stopgo.bridge.station.station import Station
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.run.events import AnyEvent, Finished, PoseReport, Scanned, StateReport
from stopgo.mission.run.lease import lasting_ns
from stopgo.mission.run.run_commands import Answer, Verb
from tests.bridge.guarded import GuardedField, keys_of_site
from tests.bridge.robot.test_push import manifest_of
from tests.bridge.world import Field, corridor
from tests.faults.sizes import size, some
from tests.faults.test_crashes import ENTRIES, Mains, Trial, check

HOUR, YEAR = 3600.0, 365 * 86400.0
LONGEST_LEG_S = 100.0
"""Between two events of the corridor's run; the way back is the longest."""


def set_forward(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    """The date of this machine, for all that runs in this process."""
    date_ns, date = time.time_ns, now_utc
    monkeypatch.setattr(time, "time_ns", lambda: date_ns() + round(seconds * 1e9))
    monkeypatch.setattr(time, "time", lambda: time.time_ns() / 1e9)
    monkeypatch.setattr(site_keys, "now_utc", lambda: date() + timedelta(seconds=seconds))


@pytest.mark.parametrize("seconds", some([10 * YEAR, HOUR, YEAR], every=3))
def test_a_date_that_is_set_forward_at_both_ends_during_a_run_moves_nothing(
    monkeypatch: pytest.MonkeyPatch, seconds: float
) -> None:
    board, journal, clock = Switchboard(), memory_journal(), WallClock(speed_up=50)
    base, scanner = SimulatedBase(clock=clock), SimulatedScanner(clock=clock)
    controller = Controller(
        robot="r1", journal=journal, base=base, scanner=scanner, clock=clock, command_clock=WallClock(),
        mission_taken=lambda mission: base.stand_at_start(pose_of(mission.start)),
    )  # fmt: skip
    agent = Agent(
        keys=KeyExpressions("r1"), link=board.link(), journal=journal, runner=controller,
        inbox=Inbox(journal, controller, scanner.profiles), clock=clock, command_clock=WallClock(),
        speed_up=50,
    )  # fmt: skip
    with agents.on_link(agent):
        alice, bob = (Station(board.link(), KeyExpressions("r1"), commander=who) for who in ("alice", "bob"))
        alice.push(corridor())
        alice.command("start")
        fence = alice.info().lease
        events: list[AnyEvent] = []
        for report in alice.reports():
            if isinstance(report, StateReport | PoseReport) or not hasattr(report, "number"):
                continue
            events.append(report)
            if isinstance(report, Scanned) and report.stop == "s1":
                set_forward(monkeypatch, seconds)
                alice.command("pause")
                with pytest.raises(NegativeResult, match="not_the_commander"):
                    bob.command("resume")
                assert alice.command("resume").outcome == "ok"
    assert fence is not None
    assert controller.lease is not None
    assert controller.lease.fence == fence.fence
    assert isinstance(events[-1], Finished)
    times = [event.robot_ns / 1e9 for event in events]
    assert all(0 <= after - before < LONGEST_LEG_S for before, after in pairwise(times))


class Jumping(Trial):
    """Whenever the robot boots, the date has been set forward, by a second to ten years."""

    def __init__(self, mains: Mains, record: Path, chance: random.Random) -> None:
        super().__init__(mains, record)
        self.chance = chance
        self.expired = 0

    def boot(self) -> None:
        self.field.base.stop()
        self.field.clock.jump(10 ** self.chance.uniform(0.0, 8.5))
        super().boot()

    def order(self, verb: Verb) -> Answer:
        """A new order when the old one has expired, as a station would write it."""
        while (answer := super().order(verb)).reason == "expired":
            self.expired += 1
        return answer

    def push(self, mission: Mission) -> None:
        while self.field.journal.missions.read(mission.id, mission.revision) is None:
            super().push(mission)


def test_a_date_that_is_set_forward_over_reboots_loses_nothing_and_repeats_nothing(tmp_path: Path) -> None:
    trials, jumps, expired = size(short=100, full=2000), 0, 0
    for seed in range(trials):
        chance = random.Random(seed)
        moments = [chance.choice(["commit", "committed"]) for _ in range(chance.randint(1, 6))]
        mains = Mains(*((moment, chance.randint(1, 2 * ENTRIES)) for moment in moments))
        trial = Jumping(mains, tmp_path / f"{seed}.log", chance)
        trial.push(corridor())
        assert trial.order("start").outcome == "ok"
        trial.finish()
        check(trial)
        times = [event.robot_ns for event in trial.field.journal.events()]
        assert times == sorted(times)
        jumps, expired = jumps + trial.mains.failures, expired + trial.expired
    print(f"{trials} runs: {jumps} reboots with a later date, {expired} orders expired and were given anew")
    assert jumps > trials
    assert expired > 0


def test_what_was_meant_for_an_earlier_date_comes_to_nothing() -> None:
    """An order, a commit and a lease from before; what had been carried out is answered as it was."""
    field = Field()
    station = field.station()
    station.push(corridor())
    start, skip = field.command("start"), field.command("skip")
    assert field.controller.execute(start).outcome == "ok"
    old = field.commit(manifest_of(corridor(stops=2, revision=2), b""))
    field.base.stop()
    field.clock.jump(YEAR)
    field.boot()
    assert field.controller.execute(start).outcome == "ok"
    assert field.controller.execute(skip).reason == "expired"
    late = field.controller.take(old, corridor(stops=2, revision=2))
    assert isinstance(late, Rejected)
    assert late.reason == "expired"
    assert field.order("resume", commander="bob").outcome == "ok"
    field.work()
    assert [event.stop for event in field.journal.events() if isinstance(event, Scanned)] == [
        "s1",
        "s2",
        "s3",
    ]


def test_a_lease_from_a_date_far_ahead_ends_within_its_minute_once_the_date_is_right_again() -> None:
    field = Field()
    field.station().push(corridor())
    field.clock.jump(YEAR)
    assert field.order("start").outcome == "ok"
    field.base.stop()
    field.clock.jump(-YEAR)
    field.boot()
    assert field.order("resume", commander="bob").reason == "not_the_commander"
    field.clock.wait(lasting_ns() / 1e9)
    assert field.order("resume", commander="bob").outcome == "ok"


def test_a_robot_whose_date_is_beyond_a_certificates_end_obeys_it_no_more_and_runs_on(tmp_path: Path) -> None:
    """And a station whose date is beyond it sends nothing."""
    site = keys_of_site(tmp_path / "site")
    field, date = GuardedField(site), now_utc()
    robot = read_keys(site / "r1", now=date)
    field.serve(
        KeySigning(robot, boot_id=field.controller.boot_id, now=lambda: date, clock_ns=field.clock.now_ns)
    )
    station = field.guarded_station()
    station.push(corridor())
    assert station.command("start").outcome == "ok"
    date += timedelta(days=91)
    with pytest.raises(NegativeResult, match="untrusted: the certificate of alice ends"):
        station.command("pause")
    field.work()
    assert field.controller.run.state == "FINISHED"
    with pytest.raises(InputError, match="issue new keys for alice"):
        read_keys(site / "alice", now=date)
