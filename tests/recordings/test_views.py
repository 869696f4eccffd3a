"""Every view of a plan, a run and both draws a picture and reports nothing wrong."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rerun.experimental import ViewerClient

from bridge.station.watch import hand_over
from mission.document import Mission
from recordings import palette
from recordings.carried.reading import read_recording
from recordings.field import FieldRecording
from recordings.viewer import Viewed
from tests.recordings import run
from tests.recordings.viewer import PATIENCE_S, has_vulkan, look, viewer

pytestmark = pytest.mark.skipif(
    not has_vulkan(), reason="no Vulkan driver: install mesa-vulkan-drivers to look at recordings"
)

VIEWS = {
    "plan": {
        "Mission": {"Plan and run": palette.ROUTE, "3D": palette.ROUTE, "Report": None},
        "Planning": {
            "Navigable space and candidates": palette.STOP_AREA,
            "What a candidate sees (timeline: candidate)": palette.KIND_COLOURS["columns"],
            "Selection (timeline: stage_step)": palette.SEEN.colour,
            "Coverage, %": palette.ROUTE,
        },
        "Run": {
            "States": None,
            "Distance from the route, mm (left positive)": palette.FAILED.colour,
            "Deviation at each stop, mm": palette.FAILED.colour,
            "Battery, %": palette.FAILED.colour,
        },
        "Log": {"Log": None},
    },
    "field": {
        "Mission": {"Plan and run": palette.DRIVEN, "3D": palette.DRIVEN, "Report": None},
        "Run": {
            "States": None,
            "Distance from the route, mm (left positive)": palette.DRIVEN,
            "Deviation at each stop, mm": palette.FAILED.colour,
            "Battery, %": palette.DRIVEN,
        },
        "Log": {"Log": None},
    },
}
"""Views by tab, and a colour that each must show."""


@pytest.fixture(scope="module")
def plan_viewer(plan: Path) -> Iterator[ViewerClient]:
    with viewer([plan]) as client:
        yield client


def test_every_view_of_a_plan_shows_its_subject(plan_viewer: ViewerClient, tmp_path: Path) -> None:
    assert_every_view_shown(plan_viewer, "plan", tmp_path)


def test_every_view_of_a_run_shows_its_subject(field: Path, tmp_path: Path) -> None:
    with viewer([field]) as client:
        assert_every_view_shown(client, "field", tmp_path)


def assert_every_view_shown(client: ViewerClient, which: str, into: Path) -> None:
    client.set_time("mission_time", duration=100.0, play_state="paused")
    for tab, colours in VIEWS[which].items():
        assert_shown(client, tab, colours, into)


def test_what_was_lost_is_shown_whatever_is_opened_first(
    sighted: Path, mission: Mission, tmp_path: Path
) -> None:
    """Opened together in any order, a plan and a run with a skip show the run's end, and the same."""
    field = tmp_path / "field.rrd"
    with FieldRecording(field, mission, plan=read_recording(sighted)) as recording:
        for report in run.reports_with_a_skip(mission, "S2"):
            hand_over(recording, report)
    pictures = []
    for files in ([sighted, field], [field, sighted]):
        with viewer(files) as client:
            assert_shown(client, "Mission", {"Plan and run": palette.LOST}, tmp_path)
            pictures.append(pixels(look(client, "Mission", tmp_path)["Plan and run"][1]).astype(int))
    assert np.abs(pictures[0] - pictures[1]).mean() < 1.0


def test_plan_and_run_overlay(plan: Path, field: Path, tmp_path: Path) -> None:
    with viewer([plan, field]) as client:
        client.set_time("mission_time", duration=100.0, play_state="paused")
        for colour in (palette.KIND_COLOURS["walls"], palette.DRIVEN):
            assert_shown(client, "Mission", {"Plan and run": colour}, tmp_path)


@pytest.mark.parametrize(("timeline", "view", "colour"), [
    ("candidate", "What a candidate sees (timeline: candidate)", palette.SEEN.colour),
    ("stage_step", "Selection (timeline: stage_step)", palette.NEW.colour),
])  # fmt: skip
def test_planning_is_played_on_its_own_timelines(
    timeline: str, view: str, colour: palette.Colour, plan_viewer: ViewerClient, tmp_path: Path
) -> None:
    plan_viewer.set_time(timeline, sequence=1, play_state="paused")
    assert_shown(plan_viewer, "Planning", {view: colour}, tmp_path)


def test_a_viewer_follows_a_run_that_is_being_recorded(
    tmp_path: Path, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    with ExitStack() as opened:
        clients: list[ViewerClient] = []

        def start(address: str) -> None:
            clients.append(opened.enter_context(viewer(["--connect", address])))

        with Viewed(FieldRecording(tmp_path / "field.rrd"), start) as record:
            record.mission(mission)
            assert_shown(clients[0], "Mission", {"Plan and run": palette.ROUTE}, tmp_path)
            for report in run.reports(mission):
                hand_over(record, report)
            assert_shown(clients[0], "Mission", {"Plan and run": palette.DRIVEN}, tmp_path)


def assert_shown(
    client: ViewerClient, tab: str, colours: dict[str, palette.Colour | None], into: Path
) -> None:
    """No view of the tab reports anything, and before long each named one shows its colour."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        views = look(client, tab, into)
        assert not {name: view.reports for name, (view, _) in views.items() if view.reports}
        missing = {name for name, colour in colours.items() if not shows(views[name][1], colour)}
        if not missing:
            return
        assert time.monotonic() < deadline, f"{tab}: {missing} not shown"


def shows(picture: Path, colour: palette.Colour | None) -> bool:
    """Whether at least ten pixels have the colour, but for rounding; without one, whether it is not blank."""
    if colour is None:
        return len(np.unique(pixels(picture).astype(np.int64) @ (1, 256, 256**2))) > 20
    away = np.abs(pixels(picture).astype(int) - colour[:3]).max(axis=1)
    return int((away <= 3).sum()) >= 10


def pixels(picture: Path) -> np.ndarray:
    return np.asarray(Image.open(picture).convert("RGB")).reshape(-1, 3)
