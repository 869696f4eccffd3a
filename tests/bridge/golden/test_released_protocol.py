"""Today's robot and station work with those of the last released protocol, and with new fields."""

from __future__ import annotations

import json
from typing import Any

import msgspec
import pytest

from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions, decode
from stopgo.bridge.station.station import Station
from stopgo.mission.document import Mission, digest_of
from stopgo.mission.errors import NegativeResult
from stopgo.mission.run.events import PoseReport, StateReport, UnknownKind, event_of
from stopgo.mission.run.run_commands import Verb
from tests.bridge.golden.recorded_peer import (
    Change,
    RecordedRobot,
    RecordedStation,
    as_recorded,
    changed,
    traffic,
    with_new_fields,
)
from tests.bridge.world import Field

VERSION = "0_1"
CHANGES = [as_recorded, with_new_fields]
SAME = ("is", "verb", "outcome", "reason", "state", "done", "skipped", "commander", "mission_id", "revision")
"""Fields whose values a robot of any version gives alike."""


def sent_mission() -> Mission:
    """The mission of the recording, as the older station has sent it."""
    chunk = next(line for line in traffic(VERSION) if "/chunk/" in line.get("key", ""))
    return msgspec.json.decode(chunk["request"], type=Mission)


def lacks(then: Any, now: Any, where: str = "") -> list[str]:
    """Fields of an older answer that are missing today, or have another type or meaning."""
    if isinstance(then, dict) and isinstance(now, dict):
        missing = [f"{where}{name}" for name in then if name not in now]
        both = [name for name in then if name in now]
        return missing + [found for name in both for found in lacks(then[name], now[name], f"{where}{name}.")]
    name = where.split(".")[-2] if where else ""
    other = name in SAME and then != now
    return [where] if other or (None not in (then, now) and type(then) is not type(now)) else []


@pytest.mark.parametrize("change", CHANGES)
def test_todays_robot_serves_a_station_of_the_released_protocol(change: Change) -> None:
    field = Field()
    field.serve()
    answers = RecordedStation(VERSION, field, change).play()
    assert [(key, found) for key, then, now in answers if (found := lacks(then, now))] == []
    assert len(answers) > 20
    assert (field.controller.run.state, field.controller.run.done) == ("FINISHED", ("s1", "s2"))


@pytest.mark.parametrize("change", CHANGES)
def test_todays_station_commands_a_robot_of_the_released_protocol(change: Change) -> None:
    board, keys, mission = Switchboard(), KeyExpressions("r1"), sent_mission()
    board.link().serve(f"{keys.root}/**", RecordedRobot(VERSION, change).answer)
    station = Station(board.link(), keys, commander="test", timeout_s=1.0)
    assert station.push(mission).revision == 1
    verbs: tuple[Verb, ...] = ("start", "pause", "resume", "pause")
    states = [station.command(verb).state for verb in verbs]
    assert states == ["RUNNING", "PAUSED", "RUNNING", "PAUSED"]
    assert station.mission(mission.id, 1) == mission
    assert [type(event).__name__ for event in station.log()][::12] == ["Started", "Finished"]
    refused: tuple[Verb, ...] = ("skip", "abort")
    for verb in refused:
        with pytest.raises(NegativeResult, match="wrong_state"):
            station.command(verb)


@pytest.mark.parametrize("change", CHANGES)
def test_what_a_robot_of_the_released_protocol_publishes_is_read(change: Change) -> None:
    seen = set()
    for line in traffic(VERSION):
        if "published" not in line:
            continue
        raw, kind = changed(line["published"], change), line["key"].rpartition("/")[2]
        if kind == "event":
            assert not isinstance(event_of(raw), UnknownKind)
        else:
            decode(raw, {"state": StateReport, "pose": PoseReport}[kind])
        seen.add(kind)
    assert seen == {"state", "pose", "event"}


def test_a_mission_of_the_released_version_has_its_digest_still() -> None:
    mission = sent_mission()
    assert digest_of(mission) == mission.digest == json.loads(traffic(VERSION)[0]["request"])["digest"]


class ReleasedState(msgspec.Struct, kw_only=True):
    """The fields of a state that a station of 0.1 cannot do without, and their types there."""

    robot: str
    boot_id: str
    seq: int
    robot_ns: int
    state: str
    done: tuple[str, ...]
    skipped: tuple[str, ...]
    battery: float
    last_event: int


def test_a_station_of_the_released_protocol_reads_the_state_of_a_robot_that_knows_no_charge(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    field = Field()
    monkeypatch.setattr(field.base, "battery", lambda: None)
    sent = msgspec.json.encode(field.report())
    assert msgspec.json.decode(sent, type=ReleasedState).battery == -1.0
    assert decode(sent, StateReport).charge is None
