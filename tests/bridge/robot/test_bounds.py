"""Whatever strangers send, on every key, no table, log or memory of the robot grows beyond its bound."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from stopgo.bridge.link.protocol import Commit, Manifest, Watching, encode
from stopgo.bridge.robot.answers import remember_answer
from stopgo.bridge.robot.command_execution import STOPS_KEPT
from stopgo.bridge.robot.pages import POSES_KEPT
from stopgo.bridge.robot.station_contact import MOST_TOKENS
from stopgo.mission.run.run_commands import Answer
from tests.bridge.world import Field, corridor
from tests.faults.sizes import size

ROUNDS = size(short=160, full=400)
LONGEST = "é" * 190
ANSWER_BYTES = 4000


def flood(field: Field, manifest: Manifest, number: int) -> Iterator[tuple[str, bytes, dict[str, str]]]:
    """One message on each key, with words that no message had before."""
    keys, who = field.keys, f"{number}-{LONGEST}"
    other = msgspec.structs.replace(manifest, mission_id=who, digest=who)
    for key in (keys.info, keys.boot, keys.log, keys.poses, keys.record):
        yield key, who.encode(), {"since": f"{number}", "run": who, who: who}
    yield keys.keep, encode(Watching(commander=who, token=who)), {}
    yield keys.mission(who, "begin"), encode(other), {}
    yield keys.mission(who, f"chunk/{number}"), who.encode(), {"of": who}
    yield keys.mission(who, f"part/{number}"), b"", {"revision": f"{number}"}
    commit = Commit(manifest=other, commander=who, nonce=who, not_after_ns=2**60)
    yield keys.mission(who, "commit"), encode(commit), {}
    for verb in ("start", "pause", "resume", "skip", "retry", "home", "abort"):
        order = field.command(verb, commander=who, run_id=who, mission_id=who, stop=who)  # type: ignore[arg-type]
        yield keys.command(verb), encode(order), {}


def sizes(field: Field) -> dict[str, int]:
    rows = field.journal.rows
    tables = ("facts", "events", "nonces", "missions", "transfers", "chunks")
    return {table: rows.select(f"SELECT COUNT(*) FROM {table}")[0][0] for table in tables}


def test_a_flood_on_every_key_grows_nothing_but_what_is_bounded() -> None:
    field = Field()
    field.station().push(corridor())
    link, before, half = field.board.link(), sizes(field), {}
    manifest = field.journal.missions.newest_manifest(corridor().id)
    assert manifest is not None
    for number in range(ROUNDS):
        for key, payload, parameters in flood(field, manifest, number):
            link.ask(key, payload, timeout_s=0.1, parameters=parameters)
        if number == ROUNDS // 2:
            half = sizes(field)
    assert sizes(field) == half
    assert half == before | {"transfers": 1}
    assert len(field.agent._contact._asked_ns) <= MOST_TOKENS
    assert len(field.controller._commands._stops) <= STOPS_KEPT
    assert field.agent._poses._reports.maxlen == POSES_KEPT
    (longest,) = field.journal.rows.select("SELECT MAX(LENGTH(body)) FROM answers")[0]
    assert longest <= ANSWER_BYTES


def test_old_answers_are_dropped() -> None:
    field = Field()
    for number in range(30):
        order = field.command("skip")
        answer = Answer(
            cmd_id=order.cmd_id, verb="skip", outcome="refused", reason="no_mission", message=f"{number}",
            run_id=None, state="IDLE",
        )  # fmt: skip
        with field.journal.transaction():
            remember_answer(field.journal, order, answer, keep=10)
    assert field.journal.rows.select("SELECT COUNT(*) FROM answers")[0][0] <= 11
