"""Runs as data: recordings lie side by side in a catalog, with the columns of the documentation."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from rerun.server import Server

from stopgo.mission.document import Mission
from tests.recordings.conftest import write_field

DOCS = Path(__file__).parents[2] / "docs"
RUNS = ("run-1", "run-2", "run-3")


@pytest.fixture(scope="module")
def folder(mission: Mission, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("runs")
    for name in RUNS:
        write_field(path / f"{name}.rrd", mission, name)
    return path


def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("query_runs", DOCS / "query_runs.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.rerun_threads
@pytest.mark.filterwarnings("ignore")
def test_the_example_reports_every_run_and_stop(
    folder: Path, mission: Mission, capsys: pytest.CaptureFixture[str]
) -> None:
    example().main(folder)
    told = capsys.readouterr().out
    for name in RUNS:
        assert f"{mission.id}-{name}" in told
    rows = {line.split()[0]: line.split()[1:] for line in told.splitlines() if re.match(r"S\d ", line)}
    assert set(rows) == {stop.id for stop in mission.stops}
    assert {int(row[0]) for row in rows.values()} == {len(RUNS)}


@pytest.mark.rerun_threads
@pytest.mark.filterwarnings("ignore")
def test_the_documented_columns_are_those_of_the_recordings(folder: Path) -> None:
    """The tables of docs/reference/recordings.md name an entity, and its columns, one a row."""
    page = (DOCS / "reference" / "recordings.md").read_text()
    documented = set(re.findall(r"^\| `(/[^`]+:[^`]+)` \|", page, re.MULTILINE))
    with Server(host="127.0.0.1", datasets={"runs": sorted(map(str, folder.glob("*.rrd")))}) as server:
        dataset = server.client().get_dataset("runs")
        schema: Any = dataset.schema()
        found = {name_of(column) for column in schema.component_columns()}
        timelines = {column.name for column in schema.index_columns()}
        segments = dataset.segment_ids()
    assert len(segments) == len(RUNS)
    assert {"mission_time", "robot_time", "stop"} <= timelines
    assert documented - found == set()
    assert {name for name in found if name.startswith("/run/stops:")} <= documented


def name_of(column: Any) -> str:
    """The column with the run's id as RUN."""
    name = f"{column.entity_path}:{column.component}"
    return re.sub(r"/run-\d(?=[/:])", "/RUN", name)
