"""Effect of every command in every state: one table, walked whole; docs/reference/protocol.md prints it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mission.run.command_table import PLACES, VERBS, effect, table_text

PROTOCOL = Path(__file__).parents[3] / "docs" / "reference" / "protocol.md"

EFFECTS = {
    "start": {"READY": "RUNNING", "FINISHED": "RUNNING with `again`", "ABORTED": "RUNNING with `again`"},
    "pause": {"RUNNING": "PAUSED", "HOMING": "PAUSED homing"},
    "resume": {"PAUSED": "RUNNING", "PAUSED homing": "HOMING"},
    "skip": {"RUNNING": "RUNNING", "PAUSED": "PAUSED", "HELD": "RUNNING"},
    "retry": {"HELD": "RUNNING", "HELD homing": "HOMING"},
    "home": dict.fromkeys(("RUNNING", "PAUSED", "HELD", "PAUSED homing", "HELD homing"), "HOMING"),
    "abort": dict.fromkeys(
        ("RUNNING", "PAUSED", "HELD", "HOMING", "PAUSED homing", "HELD homing"), "ABORTED"
    ),
}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("place", PLACES)
def test_every_command_does_in_every_state_what_the_table_says(verb: str, place: str) -> None:
    refused = "no_mission" if place == "IDLE" else "wrong_state"
    assert effect(verb, place) == EFFECTS[verb].get(place, refused)


def test_the_protocol_prints_this_table() -> None:
    assert table_text() in PROTOCOL.read_text(encoding="utf-8")
