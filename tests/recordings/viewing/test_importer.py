"""`rerun mission.json` and `rerun floor.dxf`: what is ours is shown, what is not is left to others."""

from __future__ import annotations

import io
import sys
import tomllib
from pathlib import Path

import pytest
import rerun as rr
from rerun.chunk import RrdReader

import stopgo
from stopgo.mission.document import Mission
from stopgo.mission.files.mission_json import write
from stopgo.recordings.drawing import entities
from stopgo.recordings.rrd.read import MARK, Contents, check
from stopgo.recordings.viewing.importer import NOT_OURS
from tests.recordings import world

ROOT = Path(__file__).parents[3]
OFFICE = ROOT / "recordings" / "samples" / "office.dxf"
ASKED = ("--application-id", "viewer", "--recording-id", "r1", "--opened-recording-id", "r0", "--static")
"""As Rerun calls its importers."""

HEADER = 12
"""Bytes by which each recording of a stream begins: mark, version, options."""


class Output(io.TextIOWrapper):
    """A stdout that keeps its bytes."""

    def __init__(self) -> None:
        super().__init__(io.BytesIO(), encoding="utf-8")

    def taken(self) -> bytes:
        self.flush()
        kept = self.buffer
        assert isinstance(kept, io.BytesIO)
        return kept.getvalue()


def opened(path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[int, bytes]:
    """The exit code, and what was written to stdout."""
    output = Output()
    monkeypatch.setattr(sys, "argv", ["rerun-importer-stopgo", str(path), *ASKED])
    monkeypatch.setattr(sys, "stdout", output)
    return stopgo.rerun_importer(), output.taken()


def shown(path: Path, monkeypatch: pytest.MonkeyPatch, out: Path) -> Contents:
    code, recording = opened(path, monkeypatch)
    assert code == 0
    header = recording[:HEADER]
    layout, _, whole = recording[HEADER:].partition(header)
    assert header.startswith(MARK)
    assert layout and whole, "the layout comes first"
    out.write_bytes(header + whole)
    alone = out.with_name("layout.rbl")
    alone.write_bytes(header + layout)
    assert RrdReader(alone).blueprints() and not RrdReader(alone).recordings()
    return check(out)


def test_a_mission_shows_its_stops_and_route_under_its_own_id(
    mission: Mission, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(mission, tmp_path / "mission.json")
    contents = shown(tmp_path / "mission.json", monkeypatch, tmp_path / "out.rrd")
    assert contents.recording_id == world.MISSION_ID
    assert contents.complete
    assert {entities.STOPS, entities.ROUTE} <= set(contents.rows)


def test_a_floor_shows_its_rooms_in_the_recording_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    contents = shown(OFFICE, monkeypatch, tmp_path / "out.rrd")
    assert contents.recording_id == "r1"
    assert {entities.OUTLINE, entities.ROOMS} <= set(contents.rows)
    assert entities.STOPS not in contents.rows


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("other.json", '{"schema": "another"}'),
        ("settings.yaml", "image: a.png\n"),
        ("plan.rrd", "RRF2"),
        ("notes", ""),
        ("empty.json", ""),
    ],
)
def test_what_is_not_ours_is_left_to_others_without_a_word(
    name: str,
    content: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / name).write_text(content)
    assert opened(tmp_path / name, monkeypatch) == (NOT_OURS, b"")
    assert opened(tmp_path / f"no-{name}", monkeypatch) == (NOT_OURS, b"")
    assert opened(tmp_path, monkeypatch) == (NOT_OURS, b"")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("name", "content"),
    [("cut.json", '{"schema": "stopgo/mission"'), ("junk.dxf", "junk"), ("empty.DXF", ""), ("x.ifc", "ISO")],
)
def test_a_damaged_one_is_reported_in_one_line(
    name: str,
    content: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / name).write_text(content)
    assert opened(tmp_path / name, monkeypatch) == (2, b"")
    (line,) = capsys.readouterr().err.splitlines()
    assert name in line


def test_it_is_called_as_rerun_calls_its_importers() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["scripts"]["rerun-importer-stopgo"] == "stopgo:rerun_importer"
    assert rr.EXTERNAL_IMPORTER_INCOMPATIBLE_EXIT_CODE == NOT_OURS
