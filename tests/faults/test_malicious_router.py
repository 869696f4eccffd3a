"""A router that drops, holds back, replays, swaps and changes messages, and lets others answer.

Whatever it does, nothing but denial of service comes of it: what a station receives, the robot has said, for
this question or lately; what a station has given up is never done later; nothing is done twice.
"""

from __future__ import annotations

import json
import random
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.link.link import Request
from stopgo.bridge.link.memory_link import SignedMessage
from stopgo.bridge.link.protocol import encode
from stopgo.bridge.link.signatures import OLDEST_S
from stopgo.bridge.station import station as stations
from stopgo.mission.errors import NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.run.decision import STATES
from stopgo.mission.run.events import Scanned, Started, StateReport
from stopgo.mission.run.run_commands import FREE_VERBS, Answer, RunCommand, Verb
from tests.bridge.guarded import GuardedField, keys_of_site
from tests.bridge.world import corridor
from tests.faults.sizes import size

VERBS: tuple[Verb, ...] = ("start", "pause", "resume", "skip", "retry", "abort", "home")
SHIFTED = ("clock_ns", "issued_ns", "valid_for_s", "not_after_ns", "fence", "seq", "revision", "robot_ns")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return keys_of_site(tmp_path_factory.mktemp("keys") / "site")


class FieldTime:
    """The station's time passes with the robot's, whatever date that has."""

    def __init__(self, field: GuardedField) -> None:
        self._field = field
        self._began_ns = field.steady_ns()  # seconds since 1970 are not told apart by less than 0.2 µs

    def monotonic(self) -> float:
        return (self._field.steady_ns() - self._began_ns) / 1e9

    def sleep(self, seconds: float) -> None:
        self._field.clock.wait(seconds)


class Malice:
    """Manipulation by a router of each message that passes it."""

    def __init__(self, field: GuardedField, chance: random.Random) -> None:
        self.field = field
        self.chance = chance
        self.carries = chance.choice([3, 30, 300])
        """How often, beside 35 times that it does not."""
        self.did: Counter[str] = Counter()
        self.kept: list[SignedMessage] = []
        self.honest = False
        self.withholds = ""
        """Messages on keys with this in them are all held back."""

    def __call__(self, message: SignedMessage) -> Iterable[SignedMessage]:
        if self.honest:
            return (message,)
        self.kept.append(message)
        kinds = ("carry", "drop", "hold back", "replay", "swap", "shift", "flip")
        kind = self.chance.choices(kinds, weights=(self.carries, 8, 8, 5, 5, 5, 4))[0]
        if self.withholds and self.withholds in message.key:
            kind = "hold back"
        self.did[kind] += 1
        return self.done(kind, message)

    def done(self, kind: str, message: SignedMessage) -> Iterable[SignedMessage]:
        if kind == "hold back":
            later_s = 10 ** self.chance.uniform(-1.0, 2.0)
            self.field.clock.at(later_s, lambda: self.deliver(message))
        arrives: dict[str, Callable[[], tuple[SignedMessage, ...]]] = {
            "carry": lambda: (message,),
            "replay": lambda: (message, self.any_like(message)),
            "swap": lambda: (self.any_like(message),),
            "shift": lambda: (replace(message, payload=self.shifted(message.payload)),),
            "flip": lambda: (replace(message, **self.flipped(message)),),
        }
        return arrives[kind]() if kind in arrives else ()

    def any_like(self, message: SignedMessage) -> SignedMessage:
        return self.chance.choice([kept for kept in self.kept if kept.kind == message.kind])

    def shifted(self, payload: bytes) -> bytes:
        """The same message with later times and greater numbers."""
        try:
            told = json.loads(payload)
        except ValueError:
            return payload
        by = self.chance.choice([1, 40, 40 * 10**9])
        if not isinstance(told, dict):
            return payload
        return json.dumps(
            {
                key: value + by if key in SHIFTED and isinstance(value, int | float) else value
                for key, value in told.items()
            }
        ).encode()

    def flipped(self, message: SignedMessage) -> dict[str, bytes]:
        which = self.chance.choice(["payload", "attachment"])
        data = bytearray(getattr(message, which))
        if data:
            data[self.chance.randrange(len(data))] ^= 1 << self.chance.randrange(8)
        return {which: bytes(data)}

    def deliver(self, message: SignedMessage) -> None:
        """Deliver messages that were held back; nobody waits for their answers any more."""
        if message.kind == "told":
            self.honest = True
            self.field.board.tell(message)
            self.honest = False
        elif message.kind == "question":
            self.field.board.answers(message)


def impostor(field: GuardedField, name: str) -> None:
    """Somebody with other keys answers first, and says that all is well."""
    link = field.board.link(field.signing(name, boot_id=field.controller.boot_id))

    def answered(request: Request) -> bytes:
        verb = request.key.rpartition("/")[2]
        if "/cmd/" in request.key:
            order = msgspec.json.decode(request.payload, type=RunCommand)
            lie = Answer(
                cmd_id=order.cmd_id, verb=verb, outcome="ok", reason=None, message="", run_id="x",
                state="RUNNING",
            )  # fmt: skip
            return encode(lie)
        return b"{}"

    link.serve(f"{field.keys.root}/**", answered)


class Trial:
    """A station that tries to run a mission, and what it received from whom."""

    def __init__(self, site: Path, seed: int) -> None:
        self.chance = random.Random(seed)
        self.field = GuardedField(site)
        self.malice = Malice(self.field, self.chance)
        self.station = self.field.guarded_station()
        self.station.timeout_s = self.station.patience_s = 1.0
        self.said: dict[tuple[str, int], int] = {}
        """When the robot said each state, by boot and number."""
        self.heard: list[tuple[str, int]] = []
        self.given_up: list[str] = []
        self.outcomes: Counter[str] = Counter()
        self.station.link.hear(self.field.keys.state, self.hear)

    def tell(self) -> None:
        """The robot reports its state, as it does every second."""
        state = self.state()
        self.said[state.boot_id, state.seq] = self.field.steady_ns()
        self.field.link.publisher(self.field.keys.state)(encode(state))

    def state(self) -> StateReport:
        return self.field.agent_state()

    def hear(self, key: str, payload: bytes) -> None:
        state = msgspec.json.decode(payload, type=StateReport)
        name = (state.boot_id, state.seq)
        assert name in self.said, "a state that the robot never told"
        assert self.field.steady_ns() - self.said[name] <= OLDEST_S * 1e9, "a state of long ago"
        self.heard.append(name)

    def order(self, verb: Verb) -> None:
        order = None
        self.malice.withholds = self.chance.choice(["", "", f"/cmd/{verb}"])
        try:
            order = self.station.order(verb)
            order = msgspec.structs.replace(order, valid_for_s=1.0)
            self.station.give(order, within_s=1.0)
            stored = self.field.journal.answer(order.cmd_id)
            assert stored is not None, "the robot never got what the station was told it did"
            assert stored[1].outcome == "ok"
            self.outcomes["done"] += 1
        except (OutcomeUnknown, RobotUnreachable):
            self.outcomes["unknown"] += 1
            bound = order is not None and verb not in FREE_VERBS
            if bound and self.field.journal.answer(order.cmd_id) is None:
                self.given_up.append(order.cmd_id)
        except NegativeResult:
            self.outcomes["refused"] += 1
        self.malice.withholds = ""

    def status(self) -> None:
        before = self.state()
        try:
            state = self.station.status()
        except (OutcomeUnknown, NegativeResult):
            self.outcomes["no state"] += 1
            return
        assert state.boot_id == before.boot_id
        assert state.seq > before.seq, "a state from before the question"
        self.outcomes["state"] += 1

    def push(self) -> None:
        try:
            self.station.push(corridor())
        except (OutcomeUnknown, NegativeResult):
            self.outcomes["push failed"] += 1
        else:
            assert self.field.controller.run.mission_id == corridor().id
            self.outcomes["pushed"] += 1

    def reboot(self) -> None:
        self.field.base.stop()
        self.field.set_date(self.chance.uniform(-60.0, 60.0))
        self.field.boot()
        self.field.answer_as("r1")

    def run(self) -> None:
        self.station.push(corridor())
        self.field.router.meddle = self.malice
        for name in self.chance.sample(["r2", "vera", "bob"], self.chance.randint(0, 2)):
            impostor(self.field, name)
        for _ in range(12):
            act = self.chance.choice(["order", "order", "order", "status", "push", "work", "reboot"])
            self.tell()
            match act:
                case "order":
                    state = self.field.controller.run.state
                    fitting = [verb for verb in VERBS if state in STATES[verb]]
                    self.order(self.chance.choice(fitting or VERBS))
                case "status":
                    self.status()
                case "push":
                    self.push()
                case "reboot":
                    self.reboot()
                case _:
                    self.field.controller.step()
                    self.field.clock.wait(1.0)
        self.field.clock.wait(200.0)  # all that was held back arrives

    def check(self) -> None:
        for cmd_id in self.given_up:
            stored = self.field.journal.answer(cmd_id)
            assert stored is None or stored[1].outcome == "refused", "done after it was given up"
        assert len(self.heard) == len(set(self.heard)), "a state was heard twice"
        for boot in {boot for boot, _ in self.heard}:
            numbers = [number for told_by, number in self.heard if told_by == boot]
            assert numbers == sorted(numbers)
        events = self.field.journal.events()
        runs = [event.run_id for event in events if isinstance(event, Started)]
        assert len(runs) == len(set(runs))
        scans = Counter((event.run_id, event.stop) for event in events if isinstance(event, Scanned))
        assert all(number == 1 for number in scans.values())


def test_a_malicious_router_can_do_nothing_but_withhold(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    did: Counter[str] = Counter()
    outcomes: Counter[str] = Counter()
    for seed in range(size(short=4, full=200)):
        trial = Trial(site, seed)
        monkeypatch.setattr(stations, "time", FieldTime(trial.field))
        trial.run()
        trial.check()
        did += trial.malice.did
        outcomes += trial.outcomes
        outcomes["heard"] += len(trial.heard)
        outcomes["given up"] += len(trial.given_up)
    print(dict(did), dict(outcomes))
    assert all(did[kind] for kind in ("drop", "hold back", "replay", "swap", "shift", "flip"))
    assert all(outcomes[kind] for kind in ("done", "heard", "given up"))
