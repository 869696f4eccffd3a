"""A reader is found by suffix and by what the bytes look like, and takes only the options it knows."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import stopgo.recordings.samples
from stopgo.command_line import main
from stopgo.mission.errors import InputError
from stopgo.planner.floors import READERS, FloorOptions, read_floor, survey_floor

OFFICE = Path(stopgo.recordings.samples.__file__).with_name("office.dxf")


def test_a_drawing_is_read_whatever_its_file_is_called(tmp_path: Path) -> None:
    path = tmp_path / "floor.txt"
    path.write_bytes(OFFICE.read_bytes())
    assert read_floor(path).area == read_floor(OFFICE).area


def test_a_file_of_no_known_kind_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "floor.pdf"
    path.write_bytes(b"%PDF-1.7")
    with pytest.raises(
        InputError, match=r"floor.pdf: unknown kind of file '.pdf'; floors are read from .dxf"
    ):
        read_floor(path)


def test_an_option_that_means_nothing_is_refused() -> None:
    with pytest.raises(InputError, match=r"--storey does not apply to a DXF drawing; remove it \(known"):
        read_floor(OFFICE, FloorOptions(storey="EG"))


def test_every_reader_names_options_that_there_are_and_has_both_functions() -> None:
    for reader in READERS:
        assert reader.takes <= set(FloorOptions.__dataclass_fields__)
        assert callable(reader.load().read)
        assert callable(reader.load().survey)


def test_the_survey_of_a_layered_drawing_reports_its_floor_and_its_layers() -> None:
    found, floor = survey_floor(OFFICE), read_floor(OFFICE)
    assert found.digest == floor.digest
    (only,) = found.floors
    assert only.chosen
    assert only.area_m2 == floor.area
    assert only.elements["rooms"] == len(floor.rooms)
    assert only.elements["walls"] == sum(item.kind == "walls" for item in floor.elements)
    assert {layer.role for layer in found.layers} >= {"floor", "rooms", "walls", "doors"}


def test_the_command_reports_the_floor_and_every_layer(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["floors", str(OFFICE)]) == 0
    text = capsys.readouterr().out
    assert "* floor       office, " in text
    assert "layer       WALLS -> walls (its name)" in text
    assert main(["floors", str(OFFICE), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["floors"][0]["chosen"] is True
    assert {"name": "WINDOWS", "role": "windows"}.items() <= told["layers"][-1].items()
