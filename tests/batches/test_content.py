"""Tests of the hash of all that a plan depends on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from stopgo.batches.content import changes, digest, floor_parts, plan_key
from stopgo.mission.settings import Settings
from stopgo.planner.floors import read_floor
from tests.batches.halls import hall


def key(path: Path, settings: Settings | None = None, *, all_parts: bool = False) -> str:
    parts = floor_parts(read_floor(path), ())
    return plan_key(parts, settings or Settings(), all_parts=all_parts, strict=False)


def test_the_same_floor_in_other_bytes_has_the_same_key(tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()
    one = hall(tmp_path / "hall.dxf")
    other = hall(tmp_path / "new" / "hall.dxf", note="issued again")
    assert one.read_bytes() != other.read_bytes()
    assert key(one) == key(other)


def test_a_wall_that_moved_and_each_option_change_the_key(tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()
    one, other = hall(tmp_path / "hall.dxf"), hall(tmp_path / "new" / "hall.dxf", width=6.01)
    keys = [key(one), key(other), key(one, Settings(range=6.0)), key(one, all_parts=True)]
    assert len(set(keys)) == 4


def test_what_changed_is_named_by_element(tmp_path: Path) -> None:
    before = floor_parts(read_floor(hall(tmp_path / "hall.dxf")), ())
    after = floor_parts(read_floor(hall(tmp_path / "hall.dxf", width=7.0)), ())
    lines = changes(before, after)
    assert "outline: changed" in lines
    assert any(line.startswith("element") for line in lines)
    assert changes(before, before) == []


@pytest.mark.parametrize(
    ("one", "other"),
    [(("ab", "c"), ("a", "bc")), ((1, 11), (11, 1)), (((),), ()), (1, "1"), (None, ""), ({"a": 1}, ("a", 1))],
)
def test_values_that_look_alike_have_other_hashes(one: object, other: object) -> None:
    assert digest(one) != digest(other)


def test_a_long_list_of_changes_is_cut(tmp_path: Path) -> None:
    after = {f"element {n}": "x" for n in range(40)}
    assert changes({}, after)[-1] == "and 28 more"
    assert replace(Settings(), range=5.0) == Settings()
