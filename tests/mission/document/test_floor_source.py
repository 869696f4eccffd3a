"""A floor's source enters the mission's id; of a plain file it is the digest alone."""

from __future__ import annotations

from typing import Any

import pytest

from stopgo.mission.document import mission_id
from stopgo.mission.document.floor_source import FloorSource
from stopgo.mission.settings import Settings

DIGEST = "0" * 64
PLAIN = "2b7fc8214c3ae5701baf55c99eecf50b"
"""The id of a floor that is nothing but its file's digest, by the default parameters."""


def id_of(**chosen: Any) -> str:
    return mission_id(FloorSource("model.ifc", DIGEST, **chosen), Settings(), "0.1.0")


def test_a_floor_in_which_nothing_is_chosen_has_the_id_of_its_digest() -> None:
    assert id_of() == PLAIN
    assert id_of(options={}) == PLAIN


@pytest.mark.parametrize(
    "chosen",
    [
        *({"storey": "EG"}, {"storey": "OG"}, {"date": "2024-05-01"}, {"drawing": 2}, {"units": "mm"}),
        *({"region": (0.0, 0.0, 1.0, 1.0)}, {"storey": "EG", "since": "2024-05-01"}),
        {"options": {"robot_height": 1.2}},
    ],
)
def test_another_choice_in_the_same_file_is_another_floor(chosen: dict[str, Any]) -> None:
    assert id_of(**chosen) != PLAIN
    assert id_of(**chosen) == id_of(**chosen)
    assert id_of(**chosen, date="1999-01-01") != id_of(**chosen) if "date" not in chosen else True


def test_the_order_of_options_says_nothing() -> None:
    assert id_of(options={"a": 1, "b": 2}) == id_of(options={"b": 2, "a": 1})


def test_the_choice_is_reported_in_words() -> None:
    source = FloorSource("model.ifc", DIGEST, storey="EG", date="2024-05-01")
    assert source.title == "storey EG, date 2024-05-01"
    assert not FloorSource("plain.dxf", DIGEST).title
