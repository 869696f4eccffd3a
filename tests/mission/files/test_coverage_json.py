"""coverage.json says what was seen of each element, and where."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stopgo.mission.files.coverage_json import coverage_json
from stopgo.mission.geometry import frozen
from stopgo.mission.stages.covered_intervals import runs_of
from tests.mission.worlds import room_floor, room_mission, room_route, room_targets


@pytest.fixture
def document() -> dict[str, Any]:
    return json.loads(coverage_json(room_route(), room_mission()))


def element(document: dict[str, Any], name: str) -> dict[str, Any]:
    return next(item for item in document["elements"] if item["id"] == name)


def test_every_target_element_is_there_with_its_global_id(document: dict[str, Any]) -> None:
    assert [item["id"] for item in document["elements"]] == ["W1", "C1", "C2"]
    assert element(document, "W1")["global_id"] == "0LiOMJvJv5Bu0hPkJYEFGw"
    assert element(document, "C1")["global_id"] is None


def test_sums_add_up(document: dict[str, Any]) -> None:
    counts = {"elements": 3, "units": 32, "visible": 32, "seen": 32}
    metres = {"length_m": 27.2, "visible_m": 27.2, "seen_m": 27.2}
    assert document["total"] == {**counts, **metres, "coverage": 1.0}
    assert document["kinds"]["walls"]["units"] == 24
    assert document["kinds"]["columns"]["elements"] == 2
    assert sum(item["seen"] for item in document["elements"]) == document["total"]["seen"]


def test_one_stop_sees_its_half() -> None:
    route = room_route()
    left = replace(route, selection=replace(route.selection, chosen=frozen([0], np.int64)))
    document = json.loads(coverage_json(left, room_mission()))
    assert document["total"]["seen"] == 16
    assert element(document, "C1")["coverage"] == 1.0
    assert element(document, "C2")["coverage"] == 0.0
    wall = element(document, "W1")["segments"]
    bottom = next(item for item in wall if item["a"][1] == item["b"][1] == 0)
    assert bottom["seen"] == ([[0, 0.5]] if bottom["a"][0] == 0 else [[0.5, 1]])


def test_neighbouring_units_are_one_run_and_segments_never_join() -> None:
    targets = room_targets(room_floor())
    everything = runs_of(targets, np.ones(targets.total, dtype=bool))
    assert everything.segment.tolist() == list(range(12))
    assert everything.t0.tolist() == [0] * 12
    assert everything.t1.tolist() == [1] * 12


def test_runs_hold_exactly_the_units_of_the_mask() -> None:
    targets = room_targets(room_floor())
    mask = np.random.default_rng(1).random(targets.total) < 0.5
    runs = runs_of(targets, mask)
    units = np.rint((runs.t1 - runs.t0) * targets.units[runs.segment])
    assert units.sum() == mask.sum()
    assert len(runs_of(targets, np.zeros(targets.total, dtype=bool)).segment) == 0


def test_it_names_its_mission(document: dict[str, Any]) -> None:
    mission = room_mission()
    assert document["mission"] == {"id": mission.id, "revision": 1, "digest": mission.digest}


def test_the_same_plan_gives_the_same_bytes(tmp_path: Path) -> None:
    (tmp_path / "coverage.json").write_bytes(coverage_json(room_route(), room_mission()))
    assert (tmp_path / "coverage.json").read_bytes() == coverage_json(room_route(), room_mission())
