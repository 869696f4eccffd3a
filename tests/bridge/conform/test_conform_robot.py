"""The kit passes our own robot, and finds each way in which a broken one breaks the protocol."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest

from stopgo.bridge.conform.conform_robot import REQUIREMENTS, check_at_rest, robot_verdicts
from stopgo.bridge.conform.requirements import ConformVerdict, tried
from stopgo.bridge.conform.robot_bench import OVER
from stopgo.bridge.link.link import Answering, Request
from stopgo.bridge.link.protocol import (
    POSE_PAGE,
    LogPage,
    Manifest,
    MissionPart,
    PosePage,
    RecordPage,
    Rejected,
    decode,
    encode,
)
from stopgo.bridge.link.signatures import KeySigning, MessageSigning, SignedAnswering
from stopgo.bridge.robot.agent import Agent
from stopgo.bridge.robot.controller import Controller
from stopgo.bridge.robot.inbox import Inbox
from stopgo.bridge.robot.recorder import RunRecorder
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import StateReport, TakenOver
from stopgo.mission.run.lease import Lease
from stopgo.mission.run.run_commands import FREE_VERBS, Answer, RunCommand
from tests.bridge.conform.robot_under_test import RobotUnderTest, booted, failed, verdicts
from tests.bridge.guarded import keys_of_site

pytestmark = pytest.mark.usefixtures("own_time")

changed = msgspec.structs.replace


def test_our_own_robot_meets_every_requirement() -> None:
    found = verdicts(RobotUnderTest())
    assert failed(found) == {}
    assert {verdict.section for verdict in found if verdict.outcome == "not tried"} == {"Signatures"}


def test_our_own_robot_with_keys_meets_what_is_said_of_signatures(tmp_path: Path) -> None:
    robot = RobotUnderTest(keys_of_site(tmp_path / "site"))
    with booted(robot):
        signing = [one for one in REQUIREMENTS if one.section == "Signatures"]
        found = list(tried(signing, robot.bench()))
    assert {verdict.outcome for verdict in found} == {"passed"}, failed(found)


def test_without_drive_nothing_moves() -> None:
    robot = RobotUnderTest()
    stood = robot.base.pose()
    found = verdicts(robot, drive=False)
    assert robot.base.pose() == stood
    assert {type(event) for event in robot.journal.events()} == {TakenOver}
    driven = {one.text for one in REQUIREMENTS if one.drives}
    assert driven <= {verdict.text for verdict in found if verdict.outcome == "not tried"}


def test_what_lay_on_the_robot_lies_ready_again() -> None:
    robot = RobotUnderTest()
    with booted(robot):
        held = robot.bench().missions.store(robot.bench().missions.mission())
        found = list(robot_verdicts(robot.bench(), drive=False))
        state = robot.bench().info().state
    assert found[-1].text == "what lay there before lies ready again"
    assert (state.state, state.mission_id, state.revision) == ("READY", held.id, held.revision)


def test_a_mission_that_cannot_be_read_back_is_not_written_over() -> None:
    robot = RobotUnderTest()
    robot.agent = TellsNoParts
    with booted(robot):
        held = robot.bench().missions.store(robot.bench().missions.mission())
        with pytest.raises(InputError, match="the mission on r1 cannot be read, and would be lost"):
            next(robot_verdicts(robot.bench(), drive=False))
        assert robot.bench().info().state.revision == held.revision


def test_a_robot_on_a_run_or_in_others_hands_is_left_alone() -> None:
    robot = RobotUnderTest()
    with booted(robot):
        bench = robot.bench()
        bench.missions.store(bench.missions.mission())
        with pytest.raises(InputError, match="alice commands r1 for"):
            check_at_rest(bench.info(), "carol", take_over=False)
        check_at_rest(bench.info(), "carol", take_over=True)
        bench.commands.must_execute("start")
        with pytest.raises(InputError, match="r1 is RUNNING: a robot on a run is not tested"):
            check_at_rest(bench.info(), "alice", take_over=True)


WHATEVER_IT_NAMES = "a stop counts whatever run, mission or state it names"
RECORD_WHOLE = "every entry and pose once, and the same again"


# Robots that are broken


class ForgetsAnswers(Controller):
    def execute(self, order: RunCommand) -> Answer:
        fresh = f"{order.cmd_id}-{self._clock.now_ns()}"
        return changed(super().execute(changed(order, cmd_id=fresh)), cmd_id=order.cmd_id)


class AsksStopsForTheRun(Controller):
    def execute(self, order: RunCommand) -> Answer:
        if order.verb in FREE_VERBS and order.run_id not in (None, self.run.run_id):
            return Answer(
                cmd_id=order.cmd_id, verb=order.verb, outcome="refused", reason="wrong_run",
                message="", run_id=None, state=self.run.state,
            )  # fmt: skip
        return super().execute(order)


class IgnoresFences(Controller):
    def execute(self, order: RunCommand) -> Answer:
        return super().execute(changed(order, fence=None))


class NeverTooLate(Controller):
    def execute(self, order: RunCommand) -> Answer:
        now_ns = self._clock.now_ns()
        return super().execute(changed(order, issued_ns=now_ns, valid_for_s=5.0, boot_id=None))


class StopsForTheCommanderOnly(Controller):
    def execute(self, order: RunCommand) -> Answer:
        lease = self.lease
        if order.verb in FREE_VERBS and lease and lease.commander != order.commander:
            return Answer(
                cmd_id=order.cmd_id, verb=order.verb, outcome="refused", reason="not_the_commander",
                message="", run_id=None, state=self.run.state,
            )  # fmt: skip
        return super().execute(order)


class HeedsNobodysLease(Controller):
    def execute(self, order: RunCommand) -> Answer:
        return super().execute(changed(order, commander=self.lease.commander if self.lease else "a"))


class DrivesOnEveryStart(Controller):
    def execute(self, order: RunCommand) -> Answer:
        plain = {"issued_ns": self._clock.now_ns(), "expect_state": None, "revision": None, "fence": None}
        return super().execute(changed(order, **plain) if order.verb == "start" else order)


class DrivesWhatItIsSent(Controller):
    def take(self, commit: Any, mission: Mission) -> Rejected | None:
        rejected = super().take(commit, mission)
        now_ns = self._clock.now_ns()
        start = RunCommand(
            cmd_id=commit.nonce, verb="start", commander=commit.commander, issued_ns=now_ns, valid_for_s=5.0
        )
        self.execute(start)
        return rejected


class GoesOnByItself(Controller):
    def __init__(self, **parts: Any) -> None:
        super().__init__(**parts)
        if self.run.state == "PAUSED":
            self._store._run = changed(self.run, state="RUNNING")


class ReadsStrictly(Agent):
    def _command(self, request: Request) -> bytes:
        if b'"later":{' in request.payload:
            return encode({"is": "Malformed", "message": "unknown field `later`"})
        return super()._command(request)


class ReadsNothing(Agent):
    def _keep(self, request: Request) -> bytes:
        return self._info(request)


class LosesEvents(Agent):
    def _log(self, request: Request) -> bytes:
        page = decode(super()._log(request), LogPage)
        kept = tuple(body for body in page.bodies if b'"Settled"' not in bytes(body))
        return encode(changed(page, bodies=kept))


class TellsAllStops(Agent):
    def _state(self) -> StateReport:
        return changed(super()._state(), skipped=self._runner.snapshot()[0].skipped)


class SaysNothingOfItself(Agent):
    def _publish_news(self) -> None:
        self._closing.wait()


class TakesDamage(Inbox):
    def _received(self, manifest: Manifest) -> Mission | Rejected:
        document = b"".join(self._journal.missions.chunks(manifest))
        try:
            return self._read(document, manifest)
        except ValueError:
            return Rejected(reason="malformed", messages=())


class TakesOldRevisions(Inbox):
    def _outdated(self, mission_id: str, manifest: Manifest) -> Rejected | None:
        return None


class LosesPosesOfTheRecord(RunRecorder):
    def page(self, run_id: str, since: int | None = 0, *, robot_ns: int = 0) -> RecordPage:
        page = super().page(run_id, since, robot_ns=robot_ns)
        thinned = (changed(entry, poses=entry.poses[::2]) for entry in page.entries)
        return changed(page, entries=tuple(thinned))


class LosesEntriesOfTheRecord(RunRecorder):
    def page(self, run_id: str, since: int | None = 0, *, robot_ns: int = 0) -> RecordPage:
        page = super().page(run_id, since, robot_ns=robot_ns)
        return changed(page, entries=tuple(entry for entry in page.entries if entry.number != 2))


class TellsNoParts(Agent):
    def _mission_step(self, request: Request) -> Any:
        reply = super()._mission_step(request)
        return Rejected(reason="no_mission", messages=()) if isinstance(reply, MissionPart) else reply


class TellsNoEvents(Agent):
    def _log(self, request: Request) -> bytes:
        page = decode(super()._log(request), LogPage)
        nothing = tuple(msgspec.Raw(b'{"event": "Started"}') for _ in page.bodies)
        return encode(changed(page, bodies=nothing))


class RepeatsItsPoses(Agent):
    def _past_poses(self, request: Request) -> bytes:
        page = decode(super()._past_poses(changed_parameters(request, since="0")), PosePage)
        return encode(changed(page, poses=page.poses[:1] * POSE_PAGE))


class AnswersInBrackets(Agent):
    def _log(self, request: Request) -> bytes:
        return b'{"is": "LogPage", "events": [], "newest": 1, "later": ' + b"[" * 20_000


class KeepsNoPoses(RunRecorder):
    def page(self, run_id: str, since: int | None = 0, *, robot_ns: int = 0) -> RecordPage:
        page = super().page(run_id, since, robot_ns=robot_ns)
        return changed(page, entries=tuple(changed(entry, poses=()) for entry in page.entries))


class GivesNonsenseBack(Inbox):
    def receive(self, request: Request) -> Any:
        reply = super().receive(request)
        return changed(reply, data=reply.data[::-1]) if isinstance(reply, MissionPart) else reply


def changed_parameters(request: Request, **parameters: str) -> Request:
    return Request(request.key, request.payload, {**request.parameters, **parameters})


class WantsPiecesInOrder(Inbox):
    def _chunk(self, mission_id: str, number: int, request: Request) -> Any:
        manifest = self._journal.missions.transfer(mission_id)
        held = () if manifest is None else self._journal.missions.received_chunks(manifest)
        if number > len(held):
            return Rejected(reason="incomplete", messages=("in order, please",))
        return super()._chunk(mission_id, number, request)


@pytest.mark.parametrize(
    ("part", "broken", "requirement", "why"),
    [
        ("controller", ForgetsAnswers, "the same command again gets the stored answer", "another answer"),
        ("controller", ForgetsAnswers, "a start that comes again is carried out once", "another answer"),
        ("controller", IgnoresFences, "an older fence: `fenced`", "wrong_state, not as fenced"),
        ("controller", NeverTooLate, "commands too late, too long, of another boot: `expired`", "not as exp"),
        ("controller", StopsForTheCommanderOnly, "`pause` and `abort` need no lease", "not_the_commander"),
        ("controller", StopsForTheCommanderOnly, "anybody may pause; only the commander resumes", "refused"),
        ("controller", HeedsNobodysLease, "without the lease: `not_the_commander`", "wrong_state, not as"),
        (
            "controller",
            DrivesOnEveryStart,
            "a start late, fenced or meant otherwise does not drive",
            "had to",
        ),
        ("controller", DrivesWhatItIsSent, "chunks may come in any order", "did not become READY"),
        ("controller", GoesOnByItself, "nothing moves by itself after a restart: PAUSED", "it is RUNNING"),
        ("agent", ReadsStrictly, "fields that are not known are passed over", "to be passed over"),
        ("agent", ReadsNothing, "messages that are cut off are Malformed", "answered with Info"),
        ("agent", LosesEvents, "a run goes stop by stop to FINISHED", "reports ['Arrived', 'Scanned']"),
        ("agent", TellsAllStops, "110 stops are reported in a small state, without gaps", "a state "),
        ("agent", SaysNothingOfItself, "the state is published at least every second", "0 states came"),
        ("inbox", TakesDamage, "a damaged chunk is found at the commit: `digest`", "Rejected malformed"),
        ("controller", AsksStopsForTheRun, WHATEVER_IT_NAMES, "pause was refused: wrong_run"),
        ("inbox", TakesOldRevisions, "a revision before the stored one: `older_revision`", "with Ready"),
        ("recorder", LosesPosesOfTheRecord, RECORD_WHOLE, "poses are missing from the record"),
        ("recorder", LosesEntriesOfTheRecord, RECORD_WHOLE, "the entries are numbered [1, 3"),
        ("inbox", WantsPiecesInOrder, "chunks may come in any order", "Rejected incomplete"),
        ("agent", TellsNoEvents, "a run goes stop by stop to FINISHED", "an event cannot be read"),
        ("agent", RepeatsItsPoses, "the poses of a run are stored without gaps", "does not go on behind"),
        ("agent", AnswersInBrackets, "numbered from 1 without gaps", "an answer cannot be read"),
        ("recorder", KeepsNoPoses, RECORD_WHOLE, "the record has no pose"),
        ("inbox", GivesNonsenseBack, "what is stored comes back in parts", "what is stored cannot be read"),
    ],
)
def test_a_broken_robot_is_found_by_the_requirement_that_names_it(
    part: str, broken: type, requirement: str, why: str
) -> None:
    robot = RobotUnderTest()
    setattr(robot, part, broken)
    (found,) = verdicts_on(robot, requirement)
    assert found.outcome == "failed"
    assert why in found.reason
    assert robot.controllers[-1].run.state in OVER, "it goes on driving"


def verdicts_on(robot: RobotUnderTest, requirement: str) -> list[ConformVerdict]:
    with booted(robot):
        (one,) = [one for one in REQUIREMENTS if one.text == requirement]
        return list(tried([one], robot.bench(), drive=True))


class BelievesEverybody(KeySigning):
    def sign_answers(self, answer: Answering) -> SignedAnswering:
        signed = super().sign_answers(answer)
        own = self

        def answered(request: Request) -> tuple[bytes, bytes]:
            reply, attachment = signed(request)
            if b"untrusted" not in reply:
                return reply, attachment
            return answer(request), own.sign_publication(request.key, b"")

        return answered


class SignsNoStates(KeySigning):
    def sign_publication(self, key: str, payload: bytes) -> bytes:
        return b""


@pytest.mark.parametrize(
    ("broken", "requirement", "why"),
    [
        (BelievesEverybody, "a wrong signature: `untrusted`", "was answered with Info"),
        (BelievesEverybody, "a query without a signature: `untrusted`", "was answered with Info"),
        (SignsNoStates, "states are signed, numbered and fresh", "it is not signed"),
    ],
)
def test_a_robot_that_signs_or_judges_wrongly_is_found(
    broken: type[KeySigning], requirement: str, why: str, tmp_path: Path
) -> None:
    class Robot(RobotUnderTest):
        def signing(self, name: str, boot_id: str = "") -> MessageSigning:
            good = super().signing(name, boot_id)
            assert isinstance(good, KeySigning)
            return broken(good._held, boot_id=boot_id) if boot_id else good

    (found,) = verdicts_on(Robot(keys_of_site(tmp_path / "site")), requirement)
    assert found.outcome == "failed"
    assert why in found.reason


def test_a_robot_that_stops_answering_is_reported_as_gone_and_left_alone() -> None:
    robot = RobotUnderTest()
    with booted(robot):
        bench = robot.bench()
        robot.board.cut = True
        found = list(tried(REQUIREMENTS[:3], bench))
    assert [verdict.lost for verdict in found] == [True, False, False]
    assert [verdict.outcome for verdict in found] == ["failed", "not tried", "not tried"]
    assert "does not answer" in found[-1].reason


def test_every_requirement_stands_in_the_document() -> None:
    text = (Path(__file__).parents[3] / "docs/reference/protocol.md").read_text(encoding="utf-8")
    headings = {line.lstrip("# ") for line in text.splitlines() if line.startswith("##")}
    assert {one.section for one in REQUIREMENTS} <= headings
    texts = [one.text for one in REQUIREMENTS]
    assert len(texts) == len(set(texts))


def test_the_lease_of_the_one_who_tries_is_no_hindrance() -> None:
    robot = RobotUnderTest()
    with booted(robot):
        info = robot.bench().info()
    held = Lease(commander="alice", fence=1, until_ns=info.clock_ns + 10**9)
    check_at_rest(changed(info, lease=held), "alice", take_over=False)
