"""The canonical form under a mission's digest is the one that docs/reference/mission-json.md reports."""

from __future__ import annotations

import hashlib
import json
from decimal import Decimal
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stopgo.mission.document import Mission, canonical, digest_of
from stopgo.mission.files.mission_json import parse

VECTORS: dict[str, Any] = json.loads(files("stopgo.mission").joinpath("canonical.vectors.json").read_bytes())
SHORT = {8: "\\b", 9: "\\t", 10: "\\n", 12: "\\f", 13: "\\r", 34: '\\"', 92: "\\\\"}

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
leaves = (
    st.none()
    | st.booleans()
    | st.integers(-(2**53), 2**53)
    | st.floats(allow_nan=False, allow_infinity=False)
)
values = st.recursive(
    leaves | texts, lambda inner: st.lists(inner) | st.dictionaries(texts, inner), max_leaves=12
)


@pytest.mark.parametrize("vector", VECTORS["values"], ids=lambda vector: str(vector["json"]))
def test_a_value_has_the_canonical_form_of_its_vector(vector: dict[str, str]) -> None:
    assert canonical(json.loads(vector["json"])).decode() == vector["canonical"]
    assert canonical(msgspec.json.decode(vector["json"])).decode() == vector["canonical"]


@pytest.mark.parametrize("vector", VECTORS["missions"], ids=lambda vector: str(vector["shows"]))
def test_a_mission_has_the_canonical_form_and_the_digest_of_its_vector(vector: dict[str, str]) -> None:
    """Read as a robot reads it, and as a file is read."""
    for mission in (
        msgspec.json.decode(vector["document"].encode(), type=Mission),
        parse(vector["document"].encode(), "m"),
    ):
        rest = {key: value for key, value in msgspec.to_builtins(mission).items() if key != "digest"}
        assert canonical(rest).decode() == vector["canonical"]
        assert digest_of(mission) == mission.digest == vector["sha256"]
    assert hashlib.sha256(vector["canonical"].encode()).hexdigest() == vector["sha256"]


@given(values)
def test_the_canonical_form_is_what_the_document_says(value: object) -> None:
    assert canonical({"value": value}).decode() == by_the_document({"value": value})


@given(st.integers(0, 0x10FFFF).filter(lambda code: not 0xD800 <= code < 0xE000))
def test_every_character_is_written_as_the_document_says(code: int) -> None:
    assert canonical({chr(code): chr(code)}).decode() == by_the_document({chr(code): chr(code)})


@given(st.sampled_from([1.0, 1.25, 9.999, 1.2345678901234567]), st.integers(-9, 20), st.sampled_from([1, -1]))
def test_every_size_of_number_is_written_as_the_document_says(digits: float, power: int, sign: int) -> None:
    value = sign * digits * 10.0**power
    assert canonical({"value": value}).decode() == by_the_document({"value": value})


def test_the_document_names_the_vectors() -> None:
    page = Path(__file__).parents[3] / "docs" / "reference" / "mission-json.md"
    assert "mission/canonical.vectors.json" in page.read_text(encoding="utf-8")


def by_the_document(value: object) -> str:
    """The canonical form, written once more after docs/reference/mission-json.md alone."""
    match value:
        case dict():
            pairs = sorted(value.items(), key=lambda pair: pair[0].encode())
            return "{" + ",".join(f"{_text(key)}:{by_the_document(item)}" for key, item in pairs) + "}"
        case list():
            return "[" + ",".join(map(by_the_document, value)) + "]"
        case str():
            return _text(value)
        case float():
            return _double(value)
        case bool() | None:
            return {None: "null", True: "true", False: "false"}[value]
    return str(value)


def _text(value: str) -> str:
    return '"' + "".join(_character(character) for character in value) + '"'


def _character(character: str) -> str:
    code = ord(character)
    return SHORT.get(code) or (f"\\u{code:04x}" if code < 32 else character)


def _double(value: float) -> str:
    sign, shortest, exponent = Decimal(repr(value)).normalize().as_tuple()
    assert isinstance(exponent, int)
    digits, minus = "".join(map(str, shortest)), "-" * sign
    power = len(digits) + exponent - 1
    if value == 0:
        return f"{minus}0.0"
    if power < -5 or power > 15:
        return f"{minus}{digits[0]}{'.' * (len(digits) > 1)}{digits[1:]}e{power}"
    if power < 0:
        return f"{minus}0.{'0' * (-power - 1)}{digits}"
    return f"{minus}{digits[: power + 1].ljust(power + 1, '0')}.{digits[power + 1 :] or '0'}"
