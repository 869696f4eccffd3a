"""Recordings of the small world, written once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from stopgo.mission.document import Mission
from stopgo.mission.run.events import PoseReport, StateReport
from stopgo.recordings.embedded import reading
from stopgo.recordings.plan import PlanRecording
from stopgo.recordings.runs.field import FieldRecording
from tests.faults.sizes import FULL
from tests.mission.comparing.test_compare import planned
from tests.recordings import run, world
from tests.shared_folder import shared_folder

with suppress(ModuleNotFoundError):
    import pandas  # noqa: F401  pyarrow loads it for the first drawing: here once, before workers are copied


@pytest.fixture(scope="package", autouse=True)
def _read_in_this_process() -> Iterator[None]:
    """Read recordings of the tests in this process: they are not damaged."""
    with pytest.MonkeyPatch.context() as patch:
        if not FULL:
            patch.setattr(reading, "fatal_faults", lambda paths: {})
        yield


@pytest.fixture(scope="session")
def mission() -> Mission:
    return world.nouns_at()[-1]


@pytest.fixture(scope="session")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    written = shared_folder(tmp_path_factory, "plan", lambda folder: write_plan(folder / "plan.rrd"))
    return written / "plan.rrd"


@pytest.fixture(scope="session")
def field(tmp_path_factory: pytest.TempPathFactory, mission: Mission) -> Path:
    written = shared_folder(
        tmp_path_factory, "field", lambda folder: write_field(folder / "field.rrd", mission)
    )
    return written / "field.rrd"


@pytest.fixture(scope="session")
def revised(tmp_path_factory: pytest.TempPathFactory, mission: Mission) -> Path:
    """A run that takes revision 2 after its first stop."""
    written = shared_folder(
        tmp_path_factory, "revised", lambda folder: write_revised(folder / "field.rrd", mission)
    )
    return written / "field.rrd"


@pytest.fixture(scope="session")
def sighted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plan that carries what its stops see; 70 % is asked."""
    return shared_folder(tmp_path_factory, "sighted", write_sighted) / "plan.rrd"


@pytest.fixture(scope="session")
def skipping(tmp_path_factory: pytest.TempPathFactory, mission: Mission) -> Path:
    """A run that skips its second stop."""
    written = shared_folder(tmp_path_factory, "skipping", lambda folder: write_skipping(folder, mission))
    return written / "field.rrd"


def write_sighted(folder: Path) -> None:
    recording = PlanRecording(world.MISSION_ID)
    for noun in (*world.nouns_at(), planned()[1]):
        recording.observe(noun)
    recording.write(folder / "plan.rrd")


def write_skipping(folder: Path, mission: Mission) -> None:
    with FieldRecording(folder / "field.rrd", mission) as recording:
        for report in run.reports_with_a_skip(mission, "S2"):
            tell(recording, report)


def write_revised(path: Path, mission: Mission) -> Path:
    """As a station hears it: the journal's events come before the state, and with it the mission."""
    after = world.revised(mission)
    with FieldRecording(path, mission) as recording:
        for report in run.reports_of_two(mission, after, behind="S1"):
            if isinstance(report, StateReport) and report.revision == 2:
                recording.mission(after)
            tell(recording, report)
    return path


def write_plan(path: Path, x: float = 0.0, y: float = 0.0) -> Path:
    recording = PlanRecording(world.MISSION_ID)
    for noun in world.nouns_at(x, y):
        recording.observe(noun)
    recording.write(path)
    return path


def write_field(path: Path, mission: Mission, *runs: str) -> Path:
    with FieldRecording(path, mission) as recording:
        for name in runs or (run.RUN,):
            for report in run.reports(mission, run=name):
                tell(recording, report)
    return path


def tell(recording: FieldRecording, report: object) -> None:
    if isinstance(report, StateReport):
        recording.state(report)
    elif isinstance(report, PoseReport):
        recording.pose(report)
    else:
        recording.event(report)
