"""Nobody between station and robot is believed: not one who changes, swaps, replays, delays or poses."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.link.memory_link import SignedMessage
from stopgo.bridge.link.signatures import OLDEST_S, SignatureAttachment
from stopgo.mission.errors import NegativeResult, OutcomeUnknown, RobotUnreachable
from tests.bridge.guarded import GuardedField, keys_of_site
from tests.bridge.world import corridor


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return keys_of_site(tmp_path_factory.mktemp("keys") / "site")


def ready(site: Path) -> GuardedField:
    """A robot with keys that holds a mission."""
    field = GuardedField(site)
    field.guarded_station().push(corridor())
    return field


def test_a_station_with_keys_runs_a_mission(site: Path) -> None:
    field = ready(site)
    assert field.guarded_station().command("start").state == "RUNNING"
    field.work()
    assert field.guarded_station("vera").status().state == "FINISHED"


@pytest.mark.parametrize("liar", ["r2", "vera", "alice"])
def test_who_is_not_the_robot_cannot_answer_for_it(site: Path, liar: str) -> None:
    """An impostor serves r1's keys: nothing is believed, and nothing follows from it."""
    field = GuardedField(site)
    field.answer_as(liar)
    station = field.guarded_station()
    with pytest.raises(OutcomeUnknown, match=rf"signed by \w+ {liar}, not by robot r1"):
        station.status()
    with pytest.raises(OutcomeUnknown, match="no answer to push"):
        station.push(corridor())
    with pytest.raises(RobotUnreachable, match="start was not sent"):
        station.command("start")


def test_an_answer_that_was_changed_or_meant_for_another_question_is_not_believed(site: Path) -> None:
    field = ready(site)
    station = field.guarded_station()
    first = station.info()
    old = next(packet for packet in field.router.seen if packet.kind == "answer")

    def shifted(packet: SignedMessage) -> Iterable[SignedMessage]:
        if packet.kind != "answer":
            return (packet,)
        told = json.loads(packet.payload)
        told["clock_ns"] += 40 * 10**9
        return (replace(packet, payload=json.dumps(told).encode()),)

    for meddle, why in (
        (shifted, "signature is not right"),
        (lambda packet: (packet,) if packet.kind == "question" else (old,), "signature|another question"),
        (lambda packet: (replace(packet, attachment=b""),), "not signed"),
        (lambda packet: (replace(packet, attachment=b"\xff"),), "cannot be read"),
        (lambda packet: (replace(packet, attachment=b'{"later": ' + b"[" * 20_000),), "cannot be read"),
    ):
        field.router.meddle = meddle  # type: ignore[assignment]
        with pytest.raises(OutcomeUnknown, match=why):
            station.info()
    field.router.meddle = lambda packet: (packet,)
    assert station.info().boot_id == first.boot_id


def test_a_question_is_bound_to_its_parameters_and_its_robot(site: Path) -> None:
    field = ready(site)

    def elsewhere(packet: SignedMessage) -> Iterable[SignedMessage]:
        if packet.kind == "question" and packet.parameters:
            return (replace(packet, parameters={"since": "7"}),)
        return (packet,)

    field.router.meddle = elsewhere
    assert field.guarded_station().status().state == "READY"
    with pytest.raises(OutcomeUnknown, match="signature is not right"):
        field.guarded_station().mission(corridor().id, 1)


def told(field: GuardedField, key: str, number: int) -> list[bytes]:
    """States that a station receives, of so many that the robot reports, a second apart."""
    station = field.guarded_station()
    heard: list[bytes] = []
    station.link.hear(key, lambda key, payload: heard.append(payload))
    station.info()
    tell = field.link.publisher(key)
    for at in range(number):
        tell(f"state {at}".encode())
        field.clock.wait(1.0)
    return heard


def test_what_a_robot_reports_is_received_once_and_in_order(site: Path) -> None:
    field = ready(site)
    assert told(field, field.keys.state, 3) == [b"state 0", b"state 1", b"state 2"]
    kept: list[SignedMessage] = []

    def twice(packet: SignedMessage) -> Iterable[SignedMessage]:
        kept.append(packet)
        return (packet, packet, *kept) if packet.kind == "told" else (packet,)

    field.router.meddle = twice
    assert told(field, field.keys.state, 3) == [b"state 0", b"state 1", b"state 2"]


def test_what_a_robot_reported_long_ago_or_before_its_reboot_is_not_accepted(site: Path) -> None:
    field = ready(site)
    station = field.guarded_station()
    heard: list[bytes] = []
    station.link.hear(field.keys.state, lambda key, payload: heard.append(payload))
    held: list[SignedMessage] = []
    station.info()
    tell = field.link.publisher(field.keys.state)
    tell(b"now")
    field.router.meddle = lambda packet: held.append(packet) or ()  # type: ignore[func-returns-value]
    tell(b"held up")
    field.router.meddle = lambda packet: (packet,)
    field.clock.wait(OLDEST_S + 1)
    field.board.tell(held[0])
    assert heard == [b"now"]
    assert "older than" in station.link.distrusted
    field.boot()
    field.answer_as("r1")
    field.link.publisher(field.keys.state)(b"before anybody asked")
    assert heard == [b"now"]
    station.info()
    field.link.publisher(field.keys.state)(b"anew")
    assert heard == [b"now", b"anew"]


def test_an_impostor_is_ignored(site: Path) -> None:
    field = ready(site)
    station = field.guarded_station()
    heard: list[bytes] = []
    station.link.hear(field.keys.state, lambda key, payload: heard.append(payload))
    station.info()
    impostor = field.board.link(field.signing("r2", boot_id=field.controller.boot_id))
    impostor.publisher(field.keys.state)(b"FINISHED")
    assert heard == []


def test_fields_of_an_attachment_that_are_not_known_are_passed_over(site: Path) -> None:
    field = ready(site)

    def newer(packet: SignedMessage) -> Iterable[SignedMessage]:
        return (
            replace(packet, attachment=json.dumps(json.loads(packet.attachment) | {"later": 1}).encode()),
        )

    field.router.meddle = newer
    assert field.guarded_station().status().state == "READY"


def test_viewers_send_no_mission(site: Path) -> None:
    """Neither its beginning nor its pieces, which would break another's transfer."""
    field = ready(site)
    viewer = field.guarded_station("vera")
    viewer.held = None
    with pytest.raises(NegativeResult, match="vera is a viewer"):
        viewer.push(corridor(revision=2))
    assert field.journal.missions.transfer(corridor().id) is None


def test_a_robot_hears_only_stations_and_only_at_once(site: Path) -> None:
    """As the tunnel's end does, which takes raw frames to the vehicle."""
    field = ready(site)
    up, hello = field.keys.mavlink("up"), field.keys.mavlink("hello")
    heard: list[bytes] = []
    field.link.serve(hello, lambda request: b"{}")
    field.link.hear(up, lambda key, payload: heard.append(payload))
    alice, vera = field.guarded_station("alice").link, field.guarded_station("vera").link
    alice.publisher(up)(b"before it has greeted")
    for link in (alice, vera):
        link.ask(hello, timeout_s=1)
        link.publisher(up)(b"arm")
    assert heard == [b"arm"]
    late = field.router.seen[-1]
    again = next(packet for packet in field.router.seen if packet.payload == b"arm")
    field.board.tell(again)
    field.clock.wait(OLDEST_S + 2)
    alice.publisher(up)(b"alive")
    field.board.tell(late)
    assert heard == [b"arm", b"alive"]


def test_an_attachment_is_small() -> None:
    """In addition to a pose of some 250 bytes, fifty times a second."""
    attachment = SignatureAttachment(signature=b"x" * 64, boot_id="0123456789ab", number=10**6, at_ns=10**15)
    assert len(msgspec.json.encode(attachment)) < 200


def held_back(field: GuardedField) -> list[SignedMessage]:
    """From now on every order is withheld, and kept."""
    kept: list[SignedMessage] = []

    def withhold(packet: SignedMessage) -> Iterable[SignedMessage]:
        if "/cmd/" in packet.key:
            kept.append(packet)
            return ()
        return (packet,)

    field.router.meddle = withhold
    return kept


@pytest.mark.parametrize("later_s", [0.6, 41.0])
def test_a_command_that_a_station_has_given_up_is_never_carried_out(site: Path, later_s: float) -> None:
    """Not a moment later, not after a reboot, and whatever the date is then."""
    field = ready(site)
    kept = held_back(field)
    with pytest.raises(OutcomeUnknown, match="has no effect later"):
        field.guarded_station().command("start")
    field.router.meddle = lambda packet: (packet,)
    field.clock.wait(later_s)
    assert b'"expired"' in field.board.answers(kept[0])[0].payload
    field.clock.jump(-later_s)
    field.boot()
    field.answer_as("r1")
    assert b'"expired"' in field.board.answers(kept[1])[0].payload
    assert field.controller.run.state == "READY"


def test_a_commit_that_was_held_back_over_a_reboot_is_never_taken(site: Path) -> None:
    field = ready(site)
    kept: list[SignedMessage] = []

    def withhold(packet: SignedMessage) -> Iterable[SignedMessage]:
        if packet.key.endswith("/commit"):
            kept.append(packet)
            return ()
        return (packet,)

    field.router.meddle = withhold
    with pytest.raises(OutcomeUnknown):
        field.guarded_station().push(corridor(revision=2))
    field.router.meddle = lambda packet: (packet,)
    field.boot()
    field.answer_as("r1")
    assert b'"expired"' in field.board.answers(kept[0])[0].payload
    assert field.controller.run.revision == 1


@pytest.mark.parametrize("attachment", [{"nonce": "a\nb"}, {"nonce": "a", "boot_id": "a\nb"}])
def test_an_attachment_with_a_line_break_is_refused_and_the_refusal_is_signed(
    site: Path, attachment: dict[str, str]
) -> None:
    field = ready(site)
    forged = msgspec.json.encode({"signature": "", **attachment})
    question = SignedMessage("question", field.keys.info, b"", forged)
    (answer,) = field.board.answers(question)
    assert b"has several lines" in answer.payload
    assert answer.attachment


def test_parameters_with_a_line_break_are_not_answered(site: Path) -> None:
    field = ready(site)
    question = SignedMessage("question", field.keys.log, b"", b"{}", {"since": "0\n1"})
    assert field.board.answers(question) == []
