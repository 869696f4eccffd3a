"""Models are kept in a folder of the tests' own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from stopgo.mission.floor import FloorPlan
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.floors.ifc import loading
from tests.planner.floors.ifc.house import House

Read = Callable[..., FloorPlan]


@pytest.fixture(scope="session")
def models(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Folder of loaded models during the tests."""
    folder = tmp_path_factory.mktemp("models")
    patch = pytest.MonkeyPatch()
    patch.setattr(loading, "cache_folder", lambda: folder)
    yield folder
    patch.undo()


@pytest.fixture
def read(models: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Read:
    """Reads a house's storey; the model is made in this process."""
    monkeypatch.setattr(loading, "_run", in_process)

    def reading(house: House, **options: object) -> FloorPlan:
        path = house.write(tmp_path / "house.ifc")
        return read_floor(path, FloorOptions(**({"storey": "EG"} | options)))  # type: ignore[arg-type]

    return reading


def in_process(source: Path, out: Path, rest: list[str]) -> int:
    """Extraction of a model in this process."""
    from stopgo.planner.floors.ifc.extract import main

    return main([str(source), str(out), *rest])
