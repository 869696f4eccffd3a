"""Whatever arrives on whatever key, the robot stays up and answers the next good message."""

from __future__ import annotations

import json
from typing import Any

import msgspec
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stopgo.bridge.link.protocol import Malformed, Reply, encode
from stopgo.mission.run.run_commands import RunCommand
from tests.bridge.robot.test_push import manifest_of
from tests.bridge.world import Field, corridor
from tests.faults.sizes import size

MISSION = corridor()
DOCUMENT = encode(MISSION)
MANIFEST = manifest_of(MISSION, DOCUMENT)
STEPS = ("begin", "commit", "chunk/0", "chunk/99", "chunk/-1", "chunk/x", "part/0", "part/-1", "", "no/such")
VERBS = ("start", "pause", "resume", "skip", "retry", "abort", "home", "explode")


class Zeros(bytes):
    """Many zero bytes, reported in few words when a test fails."""

    def __new__(cls, length: int) -> Zeros:
        return super().__new__(cls, length)

    def __repr__(self) -> str:
        return f"Zeros({len(self)})"


CHARACTERS = st.characters(exclude_categories=["Cs"])
"""As of a text by default, which would look for all that can be encoded: that takes seconds."""
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(CHARACTERS, max_size=20),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(CHARACTERS, max_size=10), inner, max_size=4)
    ),
    max_leaves=10,
)


def good_command() -> dict[str, Any]:
    field = Field()
    return msgspec.to_builtins(field.command("pause"))


GOOD = (
    good_command(),
    msgspec.to_builtins(MANIFEST),
    msgspec.to_builtins(Field().commit(MANIFEST)),
    msgspec.to_builtins(MISSION),
)


@st.composite
def bent(draw: st.DrawFn) -> bytes:
    """A good message with one value replaced, left out or added."""
    document = dict(draw(st.sampled_from(GOOD)))
    key = draw(st.sampled_from(sorted(document)) | st.text(CHARACTERS, max_size=12))
    if draw(st.booleans()):
        document.pop(key, None)
    else:
        document[key] = draw(json_values)
    return json.dumps(document).encode(errors="surrogatepass")


@st.composite
def torn(draw: st.DrawFn) -> bytes:
    """A good message with some of its bytes changed, or its end missing."""
    data = bytearray(encode(draw(st.sampled_from(GOOD))))
    for _ in range(draw(st.integers(0, 4))):
        data[draw(st.integers(0, len(data) - 1))] = draw(st.integers(0, 255))
    return bytes(data[: draw(st.integers(0, len(data)))])


deep = st.integers(1, 2000).map(lambda depth: b"[" * depth)
payloads = st.one_of(st.binary(max_size=300), bent(), torn(), deep, st.integers(1000, 300_000).map(Zeros))
parameters = st.dictionaries(
    st.sampled_from(["since", "run", "of", "revision"]),
    st.text(CHARACTERS, max_size=30) | st.integers().map(str),
    max_size=3,
)


def key_of(field: Field, draw: st.DataObject) -> str:
    keys = field.keys
    made = st.one_of(
        st.sampled_from([keys.info, keys.log, keys.poses]),
        st.sampled_from(VERBS).map(keys.command),
        st.tuples(st.sampled_from([MISSION.id, "x", "%", "mission"]), st.sampled_from(STEPS)).map(
            lambda pair: keys.mission(*pair)
        ),
    )
    return draw.draw(made)


def test_no_payload_on_any_key_brings_the_robot_down() -> None:
    field = Field()
    station = field.station()
    station.push(MISSION)

    @settings(
        max_examples=size(short=40, full=30_000),
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(data=st.data())
    def fuzz(data: st.DataObject) -> None:
        key, payload = key_of(field, data), data.draw(payloads)
        asked = data.draw(parameters)
        reply = station.link.ask(key, payload, timeout_s=1, parameters=asked)
        assert reply is not None
        msgspec.json.decode(reply, type=Reply)
        for _ in range(3):
            field.controller.step()
        assert station.info().robot == "r1"

    fuzz()
    assert station.push(MISSION).already
    assert field.controller.execute(field.command("pause")).cmd_id


def test_a_command_on_the_key_of_another_verb_is_malformed() -> None:
    field = Field()
    station = field.station()
    command = RunCommand(cmd_id="c", verb="abort", commander="x", issued_ns=0, valid_for_s=1.0)
    reply = station.link.ask(field.keys.command("pause"), encode(command), timeout_s=1)
    assert reply is not None
    assert isinstance(msgspec.json.decode(reply, type=Reply), Malformed)


@given(data=st.data())
@settings(max_examples=size(short=60, full=3000), deadline=None, derandomize=True, database=None)
def test_no_document_brings_the_robot_down(data: st.DataObject) -> None:
    """A document that arrives whole and with the right hash may still be anything."""
    field = Field()
    station = field.station()
    document = data.draw(st.one_of(bent(), torn(), deep, st.just(b"[" * 200_000), st.just(b'{"a":' * 99_999)))
    manifest = manifest_of(MISSION, document)
    ask = station.link.ask
    ask(field.keys.mission(MISSION.id, "begin"), encode(manifest), timeout_s=1)
    for number in range(manifest.chunks):
        chunk = document[number * manifest.chunk_bytes : (number + 1) * manifest.chunk_bytes]
        key = field.keys.mission(MISSION.id, f"chunk/{number}")
        ask(key, chunk, timeout_s=1, parameters={"of": manifest.sha256})
    reply = ask(field.keys.mission(MISSION.id, "commit"), encode(field.commit(manifest)), timeout_s=1)
    assert reply is not None
    msgspec.json.decode(reply, type=Reply)
    assert station.push(MISSION).digest == MISSION.digest
