"""Whoever sees to a robot reads in its log what was refused, to whom, and why; and the log stays short."""

from __future__ import annotations

from datetime import datetime, timedelta

from stopgo.bridge.link.keys import now_utc
from stopgo.bridge.robot.agent import Agent
from stopgo.bridge.robot.refusal_log import RefusalLog
from stopgo.mission.errors import NegativeResult
from tests.bridge.world import Field, corridor


def test_a_refused_order_is_told_with_who_and_why() -> None:
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


def test_the_same_refusal_is_told_once_a_minute() -> None:
    said, now = list[str](), [datetime(2026, 5, 1, 8, 0, 0)]
    log = RefusalLog(said.append, lambda: now[0])
    for _ in range(120):
        log.note("pause", "bob", "why")
        now[0] += timedelta(seconds=1)
    assert said == [
        "2026-05-01 08:00:00 UTC refused pause by bob: why",
        "2026-05-01 08:01:00 UTC refused pause by bob: why (59 times more since 08:00:00)",
    ]
