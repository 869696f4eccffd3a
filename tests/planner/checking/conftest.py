"""A plan of two rooms, made once, and a copy of its files for each test that changes them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from stopgo.command_line import main
from tests.planner.test_command import drawn


@pytest.fixture(scope="session")
def planned_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a plan, with the floor it was made on; tests only read it."""
    folder = tmp_path_factory.mktemp("planned")
    assert main(["plan", str(drawn(folder / "floor.dxf")), "-o", str(folder)]) == 0
    return folder


@pytest.fixture
def made(planned_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """A planned mission; its floor and its coverage lie next to it."""
    shutil.copytree(planned_folder, tmp_path, dirs_exist_ok=True)
    capsys.readouterr()
    return tmp_path / "mission.json"
