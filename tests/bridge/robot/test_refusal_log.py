"""Whoever sees to a robot reads in its log what was refused, to whom, and why; and the log stays short."""

from __future__ import annotations

from datetime import datetime, timedelta

import msgspec

from stopgo.bridge.link.keys import now_utc
from stopgo.bridge.link.protocol import Commit, Watching, encode
from stopgo.bridge.robot.agent import Agent
from stopgo.bridge.robot.refusal_log import LINE_BYTES, LINES_A_MINUTE, RefusalLog
from stopgo.mission.errors import NegativeResult
from tests.bridge.world import Field, corridor
from tests.faults.sizes import size


def test_a_refused_command_is_reported_with_who_and_why() -> None:
    field, said = Field(), list[str]()
    field.station().push(corridor())
    field.link.close()
    Agent(
        keys=field.keys, link=field.link, journal=field.journal, runner=field.controller, clock=field.clock,
        command_clock=field.clock, refusals=RefusalLog(said.append, now_utc),
    ).serve()  # fmt: skip
    station = field.station_at_the_link("bob")
    for verb in ("resume", "start"):
        try:
            station.command(verb)
        except NegativeResult:
            continue
    assert "refused resume by bob: not_the_commander: test commands it" in said[0]
    assert "refused start by bob: not_the_commander" in said[1]


def test_the_same_refusal_is_reported_once_a_minute() -> None:
    said, now = list[str](), [datetime(2026, 5, 1, 8, 0, 0)]
    log = RefusalLog(said.append, lambda: now[0])
    for _ in range(120):
        log.note("pause", "bob", "why")
        now[0] += timedelta(seconds=1)
    assert said == [
        "2026-05-01 08:00:00 UTC refused pause by bob: why",
        "2026-05-01 08:01:00 UTC refused pause by bob: why (59 times more since 08:00:00)",
    ]


def test_a_flood_of_changing_texts_on_every_key_stays_within_the_bound() -> None:
    """Hours of messages every second, each with other words, on each key that refuses."""
    field, said, now = Field(), list[str](), [datetime(2026, 5, 1, 8, 0, 0)]
    field.station().push(corridor())
    log = RefusalLog(said.append, lambda: now[0])
    field.link.close()
    Agent(
        keys=field.keys, link=field.link, journal=field.journal, runner=field.controller, clock=field.clock,
        command_clock=field.clock, refusals=log, inbox=field.inbox,
    ).serve()  # fmt: skip
    link, keys = field.board.link(), field.keys
    manifest = field.journal.missions.newest_manifest(corridor().id)
    assert manifest is not None
    rounds = size(short=600, full=2000)
    for number in range(rounds):
        who = f"{number}-" + "é" * 190
        changing = msgspec.structs.replace(manifest, revision=number + 2, digest=f"{number}")
        for key, message in (
            (keys.command("resume"), field.command("resume", commander=who, mission_id=f"m{number}")),
            (keys.command("skip"), field.command("skip", commander=who, fence=0)),
            (keys.mission(corridor().id, "commit"), Commit(
                manifest=changing, commander=who, nonce=f"n{number}", not_after_ns=2**60)),
            (keys.mission(corridor().id, "begin"), changing),
            (keys.keep, Watching(commander=who)),
        ):  # fmt: skip
            link.ask(key, encode(message), timeout_s=0.1)
        now[0] += timedelta(seconds=1)
    minutes = rounds / 60 + 1
    assert len(said) <= minutes * (LINES_A_MINUTE + 1)
    assert max(len(line.encode()) for line in said) <= LINE_BYTES + 80
    assert log.remembered <= 3 * LINES_A_MINUTE
    assert any("further lines since" in line for line in said)
    now[0] += timedelta(minutes=2)
    log.note("pause", "bob", "why")
    assert said[-1].endswith("refused pause by bob: why")


def test_a_date_that_is_set_back_does_not_silence_the_log() -> None:
    said, now = list[str](), [datetime(2026, 5, 1, 8, 0, 0)]
    log = RefusalLog(said.append, lambda: now[0])
    log.note("pause", "bob", "why")
    now[0] -= timedelta(days=1)
    log.note("pause", "bob", "why")
    assert len(said) == 2
