"""mission.json: what is written reads back the same, and what is not a mission is refused with its path."""

from __future__ import annotations

import copy
import hashlib
import json
import math
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stopgo.mission.document import Mission, canonical, digest_of, with_digest
from stopgo.mission.errors import InputError
from stopgo.mission.files.mission_json import encode, next_revision, parse, read, write
from stopgo.mission.frames.transform import Transform
from tests.mission.worlds import mission_of, square_tour, stop

DOCUMENT: dict[str, Any] = json.loads(encode(square_tour()))

numbers = st.floats(allow_nan=False, allow_infinity=False)
characters = st.characters(exclude_categories=["Cs"])
"""As of a text by default, which would look for all that can be encoded: that takes seconds."""
texts = st.text(characters, max_size=20)
points = st.tuples(numbers, numbers)
stops = st.builds(
    lambda name, approach, heading: stop(name, *approach, heading=heading),
    texts,
    st.lists(points, min_size=1, max_size=4),
    numbers,
)


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    back = draw(st.none() | st.lists(points, max_size=3).map(tuple))
    mission = mission_of(*draw(st.lists(stops, max_size=3)), back=back)
    turned = Transform(x=draw(numbers), y=draw(numbers), heading=draw(numbers))
    frame = msgspec.structs.replace(
        mission.frame, name=draw(texts), to_map=draw(st.sampled_from([None, turned]))
    )
    revision = draw(st.integers(1, 2**53))
    return with_digest(msgspec.structs.replace(mission, name=draw(texts), frame=frame, revision=revision))


@given(missions())
def test_a_mission_reads_back_the_same(mission: Mission) -> None:
    data = encode(mission)
    assert parse(data, "m") == mission
    assert encode(parse(data, "m")) == data


def test_encoding_sets_the_digest() -> None:
    without_digest = msgspec.structs.replace(square_tour(), digest="")
    assert parse(encode(without_digest), "m") == square_tour()


def test_a_polyline_is_one_point_a_line() -> None:
    assert b"\n        [4.0, 0.0],\n        [4.0, 3.0]\n" in encode(square_tour())


def test_another_indentation_reads_the_same() -> None:
    assert parse(json.dumps(DOCUMENT).encode(), "m") == square_tour()
    assert parse(json.dumps(DOCUMENT, indent=8, sort_keys=True).encode(), "m") == square_tour()


def test_numbers_that_another_program_wrote_shorter_read_the_same() -> None:
    text = json.dumps(DOCUMENT).replace("4.0", "4")
    assert parse(text.encode(), "m") == square_tour()


def test_a_parameter_nobody_knows_yet_is_kept_and_breaks_nothing() -> None:
    document = copy.deepcopy(DOCUMENT)
    del document["digest"]
    document["origin"]["parameters"] = {"from_the_future": [1.5, None]}
    document["digest"] = hashlib.sha256(canonical(document)).hexdigest()
    read = parse(json.dumps(document).encode(), "m")
    assert read.origin.parameters == {"from_the_future": [1.5, None]}
    assert read.digest == digest_of(read)


def refusal(data: bytes) -> str:
    with pytest.raises(InputError) as raised:
        parse(data, "m.json")
    message = str(raised.value)
    assert message.startswith("m.json: ")
    assert "\n" not in message
    return message


def changed(path: str, value: object) -> bytes:
    """The document's bytes with another value at a dotted path."""
    document = copy.deepcopy(DOCUMENT)
    *parents, last = path.split(".")
    place: Any = document
    for key in parents:
        place = place[int(key) if key.isdigit() else key]
    place[last] = value
    return json.dumps(document).encode()


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        ("stops.0.colour", "red", ["$.stops[0]", "colour"]),
        ("stops.1.x", "four", ["$.stops[1].x", '"four"', "float"]),
        ("stops.1.x", math.nan, ["$.stops[1].x", "nan"]),
        ("stops.1.x", -math.inf, ["$.stops[1].x", "-inf"]),
        ("stops.1.x", True, ["$.stops[1].x", "true"]),
        ("stops.1.retries", 1.5, ["$.stops[1].retries", "1.5"]),
        ("stops.0.approach", [[1, 2, 3]], ["$.stops[0].approach[0]"]),
        ("stops.0.on_failure", "explode", ["$.stops[0].on_failure", "explode"]),
        ("robot", [], ["$.robot", "a list of 0"]),
        ("revision", 10**30, ["$.revision", "2^53"]),
        ("schema", "stopgo/plan", ["$.schema", "stopgo/plan", "stopgo/mission"]),
        ("version", 2, ["$.version", "2", "version 1"]),
        ("version", True, ["$.version", "true"]),
        ("name", "\ud800", ["$.name", "surrogate"]),
        ("digest", "0" * 64, ["$.digest", "000000"]),
        ("stops.0.x", 4.001, ["$.digest", "changed"]),
    ],
)
def test_a_wrong_value_is_refused_with_its_path(path: str, value: object, expected: list[str]) -> None:
    message = refusal(changed(path, value))
    assert all(word in message for word in expected), message


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", "not JSON"),
        (b"{", "not JSON"),
        (encode(square_tour())[:-40], "not JSON"),
        (b"\xff\xfe{}", "not UTF-8"),
        (b"[]", "a list of 0, not an object"),
        (b"null", "null, not an object"),
        (b"{}", "$.schema is null"),
        (b'{"schema": "stopgo/mission", "version": 1}', "missing required field"),
        (b'{"schema": 1, "schema": "stopgo/mission"}', "$.schema occurs more than once"),
        (b'{"a": {"b": [{"c": 1, "c": 1}]}}', "$.a.b[0].c occurs more than once"),
        (b'{"a": 1e999}', "$.a is inf"),
        (b'{"a": ' + b"9" * 5000 + b"}", "not JSON"),
        (b"[" * 100_000, "nested too deeply"),
        (b'{"a":' * 600 + b"1" + b"}" * 600, "nested too deeply|\\$.schema"),
    ],
)
def test_what_is_no_mission_is_refused(data: bytes, expected: str) -> None:
    message = refusal(data)
    assert any(word in message for word in expected.replace("\\", "").split("|")), message


def places(value: object, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Every place in a document that a mutation can hit."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(deep for key, item in items for deep in places(item, (*path, key)))]


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(characters, max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(characters, max_size=5), inner, max_size=3)
    ),
    max_leaves=5,
)


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(places(DOCUMENT)), anything)
def test_a_mutated_document_is_a_mission_or_refused(path: tuple[str | int, ...], value: object) -> None:
    root: Any = {"": copy.deepcopy(DOCUMENT)}
    place = root
    for key in ("", *path)[:-1]:
        place = place[key]
    place[("", *path)[-1]] = value
    mission_or_refused(json.dumps(root[""]).encode())


@given(st.integers(0, 10_000), st.binary(max_size=6), st.integers(0, 6))
def test_spliced_bytes_are_a_mission_or_refused(at: int, inserted: bytes, removed: int) -> None:
    data = encode(square_tour())
    mission_or_refused(data[: at % len(data)] + inserted + data[at % len(data) + removed :])


@given(st.binary() | anything.map(lambda value: json.dumps(value).encode()))
def test_any_bytes_are_a_mission_or_refused(data: bytes) -> None:
    mission_or_refused(data)


def mission_or_refused(data: bytes) -> None:
    try:
        assert isinstance(parse(data, "m"), Mission)
    except InputError as error:
        assert str(error).startswith("m: ")


def test_a_number_that_json_cannot_hold_is_not_written() -> None:
    broken = mission_of(stop("S1", (0.0, math.nan)))
    with pytest.raises(InputError, match=r"\$\.stops\[0\]\.y is nan"):
        encode(broken)


def test_a_file_reads_back(tmp_path: Path) -> None:
    write(square_tour(), tmp_path / "mission.json")
    assert read(tmp_path / "mission.json") == square_tour()


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing\.json: cannot be read \(No such file"):
        read(tmp_path / "nothing.json")


class TestNextRevision:
    def test_is_the_missions_own_where_nothing_is(self, tmp_path: Path) -> None:
        assert next_revision(tmp_path / "mission.json", square_tour()) == 1

    def test_stays_when_the_content_is_the_same(self, tmp_path: Path) -> None:
        write(msgspec.structs.replace(square_tour(), revision=7), tmp_path / "mission.json")
        assert next_revision(tmp_path / "mission.json", square_tour()) == 7

    def test_is_one_more_when_the_content_differs(self, tmp_path: Path) -> None:
        write(msgspec.structs.replace(square_tour(), revision=7), tmp_path / "mission.json")
        other = msgspec.structs.replace(square_tour(), return_=None)
        assert next_revision(tmp_path / "mission.json", other) == 8

    def test_starts_again_over_another_mission(self, tmp_path: Path) -> None:
        write(msgspec.structs.replace(square_tour(), revision=7, id="f" * 32), tmp_path / "mission.json")
        assert next_revision(tmp_path / "mission.json", square_tour()) == 1

    def test_refuses_what_is_no_mission(self, tmp_path: Path) -> None:
        (tmp_path / "mission.json").write_text("{}")
        with pytest.raises(InputError, match="move it away"):
            next_revision(tmp_path / "mission.json", square_tour())


@pytest.mark.parametrize("bad", ["", "../../etc/passwd", "a*", "a/b", "x" * 65, "mission one"])
def test_an_id_that_cannot_stand_in_a_key_is_refused(bad: str) -> None:
    document = copy.deepcopy(DOCUMENT)
    del document["digest"]
    document["id"] = bad
    document["digest"] = hashlib.sha256(canonical(document)).hexdigest()
    with pytest.raises(InputError, match=r"\$\.id"):
        parse(json.dumps(document).encode(), "m")


def test_only_a_file_has_a_revision_to_follow(tmp_path: Path) -> None:
    """A device such as /dev/full has no end to read to; who writes there refuses it."""
    assert next_revision(tmp_path, square_tour()) == square_tour().revision
