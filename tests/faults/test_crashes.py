"""The power fails at every journal entry, before and after it is stored, in simulated time.

Each trial pushes, starts and resumes as a stubborn station would, with the same ids again and again, until
the run is finished; then the journal and the scanner's own record must agree on what happened.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pytest

from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import encode
from stopgo.mission.document import Mission
from stopgo.mission.run.events import Event, Finished, Scanned, Started
from stopgo.mission.run.run_commands import Answer, RunCommand, Verb
from stopgo.mission.run.states import Run
from tests.bridge.robot.test_push import manifest_of
from tests.bridge.world import Field, corridor
from tests.faults.sizes import size

MISSION = corridor(stops=3)
T = TypeVar("T")


class PowerCut(BaseException):
    """The process is gone, this instant."""


class Mains:
    """Cuts the power at chosen journal entries, counted over all boots."""

    def __init__(self, *cuts: tuple[str, int]) -> None:
        self.cuts = set(cuts)
        self.seen: Counter[str] = Counter()
        self.failures = 0

    def __call__(self, moment: str) -> None:
        self.seen[moment] += 1
        if (moment, self.seen[moment]) in self.cuts:
            self.failures += 1
            raise PowerCut


class Trial:
    """One robot on unreliable mains, and one station that does not give up."""

    def __init__(self, mains: Mains, record: Path) -> None:
        self.mains = mains
        self.field = Field(record=record)
        self.field.journal.rows.commit_hook = mains
        self.record = record
        self.interrupted: Counter[str] = Counter()

    def insist(self, act: Callable[[], T]) -> T:
        """Do it again after every power cut; the robot boots in between."""
        while True:
            try:
                return act()
            except PowerCut:
                self.boot()

    def boot(self) -> None:
        run = self.field.journal.fact("run", Run)
        if run is not None and run.stop_state == "SCANNING":
            self.interrupted[MISSION.stops[run.at].id] += 1
        while True:
            try:
                self.field.boot()
                return
            except PowerCut:
                continue

    def push(self, mission: Mission) -> None:
        document = encode(mission)
        manifest = manifest_of(mission, document)
        keys = self.field.keys
        ask = [
            Request(keys.mission(mission.id, "begin"), encode(manifest)),
            Request(keys.mission(mission.id, "chunk/0"), document, {"of": manifest.sha256}),
            Request(keys.mission(mission.id, "commit"), encode(self.field.commit(manifest))),
        ]
        for request in ask:
            self.insist(lambda request=request: self.field.inbox.receive(request))  # type: ignore[misc]

    def order(self, verb: Verb) -> Answer:
        command: RunCommand = self.field.command(verb)
        return self.insist(lambda: self.field.controller.execute(command))

    def finish(self) -> None:
        while self.field.controller.run.state != "FINISHED":
            if self.field.controller.run.state == "PAUSED":
                self.order("resume")
            self.insist(self.field.work)


def run_trial(mains: Mains, record: Path) -> Trial:
    trial = Trial(mains, record)
    trial.push(MISSION)
    assert trial.order("start").outcome == "ok"
    trial.finish()
    return trial


def check(trial: Trial) -> None:
    """Nothing was lost, nothing was done twice, and the mission is the one that was sent."""
    events = trial.field.journal.events()
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    assert kinds(events, Started) == 1
    assert kinds(events, Finished) == 1
    assert [event.stop for event in events if isinstance(event, Scanned)] == ["s1", "s2", "s3"]
    stored = trial.field.journal.missions.read(MISSION.id, 1)
    assert stored is not None
    assert stored[1] == encode(MISSION)
    scans = Counter(line.split("-")[1] for line in trial.record.read_text().splitlines() if "end" in line)
    for stop in MISSION.stops:
        assert 1 <= scans[stop.id] <= 1 + trial.interrupted[stop.id], (stop.id, scans, trial.interrupted)


def kinds(events: tuple[Event, ...], kind: type[Event]) -> int:
    return sum(isinstance(event, kind) for event in events)


def entries() -> int:
    """Number of journal entries of an undisturbed mission."""
    mains = Mains()
    field = Field()
    field.journal.rows.commit_hook = mains
    field.station().push(MISSION)
    field.order("start")
    field.work()
    return mains.seen["commit"]


ENTRIES = entries()


@pytest.mark.parametrize("moment", ["commit", "committed"])
def test_a_power_cut_at_any_journal_entry_loses_nothing_and_repeats_nothing(
    tmp_path: Path, moment: str
) -> None:
    for entry in range(1, ENTRIES + 1):
        trial = run_trial(Mains((moment, entry)), tmp_path / f"{entry}.log")
        assert trial.mains.failures == 1
        check(trial)


def test_many_power_cuts_in_one_run_lose_nothing_and_repeat_nothing(tmp_path: Path) -> None:
    trials, failures, again = size(short=75, full=3000), 0, 0
    for seed in range(trials):
        chance = random.Random(seed)
        cuts = {
            (chance.choice(["commit", "committed"]), chance.randint(1, 2 * ENTRIES))
            for _ in range(chance.randint(1, 12))
        }
        trial = run_trial(Mains(*cuts), tmp_path / f"{seed}.log")
        check(trial)
        failures += trial.mains.failures
        again += trial.record.read_text().count("end") - len(MISSION.stops)
    print(f"{trials} trials: {failures} cuts; {again} scans that were interrupted were taken again")
    assert failures > trials
