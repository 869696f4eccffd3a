"""coverage.json as stretches, and files that are none."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from stopgo.mission.document import Mission, with_digest
from stopgo.mission.errors import InputError
from stopgo.mission.files.coverage_json import coverage_json
from stopgo.mission.files.exports.stretches import read_stretches
from tests.mission.worlds import room_mission, room_route, square_tour


@pytest.fixture
def written(tmp_path: Path) -> tuple[Path, Mission]:
    """The coverage of the room, and its mission."""
    (tmp_path / "coverage.json").write_bytes(coverage_json(room_route(), room_mission()))
    return tmp_path / "coverage.json", room_mission()


COUNTS = {"units": 10, "visible": 10, "seen": 7, "coverage": 0.7}


def element(segment: dict[str, Any]) -> dict[str, Any]:
    return {"id": "w", **COUNTS, "segments": [segment]}


def lengths(stretches: np.ndarray) -> float:
    return float(np.hypot(*(stretches[:, 1] - stretches[:, 0]).T).sum())


def test_seen_and_unseen_make_the_whole_boundary(written: tuple[Path, Mission]) -> None:
    stretches = read_stretches(*written)
    targets = room_route().visibility.targets
    whole = float(np.hypot(*(targets.b - targets.a).T).sum())
    assert lengths(stretches.seen) + lengths(stretches.unseen) == pytest.approx(whole, abs=1e-4)
    assert lengths(stretches.seen) > 0


def test_what_lies_between_two_seen_pieces_is_not_seen(tmp_path: Path) -> None:
    mission = square_tour()
    segment = {"a": [0, 0], "b": [10, 0], "seen": [[0.1, 0.3], [0.5, 1.0]]}
    coverage = {
        **{"schema": "stopgo/coverage", "version": 1, "elements": [element(segment)], "total": COUNTS},
        "mission": {"id": mission.id, "digest": mission.digest},
    }
    (tmp_path / "c.json").write_text(json.dumps(coverage))
    stretches = read_stretches(tmp_path / "c.json", mission)
    assert stretches.seen[:, :, 0] == pytest.approx(np.array([[1.0, 3], [5, 10]]))
    assert stretches.unseen[:, :, 0] == pytest.approx(np.array([[0.0, 1], [3, 5]]))


def test_another_missions_coverage_is_refused(written: tuple[Path, Mission]) -> None:
    path, mission = written
    with pytest.raises(InputError, match=r"coverage\.json: is the coverage of mission 0123"):
        read_stretches(path, msgspec.structs.replace(mission, id="f" * 32))
    with pytest.raises(InputError, match="of another revision"):
        read_stretches(path, with_digest(msgspec.structs.replace(mission, revision=2)))


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b"\xff", b'{"schema": "stopgo/coverage", "version": 2}', b"[" * 100_000]
)
def test_what_is_no_coverage_is_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "c.json").write_bytes(content)
    with pytest.raises(InputError, match=r"c\.json: "):
        read_stretches(tmp_path / "c.json", square_tour())


@pytest.mark.parametrize("seen", [[[0.5, 0.2]], [[-1.0, 0.5]], [[0.0, 1.5]]])
@pytest.mark.parametrize("end", [10.0, 1e300])
def test_segments_that_make_no_sense_are_refused(seen: list, end: float, tmp_path: Path) -> None:
    mission = square_tour()
    coverage = {
        **{
            "schema": "stopgo/coverage",
            "version": 1,
            "mission": {"id": mission.id, "digest": mission.digest},
        },
        "elements": [element({"a": [0, 0], "b": [end, 0], "seen": seen})],
        "total": COUNTS,
    }
    (tmp_path / "c.json").write_text(json.dumps(coverage))
    with pytest.raises(InputError, match=r"c\.json: a segment from"):
        read_stretches(tmp_path / "c.json", mission)
