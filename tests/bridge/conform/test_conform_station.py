"""The kit passes our own station, and finds each way in which a broken one breaks the protocol."""

from __future__ import annotations

import json
import sys
import threading
import uuid
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.conform.conform_station import StationOptions, by_command, by_hand
from stopgo.bridge.conform.requirements import NotTried
from stopgo.bridge.conform.station_requirements import STATION_REQUIREMENTS
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import Info, encode
from stopgo.bridge.link.signatures import KeySigning, Question
from stopgo.bridge.station.follow import Followed
from stopgo.bridge.station.station import Station
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError, NegativeResult, OutcomeUnknown
from stopgo.mission.files.mission_json import read
from stopgo.mission.run.run_commands import Answer, RunCommand, Verb
from tests.bridge.conform.station_under_test import StationUnderTest, verdicts
from tests.bridge.guarded import keys_of_site
from tests.bridge.world import corridor

pytestmark = pytest.mark.usefixtures("own_time")


def test_our_own_station_meets_every_requirement() -> None:
    found = verdicts(StationUnderTest())
    assert {text: one.reason for text, one in found.items() if one.outcome == "failed"} == {}
    assert {one.section for one in found.values() if one.outcome == "not tried"} == {"Signatures"}


def test_our_own_station_with_keys_meets_what_is_said_of_signatures(tmp_path: Path) -> None:
    found = verdicts(StationUnderTest(keys_of_site(tmp_path / "site")), "Signatures")
    assert {text: one.reason for text, one in found.items() if one.outcome != "passed"} == {}


# Stations that are broken


class NewIdEachTime(Station):
    def _ask_repeatedly(self, key: str, payload: bytes, within_s: float, **details: Any) -> bytes | None:
        for _ in range(3):
            if "/cmd/" in key:
                payload = encode({**json.loads(payload), "cmd_id": uuid.uuid4().hex})
            reply = self.link.ask(key, payload, timeout_s=1.0, parameters=_parameters(details))
            if reply is not None:
                return reply
        return None


class CallsSilenceDone(Station):
    def give(self, order: RunCommand, **details: Any) -> Answer:
        try:
            return super().give(order, **details)
        except OutcomeUnknown:
            return Answer(cmd_id="", verb=order.verb, outcome="ok", reason=None, message="", run_id=None,
                          state="RUNNING")  # fmt: skip


class TriesRefusedOrdersAgain(Station):
    def command(self, verb: Verb, **details: Any) -> Answer:
        try:
            return super().command(verb, **details)
        except NegativeResult:
            return super().command(verb, **details)


class TakesOverAlways(Station):
    def order(self, verb: Verb, **details: Any) -> RunCommand:
        return super().order(verb, **{**details, "take_over": True})


class AsksBeforeItStops(Station):
    def stop_order(self, verb: Verb, **details: Any) -> RunCommand:
        return self.order(verb, **details)


class SendsEverythingAgain(Station):
    def _send_chunks(self, manifest: Any, document: bytes, held: set[int], *rest: Any) -> None:
        super()._send_chunks(manifest, document, set(), *rest)


class NeverLooksBack(Station):
    def _read_back(self, manifest: Any) -> None:
        """Nothing."""


class NewNonceEachTime(NewIdEachTime):
    def _ask_repeatedly(self, key: str, payload: bytes, within_s: float, **details: Any) -> bytes | None:
        for _ in range(3):
            if key.endswith("/commit"):
                payload = encode({**json.loads(payload), "nonce": uuid.uuid4().hex})
            reply = self.link.ask(key, payload, timeout_s=1.0, parameters=_parameters(details))
            if reply is not None:
                return reply
        return None


class ReadsInfoStrictly(Station):
    def info(self, *, within_s: float | None = None) -> Info:
        raw = self.link.ask(self.keys.info, timeout_s=1.0) or b"{}"
        if "later" in json.loads(raw):
            raise InputError("unknown field later")
        return super().info(within_s=within_s)


class SeesOneOfTwo(Station):
    def _only_info(self, replies: list[bytes], what: str) -> Info | None:
        return super()._only_info(replies[-1:], what)


class LeavesGaps(Station):
    def reports(self) -> Iterator[Followed]:
        asked = self.link.ask

        def but_poses(key: str, *rest: Any, **details: Any) -> bytes | None:
            return None if key.endswith("/poses") else asked(key, *rest, **details)

        self.link.ask = but_poses  # type: ignore[method-assign]
        return super().reports()


class LooksFirst(Station):
    """Asks for what the robot holds, and for a chunk that is none, before it pushes."""

    chunk = "0"

    def push(self, mission: Mission, **details: Any) -> Any:
        self.link.ask(self.keys.mission(mission.id, "part/0"), timeout_s=1.0)
        self.link.ask(self.keys.mission(mission.id, f"chunk/{self.chunk}"), timeout_s=1.0)
        return super().push(mission, **details)


class CountsInWords(LooksFirst):
    chunk = "first"


def _parameters(details: dict[str, Any]) -> dict[str, str]:
    return {name: value for name, value in details.items() if name not in ("try_s", "bulk")}


@pytest.mark.parametrize(
    ("broken", "requirement", "why"),
    [
        (NewIdEachTime, "an answer lost: the same command again, under its id", "under 2 ids"),
        (CallsSilenceDone, "no answer: reported as unknown, one id", "exit code 0, not 3"),
        (TriesRefusedOrdersAgain, "a refusal is reported, and not tried again", "ordered 2 times"),
        (TakesOverAlways, "another's lease is not taken without a request", "exit code 0, not 1"),
        (AsksBeforeItStops, "`pause` is sent without asking, and small", "not reported as done"),
        (SendsEverythingAgain, "a cut: goes on with what is missing", "sent again"),
        (NeverLooksBack, "every chunk, then the commit, then a look", "nothing was read back"),
        (NeverLooksBack, "done only when the state reports so", "reports another mission"),
        (NewNonceEachTime, "a commit is repeated under its nonce", "under 2 nonces"),
        (ReadsInfoStrictly, "fields that are not known are passed over", "cannot be started"),
        (LeavesGaps, "poses that were missed are requested", "are not requested"),
        (CountsInWords, "every chunk, then the commit, then a look", "a chunk's number: 'first'"),
        (SeesOneOfTwo, "two boots: no command, both paused", "though two robots"),
    ],
)
def test_a_broken_station_is_found_by_the_requirement_that_names_it(
    broken: type[Station], requirement: str, why: str
) -> None:
    station = StationUnderTest()
    station.station = broken
    found = verdicts(station, requirement)[requirement]
    assert found.outcome == "failed"
    assert why in found.reason


def test_a_station_may_ask_before_it_pushes() -> None:
    station = StationUnderTest()
    station.station = LooksFirst
    whole = "every chunk, then the commit, then a look"
    assert verdicts(station, whole)[whole].outcome == "passed"


class BelievesEverybody(KeySigning):
    def verify_answer(self, question: Question, payload: bytes, attachment: bytes) -> bytes | None:
        super().verify_answer(question, payload, attachment)
        return payload


class Credulous(StationUnderTest):
    def link(self) -> Link:
        held = self.held("alice")
        assert held is not None
        return self.board.link(BelievesEverybody(held))


@pytest.mark.parametrize(
    ("requirement", "why"),
    [
        ("an Info without a valid signature: no command", "reported as done"),
        ("an answer without a valid signature: unknown", "exit code 0, not 3"),
    ],
)
def test_a_station_that_believes_forgers_is_found(requirement: str, why: str, tmp_path: Path) -> None:
    found = verdicts(Credulous(keys_of_site(tmp_path / "site")), requirement)[requirement]
    assert found.outcome == "failed"
    assert why in found.reason


def test_every_requirement_stands_in_the_document() -> None:
    text = (Path(__file__).parents[3] / "docs/reference/protocol.md").read_text(encoding="utf-8")
    headings = {line.lstrip("# ") for line in text.splitlines() if line.startswith("##")}
    assert {one.section for one in STATION_REQUIREMENTS} <= headings


def test_a_command_is_given_what_to_do_and_its_exit_code_counts(tmp_path: Path) -> None:
    wrote = tmp_path / "words"
    script = tmp_path / "station.py"
    script.write_text("import sys; open(sys.argv[1], 'a').write(' '.join(sys.argv[2:])); sys.exit(3)")
    command = f"{sys.executable} {script} {wrote} {{what}} --robot r1"
    options = StationOptions("tcp/127.0.0.1:1", "r1", command=command)
    do = by_command(options, tmp_path / "mission.json")
    assert do("start", None) == 3
    assert do("push", corridor()) == 3
    assert wrote.read_text() == f"start --robot r1push {tmp_path / 'mission.json'} --robot r1"
    assert read(tmp_path / "mission.json") == corridor()
    for wrong, said in (("stopgo start", "must hold {what}"), ("no-such-program {what}", "No such file")):
        with pytest.raises(InputError, match=said):
            by_command(replace(options, command=wrong), tmp_path / "mission.json")("start", None)


def test_a_person_who_lets_the_station_do_nothing_is_waited_for_in_vain() -> None:
    said: list[str] = []
    options = StationOptions("tcp/127.0.0.1:1", "r1", patience_s=30.0, say=said.append)
    station = StationUnderTest()
    with station.bench() as bench:
        do = by_hand(options, bench.link, Path("mission.json"))
        with pytest.raises(NotTried, match="nobody let the station start within 30 s"):
            do("start", None)
        bench.ready()
        threading.Thread(target=station.does, args=("start", None)).start()
        assert do("start", None) is None
    assert said == ["now let the station start r1"] * 2


def test_a_station_that_does_nothing_passes_nothing() -> None:
    class Idle(StationUnderTest):
        def does(self, what: str, mission: Mission | None) -> int:
            return 1

    found = verdicts(Idle())
    assert {one.outcome for one in found.values()} == {"not tried"}
    assert "the station was to start and sent no query (exit code 1)" in str(found.values())
