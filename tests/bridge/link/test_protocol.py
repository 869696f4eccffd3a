"""docs/reference/protocol.md says to people what the code says to machines."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import get_args, get_type_hints

import pytest
from msgspec import Struct

from stopgo.bridge.link import protocol
from stopgo.bridge.link.protocol import Info, KeyExpressions, Tagged, decode, encode
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import AnyEvent, State, StopState, UnknownKind
from stopgo.mission.run.run_commands import Answer, Reason, RunCommand
from tests.bridge.world import Field

TEXT = (Path(__file__).parents[3] / "docs" / "reference" / "protocol.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("reason", get_args(Reason))
def test_every_reason_is_explained(reason: str) -> None:
    assert f"| `{reason}` |" in TEXT


@pytest.mark.parametrize("message", [*Tagged.__subclasses__(), RunCommand, Answer])
def test_every_message_is_listed_with_its_fields(message: type[Struct]) -> None:
    row = re.search(rf"^\| `{message.__struct_config__.tag}` \|(.*)\|$", TEXT, re.MULTILINE)
    assert row is not None
    for field in message.__struct_encode_fields__:
        assert re.search(rf"\b{field}\b", row.group(1)), f"{message.__name__}.{field}"


@pytest.mark.parametrize("event", [kind for kind in get_args(AnyEvent) if kind is not UnknownKind])
def test_every_event_is_listed(event: type) -> None:
    assert f"`{event.__name__}`" in TEXT


def test_what_a_newer_robot_adds_to_its_map_is_passed_over() -> None:
    """`Transform` is strict, as a part of mission.json; as a part of `Info` it must not stop a station."""
    decoded = decode(b'{"x": 1.0, "y": 2.0, "heading": 0.5, "z": 3.0}', get_type_hints(Info)["to_map"])
    assert (decoded.x, decoded.y, decoded.heading) == (1.0, 2.0, 0.5)


@pytest.mark.parametrize("state", [*get_args(State), *get_args(StopState)])
def test_every_state_is_explained(state: str) -> None:
    assert f"`{state}`" in TEXT


def test_a_robot_that_reports_no_capability_has_none() -> None:
    """As every robot before there were any."""
    told = json.loads(encode(Field().station().info()))
    del told["capabilities"]
    assert decode(encode(told), Info).capabilities == ()
    assert decode(encode({**told, "capabilities": ["record", "levitation"]}), Info).capabilities == (
        "record",
        "levitation",
    )


def test_keys_are_those_of_the_document() -> None:
    keys = KeyExpressions("r1", "north/hall")
    for key in (keys.alive, keys.info, keys.state, keys.pose, keys.event):
        assert key.startswith("north/hall/sx/1/r1/")
        assert f"`{key.removeprefix('north/hall/sx/1/r1/')}`" in TEXT
    assert str(protocol.VERSION) in keys.root
    assert KeyExpressions.of_every_robot("north").robot_of("north/sx/1/r7/alive") == "r7"


@pytest.mark.parametrize(
    ("robot", "site"), [("", None), ("a/b", None), ("*", None), ("**", None), ("r1", "a//b"), ("r1", "/a")]
)
def test_names_that_are_no_keys_are_refused(robot: str, site: str | None) -> None:
    with pytest.raises(InputError, match="use letters"):
        KeyExpressions(robot, site)
