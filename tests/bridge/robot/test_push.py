"""A mission arrives on the robot whole or not at all."""

from __future__ import annotations

import gc
import hashlib
import threading
import weakref

import msgspec
import pytest

from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import (
    CHUNK_BYTES,
    Accepted,
    Malformed,
    Manifest,
    Ready,
    Rejected,
    decode,
    encode,
)
from stopgo.bridge.robot.mission_reading import read_mission
from stopgo.mission.document import Mission, canonical, with_digest
from stopgo.mission.errors import NegativeResult, OutcomeUnknown
from stopgo.mission.files.mission_json import parse
from tests.bridge.world import Field, corridor

LAST_NET_S = 60.0


def manifest_of(mission: Mission, document: bytes) -> Manifest:
    return Manifest(
        mission_id=mission.id, revision=mission.revision, digest=mission.digest, size=len(document),
        sha256=hashlib.sha256(document).hexdigest(), chunk_bytes=CHUNK_BYTES,
    )  # fmt: skip


def asked(field: Field, mission: Mission, step: str, payload: bytes, **parameters: str) -> object:
    return field.inbox.receive(Request(field.keys.mission(mission.id, step), payload, parameters))


def test_a_pushed_mission_is_read_back_the_same() -> None:
    field, mission = Field(), corridor()
    station = field.station()
    assert not station.push(mission).already
    assert station.status().state == "READY"
    assert station.mission(mission.id, 1) == mission


def test_a_file_in_which_another_program_wrote_0_for_0_is_taken() -> None:
    document = msgspec.to_builtins(corridor(stops=1))
    document["start"]["x"] = 0
    del document["digest"]
    document["digest"] = hashlib.sha256(canonical(document)).hexdigest()
    mission = parse(canonical(document), "mission.json")
    assert mission.digest == document["digest"] != corridor(stops=1).digest
    assert Field().station().push(mission).digest == corridor(stops=1).digest


def test_a_mission_of_many_chunks_arrives_whole() -> None:
    field, mission = Field(), corridor(stops=800)
    station = field.station()
    seen: list[tuple[int, int]] = []
    station.push(mission, progress=lambda held, size: seen.append((held, size)))
    assert len(seen) > 3
    assert seen[-1][0] == seen[-1][1]
    assert station.mission(mission.id, 1) == mission


def test_pushing_the_same_again_changes_nothing() -> None:
    field = Field()
    field.station().push(corridor())
    assert field.station().push(corridor()).already


def test_the_same_revision_with_another_digest_is_refused_and_both_are_named() -> None:
    field = Field()
    field.station().push(corridor())
    with pytest.raises(NegativeResult, match=r"revision_taken.*push the change as revision 2"):
        field.station().push(corridor(stops=2))
    assert field.station().push(corridor(stops=2, revision=2)).revision == 2


def test_an_older_revision_is_refused() -> None:
    field = Field()
    field.station().push(corridor(revision=2))
    with pytest.raises(NegativeResult, match="older_revision"):
        field.station().push(corridor(revision=1))


def test_an_older_revision_is_refused_though_it_is_still_stored() -> None:
    """It was taken without a word, and the robot would have driven the plan that was replaced."""
    field = Field()
    for revision in (1, 2):
        field.station().push(corridor(revision=revision))
    with pytest.raises(NegativeResult, match="older_revision"):
        field.station().push(corridor(revision=1))
    assert field.controller.run.revision == 2


def test_another_mission_is_refused_while_one_runs() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    other = with_digest(msgspec.structs.replace(corridor(), id="f" * 32))
    with pytest.raises(NegativeResult, match="running"):
        field.station().push(other)
    assert field.controller.run.mission_id == corridor().id


def test_only_missing_chunks_are_asked_for_after_a_reboot() -> None:
    field, mission = Field(), corridor(stops=400)
    document = msgspec.json.encode(mission)
    manifest = manifest_of(mission, document)
    assert asked(field, mission, "begin", encode(manifest)) == Ready(held=())
    asked(field, mission, "chunk/1", document[CHUNK_BYTES : 2 * CHUNK_BYTES], of=manifest.sha256)
    field.boot()
    assert asked(field, mission, "begin", encode(manifest)) == Ready(held=(1,))


def test_pieces_of_another_size_are_not_mixed() -> None:
    """A stopgo that cuts differently goes on with a push that another one began."""
    field, mission = Field(), corridor(stops=400)
    document = msgspec.json.encode(mission)
    before = msgspec.structs.replace(manifest_of(mission, document), chunk_bytes=48 * 1024)
    asked(field, mission, "begin", encode(before))
    asked(field, mission, "chunk/0", document[: 48 * 1024], of=before.sha256)
    assert asked(field, mission, "begin", encode(manifest_of(mission, document))) == Ready(held=())
    assert not field.station().push(mission).already


def test_a_commit_without_every_chunk_is_rejected() -> None:
    field, mission = Field(), corridor()
    manifest = manifest_of(mission, msgspec.json.encode(mission))
    asked(field, mission, "begin", encode(manifest))
    answer = asked(field, mission, "commit", encode(field.commit(manifest)))
    assert isinstance(answer, Rejected)
    assert answer.reason == "incomplete"
    assert field.controller.run.state == "IDLE"


@pytest.mark.parametrize(
    ("document", "reason"),
    [
        (b'{"schema": "stopgo/mission"}' + b" " * 20, "malformed"),
        (msgspec.json.encode(corridor()).replace(b'"corridor"', b'"c0rridor"'), "digest"),
        (msgspec.json.encode(corridor()).replace(b'"revision":1', b'"revision":1,"x":2'), "malformed"),
    ],
)
def test_a_document_that_is_not_what_it_claims_is_rejected(document: bytes, reason: str) -> None:
    field, mission = Field(), corridor()
    manifest = manifest_of(mission, document)
    asked(field, mission, "begin", encode(manifest))
    asked(field, mission, "chunk/0", document, of=manifest.sha256)
    answer = asked(field, mission, "commit", encode(field.commit(manifest)))
    assert isinstance(answer, Rejected)
    assert answer.reason == reason


def test_a_mission_that_leaves_its_route_is_infeasible() -> None:
    stop = msgspec.structs.replace(corridor().stops[1], approach=((9.0, 9.0), (4.0, 0.0)))
    mission = with_digest(msgspec.structs.replace(corridor(), stops=(corridor().stops[0], stop)))
    with pytest.raises(
        NegativeResult, match=r"infeasible: \$\.stops\[1\]\.approach\[0\]: \(9\.000, 9\.000\) is not stop s1"
    ):
        Field().station().push(mission)


def test_nonsense_is_answered_as_malformed() -> None:
    field, mission = Field(), corridor()
    for step in ("begin", "commit", "chunk/x", "part/x", "nowhere"):
        assert isinstance(asked(field, mission, step, b"\xff{"), Malformed)


@pytest.mark.parametrize("step", ["mission/x/begin", "mission/x/commit", "cmd/pause", "keep"])
@pytest.mark.parametrize("odd", [b"[" * 20_000, b'"\xff\xfe"'])
def test_what_is_anomalous_where_it_would_be_passed_over_is_malformed(step: str, odd: bytes) -> None:
    field = Field()
    station = field.station()
    reply = station.link.ask(f"{field.keys.root}/{step}", b'{"later": ' + odd, timeout_s=1.0)
    assert isinstance(decode(reply or b"", Malformed), Malformed)


def test_a_cut_link_makes_the_outcome_unknown() -> None:
    field = Field()
    station = field.station()
    station.push(corridor())
    field.board.cut = True
    with pytest.raises(OutcomeUnknown):
        station.status()


def test_an_accepted_answer_says_what_was_accepted() -> None:
    mission = corridor()
    accepted = Field().station().push(mission)
    assert accepted == Accepted(mission_id=mission.id, revision=1, digest=mission.digest, already=False)


@pytest.mark.parametrize("mission_id", ["mission", "sx", "cmd", "part", "commit"])
def test_a_mission_of_any_name_can_be_pushed(mission_id: str) -> None:
    field = Field()
    named = with_digest(msgspec.structs.replace(corridor(), id=mission_id))
    station = field.station()
    assert station.push(named).mission_id == mission_id
    assert station.mission(mission_id, 1) == named


def test_a_stop_does_not_wait_until_a_mission_has_been_weighed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A long mission takes a second to be weighed; a pause that comes then is carried out meanwhile."""
    field = Field()
    station = field.station()
    station.push(corridor())
    field.order("start")
    field.work_until(lambda run: run.stop_state == "NAVIGATING")
    states: list[str] = []

    def pause_meanwhile(mission: Mission) -> str:
        pausing = threading.Thread(target=lambda: field.order("pause"), daemon=True)
        pausing.start()
        pausing.join(LAST_NET_S)
        states.append(field.controller.run.state)
        return ""

    monkeypatch.setattr(field.base, "unfit", pause_meanwhile)
    assert station.push(corridor(revision=2)).waits
    assert states == ["PAUSED"]


def test_a_mission_is_weighed_again_if_the_run_went_on_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    field = Field()
    station = field.station()
    station.push(corridor())
    field.order("start")
    field.work_until(lambda run: run.stop_state == "NAVIGATING")
    weighed: list[str] = []

    def abort_meanwhile(mission: Mission) -> str:
        weighed.append(field.controller.run.state)
        field.order("abort")
        return ""

    monkeypatch.setattr(field.base, "unfit", abort_meanwhile)
    assert not station.push(corridor(revision=2)).waits
    assert weighed == ["RUNNING", "ABORTED"]
    assert field.controller.run.state == "READY"


def test_what_is_wrong_with_a_stop_is_reported_with_its_place() -> None:
    document = msgspec.to_builtins(corridor(stops=2))
    document["stops"][1]["x"] = "far"
    with pytest.raises(msgspec.ValidationError, match=r"\$\.stops\[1\]\.x"):
        read_mission(canonical(document))


def test_what_is_let_go_after_a_mission_was_read_is_collected() -> None:
    class Ring:
        def __init__(self) -> None:
            self.itself = self

    ring = Ring()
    gone = weakref.ref(ring)
    frozen = gc.get_freeze_count()
    read_mission(msgspec.json.encode(corridor()))
    del ring
    gc.collect()
    assert gone() is None
    assert gc.get_freeze_count() == frozen
