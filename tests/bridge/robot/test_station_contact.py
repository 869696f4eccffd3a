"""The contact that a robot counts against link loss: its commander's, and nobody else's."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import Watching, encode
from stopgo.bridge.robot.station_contact import MOST_TOKENS, TOKEN_S, StationContact
from stopgo.bridge.station.station import Station
from stopgo.mission.document import with_digest
from stopgo.mission.errors import NegativeResult
from tests.bridge.guarded import GuardedField, keys_of_site
from tests.bridge.world import Field, corridor

SILENCE_S = 40.0
TABLE = Path(__file__).parents[3] / "docs" / "reference" / "protocol.md"

Act = Callable[[Station], object]


def _watch(station: Station) -> object:
    """Watch as `stopgo watch` does: show a token, and name it."""
    station.link.announce(station.keys.watcher(station.commander))
    return station.keep(station.commander)


ACTS: dict[str, Act] = {
    "watches (`keep`)": _watch,
    "reads (`info`, `log`, `poses`)": lambda station: (station.info(), station.log()),
    "shows a token only": lambda station: station.link.announce(station.keys.watcher("only")),
    "sends a command": lambda station: station.give(station.stop_order("pause")),
}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return keys_of_site(tmp_path_factory.mktemp("keys") / "site")


def running(field: Field, station: Station) -> Field:
    """The robot runs a mission of this station, which has been silent since for `SILENCE_S`."""
    plain = corridor()
    policy = msgspec.structs.replace(plain.policy, link_loss="hold", link_loss_after_s=30.0)
    station.push(with_digest(msgspec.structs.replace(plain, policy=policy)))
    station.command("start")
    field.clock.wait(SILENCE_S)
    return field


def silence(field: Field) -> float:
    return field.agent._contact.silent_s(field.agent._commander())


def rows() -> list[tuple[str, str, str, str]]:
    """The rows of the table in protocol.md: who, what, counts with keys, and without."""
    section = TABLE.read_text().split("### Who keeps a run alive", 1)[1].split("\n#", 1)[0]
    cells = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in section.splitlines() if "|" in line
    ]
    return [(who, what, keyed, unkeyed) for who, what, keyed, unkeyed in cells[2:]]


def walked(column: int) -> list[tuple[str, str, str]]:
    """The cells of one column that say yes or no."""
    return [(row[0], row[1], row[column]) for row in rows() if row[column] != "–"]


NAMES = {"the commander": "alice", "another station": "bob", "a viewer": "vera",
         "another robot's keys": "r2"}  # fmt: skip


def act(station: Station, what: str) -> None:
    """Do it twice, for the first answer gives a station the robot's boot; refusals are no matter here."""
    for _ in range(2):
        with suppress(NegativeResult):
            ACTS[what](station)


@pytest.mark.parametrize(("who", "what", "counts"), walked(2))
def test_with_keys_a_message_counts_as_the_table_says(site: Path, who: str, what: str, counts: str) -> None:
    field = GuardedField(site)
    running(field, field.guarded_station())
    act(field.guarded_station(NAMES[who]), what)
    assert (silence(field) < SILENCE_S) == (counts == "yes")
    if counts == "no":
        assert silence(field) == pytest.approx(SILENCE_S)


@pytest.mark.parametrize(("who", "what", "counts"), walked(3))
def test_without_keys_a_message_counts_as_the_table_says(who: str, what: str, counts: str) -> None:
    field = Field()
    running(field, field.station(commander="alice"))
    act(field.station_at_the_link(NAMES[who]), what)
    assert (silence(field) < SILENCE_S) == (counts == "yes")


def test_the_table_has_every_sender_and_every_act() -> None:
    told = {(who, what) for who, what, _, _ in rows()}
    assert told == {(who, what) for who in NAMES for what in ACTS}


@pytest.mark.parametrize("who", ["vera", "bob", "r2"])
def test_a_robot_whose_commander_is_gone_holds_though_others_watch(site: Path, who: str) -> None:
    """The commander's link is cut during a run; another goes on watching every five seconds."""
    field = GuardedField(site)
    plain = corridor()
    policy = msgspec.structs.replace(plain.policy, link_loss="hold", link_loss_after_s=30.0)
    commander, other = field.guarded_station(), field.guarded_station(who)
    commander.push(with_digest(msgspec.structs.replace(plain, policy=policy)))
    commander.command("start")
    other.link.announce(other.keys.watcher("t"))
    for _ in range(9):
        other.keep("t")
        field.clock.wait(5.0)
        field.controller.on_link_silence(silence(field))
    assert field.controller.run.state == "HELD"
    assert "no data from a station" in str(field.controller.run.reason)


def test_a_commander_who_watches_is_in_contact_between_two_questions_and_not_after_its_token(
    site: Path,
) -> None:
    field = GuardedField(site)
    station = field.guarded_station()
    running(field, station)
    _watch(station)
    field.clock.wait(TOKEN_S - 1.0)
    assert silence(field) == 0.0
    station.link.close()
    field.clock.wait(7.0)
    assert silence(field) == pytest.approx(7.0)


def test_a_token_counts_no_longer_than_its_time_though_nobody_reports_its_end(site: Path) -> None:
    field = GuardedField(site)
    station = field.guarded_station()
    running(field, station)
    _watch(station)
    field.clock.wait(TOKEN_S + 20.0)
    assert silence(field) == pytest.approx(20.0)


def test_whoever_takes_over_is_in_contact_and_the_former_commander_is_not(site: Path) -> None:
    field = GuardedField(site)
    alice, bob = field.guarded_station(), field.guarded_station("bob")
    running(field, alice)
    _watch(alice)
    field.clock.wait(1.0)
    bob.command("skip", take_over=True)
    assert silence(field) == 0.0
    for _ in range(6):
        field.clock.wait(5.0)
        alice.keep(alice.commander)
    assert silence(field) == pytest.approx(30.0)


def test_a_question_that_was_recorded_and_sent_again_is_no_contact(site: Path) -> None:
    field = GuardedField(site)
    station = field.guarded_station()
    running(field, station)
    _watch(station)
    old = [
        packet for packet in field.router.seen if packet.kind == "question" and packet.key.endswith("/keep")
    ]
    station.link.close()
    field.clock.wait(60.0)
    for packet in old:
        field.board.answers(packet)
    assert silence(field) == pytest.approx(60.0)


def test_the_tokens_that_are_kept_are_bounded() -> None:
    contact = StationContact(SimulatedClock())
    for number in range(1000):
        contact.on_presence(f"stranger{number}", True)
        contact.on_request(Request("k", encode(Watching(commander="a"))), "a", sender="a", token=f"t{number}")
    assert len(contact._asked_ns) == MOST_TOKENS
