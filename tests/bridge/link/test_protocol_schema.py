"""The shipped JSON Schema of the messages is the one the code gives, and says what the readers do."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec
import pytest
from jsonschema import Draft202012Validator

from stopgo.bridge.link.protocol import Malformed, Reply, Tagged, decode, encode
from stopgo.bridge.link.signatures import SignatureAttachment
from stopgo.mission.errors import NegativeResult
from stopgo.mission.run.events import KINDS, AnyEvent, Pose, PoseReport, StateReport, UnknownKind, event_of
from stopgo.mission.run.run_commands import Answer, RunCommand
from tests.bridge.guarded import GuardedField, keys_of_site
from tests.bridge.link.protocol_schema import protocol_schema
from tests.bridge.world import corridor

SHIPPED = files("stopgo.bridge.link").joinpath("protocol.schema.json").read_bytes()
SCHEMA: dict[str, Any] = json.loads(SHIPPED)
MESSAGES = [str(message.__struct_config__.tag) for message in (*Tagged.__subclasses__(), RunCommand, Answer)]

CUT = b"{"
POSE = PoseReport(
    robot="r1", boot_id="b", seq=1, robot_ns=1, run_id=None, mission_time_s=None,
    pose=Pose(x=1.0, y=0.0, heading=0.0), speed=0.5,
)  # fmt: skip


def valid(name: str, message: object) -> bool:
    schema = {"$defs": SCHEMA["$defs"], "$ref": f"#/$defs/{name}"}
    return bool(Draft202012Validator(schema).is_valid(message))


def test_the_shipped_schema_is_the_generated_one() -> None:
    assert protocol_schema() == SHIPPED, (
        "python -m tests.bridge.link.protocol_schema > bridge/link/protocol.schema.json"
    )


def test_the_schema_is_a_schema_and_defines_every_message() -> None:
    Draft202012Validator.check_schema(SCHEMA)
    assert {*MESSAGES, *KINDS, "Event", "StateReport", "PoseReport", "Seal"} <= set(SCHEMA["$defs"])
    assert not {"RunCommand", "Tagged"} & set(SCHEMA["$defs"])


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, Any]]:
    """Every message that went over the link in a run of three stops, and by what name the schema has it."""
    field = GuardedField(keys_of_site(tmp_path_factory.mktemp("keys") / "site"))
    station = field.guarded_station()
    station.push(corridor())
    station.mission(corridor().id, 1)
    station.command("start")
    with pytest.raises(NegativeResult):
        station.push(corridor(stops=2))
    field.work()
    for key, report in ((field.keys.state, field.report()), (field.keys.pose, POSE), *events(field)):
        field.link.publisher(key)(encode(report))
    link = field.board.link(field.signing("alice"))
    for key, payload in ((field.keys.boot, b""), (field.keys.poses, b""), (field.keys.command("start"), CUT)):
        assert link.ask(key, payload, timeout_s=1.0)
    seen = [packet for packet in field.router.seen if packet.payload and packet.payload != CUT]
    bodies = [packet for packet in seen if packet.kind != "question" or "/chunk/" not in packet.key]
    told = [(_name(packet.key, body), body) for packet in bodies for body in (json.loads(packet.payload),)]
    return [*told, *(("Seal", json.loads(packet.attachment)) for packet in seen)]


def events(field: GuardedField) -> Iterator[tuple[str, AnyEvent]]:
    return ((field.keys.event, event) for event in field.guarded_station().log())


def _name(key: str, body: dict[str, Any]) -> str:
    reports = {"state": "StateReport", "pose": "PoseReport", "event": "Event"}
    return str(body.get("is") or reports[key.rpartition("/")[2]])


def test_everything_that_is_said_in_a_run_is_valid(said: list[tuple[str, Any]]) -> None:
    assert [(name, body) for name, body in said if not valid(name, body)] == []
    names = {name for name, _ in said}
    assert {"Info", "Command", "Answer", "Commit", "Manifest", "LogPage", "Event", "StateReport"} <= names
    assert {"Ready", "ChunkHeld", "Accepted", "Rejected", "MissionPart", "Malformed", "Seal"} <= names
    assert {"Booted", "PosePage", "PoseReport"} <= names


def test_what_a_newer_peer_adds_is_valid_and_is_read(said: list[tuple[str, Any]]) -> None:
    """One more field in every object, however deep."""
    for name, body in one_of_each(said):
        more = widened(body)
        assert more != body
        assert valid(name, more), name
        readers = {
            "StateReport": StateReport,
            "PoseReport": PoseReport,
            "Seal": SignatureAttachment,
            "Command": RunCommand,
        }
        if name == "Event":
            event_of(json.dumps(more).encode())
        elif name in readers:
            decode(json.dumps(more).encode(), readers[name])
        else:
            kind = next(kind for kind in (*Tagged.__subclasses__(), Answer) if kind.__name__ == name)
            decode(json.dumps(more).encode(), kind)


def test_what_lacks_a_field_it_must_have_is_not_valid(said: list[tuple[str, Any]]) -> None:
    for name, body in one_of_each(said):
        for needed in SCHEMA["$defs"][name].get("required", ()):
            assert not valid(name, {key: value for key, value in body.items() if key != needed})


def test_an_event_of_a_kind_that_is_not_known_is_valid_but_not_a_known_one_that_is_wrong(
    said: list[tuple[str, Any]],
) -> None:
    event = next(body for name, body in said if name == "Event" and body["event"] == "Arrived")
    unknown = {**event, "event": "Recharged"}
    assert valid("Event", event) and valid("Event", unknown)
    assert isinstance(event_of(json.dumps(unknown).encode()), UnknownKind)
    wrong = {**event, "deviation_m": "far"}
    assert not valid("Event", wrong)
    with pytest.raises(msgspec.ValidationError):
        event_of(json.dumps(wrong).encode())


def test_an_answer_of_no_known_name_is_none() -> None:
    assert not valid("Malformed", {"is": "Broken", "message": "m"})
    with pytest.raises(msgspec.ValidationError):
        decode(b'{"is": "Broken", "message": "m"}', Reply)  # type: ignore[arg-type]
    assert decode(b'{"is": "Malformed", "message": "m"}', Malformed).message == "m"


def test_the_document_names_the_schema() -> None:
    page = Path(__file__).parents[3] / "docs" / "reference" / "protocol.md"
    assert "bridge/link/protocol.schema.json" in page.read_text(encoding="utf-8")


def one_of_each(said: list[tuple[str, Any]]) -> list[tuple[str, Any]]:
    return list(dict(said).items())


def widened(value: Any) -> Any:
    if isinstance(value, dict):
        return {**{key: widened(item) for key, item in value.items()}, "of_a_newer_peer": {"x": 1}}
    if isinstance(value, list):
        return [widened(item) for item in value]
    return value
