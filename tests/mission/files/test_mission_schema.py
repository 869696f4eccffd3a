"""The shipped JSON Schema is the one the types give, and says what the reader does."""

from __future__ import annotations

import copy
import json
from importlib.resources import files
from typing import Any

import pytest
from jsonschema import Draft202012Validator, ValidationError

from stopgo.mission.files.mission_json import encode
from tests.mission.files.mission_schema import mission_schema
from tests.mission.worlds import mission_of, square_tour

SHIPPED = files("stopgo.mission").joinpath("mission.schema.json").read_bytes()
VALIDATOR = Draft202012Validator(json.loads(SHIPPED))
DOCUMENT: dict[str, Any] = json.loads(encode(square_tour()))


def test_the_shipped_schema_is_the_generated_one() -> None:
    assert mission_schema() == SHIPPED, (
        "python -m tests.mission.files.mission_schema > mission/mission.schema.json"
    )


def test_the_schema_is_a_schema() -> None:
    Draft202012Validator.check_schema(json.loads(SHIPPED))


def test_missions_are_valid() -> None:
    VALIDATOR.validate(DOCUMENT)
    VALIDATOR.validate(json.loads(encode(mission_of())))


def test_no_object_takes_unknown_keys() -> None:
    objects = [item for item in json.loads(SHIPPED)["$defs"].values() if item.get("type") == "object"]
    assert len(objects) >= 10
    assert all(item["additionalProperties"] is False for item in objects)


@pytest.mark.parametrize("key", list(DOCUMENT))
def test_every_key_is_required(key: str) -> None:
    rest = {name: value for name, value in DOCUMENT.items() if name != key}
    told = [error.message for error in VALIDATOR.iter_errors(rest)]
    assert f"'{key}' is a required property" in told


@pytest.mark.parametrize(
    ("key", "value"), [("colour", "red"), ("x", "four"), ("on_failure", "explode"), ("approach", [[1.0]])]
)
def test_a_wrong_stop_is_invalid(key: str, value: object) -> None:
    document = copy.deepcopy(DOCUMENT)
    document["stops"][0][key] = value
    with pytest.raises(ValidationError):
        VALIDATOR.validate(document)
