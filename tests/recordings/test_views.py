"""Every view of a plan, a run and both draws a picture and reports nothing wrong."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rerun.experimental import View, ViewerClient

from stopgo.bridge.station.watch import hand_over
from stopgo.mission.document import Mission
from stopgo.recordings.drawing import palette
from stopgo.recordings.embedded.reading import read_recording
from stopgo.recordings.runs.field import FieldRecording
from stopgo.recordings.viewing.viewer import Viewed
from tests.recordings import run, world
from tests.recordings.conftest import write_field, write_plan
from tests.recordings.pictures import LIMIT, WRONG, difference, fields, kept
from tests.recordings.viewer import PATIENCE_S, has_vulkan, look, viewer

pytestmark = [
    pytest.mark.rerun_threads,
    pytest.mark.skipif(
        not has_vulkan(), reason="no Vulkan driver: install mesa-vulkan-drivers to look at recordings"
    ),
]

WINDOW = "1200x750"
SMALL = "800x500"
"""Where no picture is compared with a kept one: what is drawn in software takes its time by the pixel."""
Moment = tuple[str, dict[str, Any]]
END: Moment = ("mission_time", {"play_state": "following"})
"""The end of the mission, where a recording opens."""
AFTER: Moment = ("mission_time", {"play_state": "paused", "duration": 100.0})


def step(timeline: str, number: int) -> Moment:
    return timeline, {"play_state": "paused", "sequence": number}


VIEWS: dict[str, dict[str, tuple[Moment, dict[str, palette.Colour | None]]]] = {
    "plan": {
        "Mission": (END, {"Plan and run": palette.ROUTE, "3D": palette.ROUTE, "Report": None}),
        "Planning": (step("stage_step", 4), {
            "Step by step (timeline: stage_step)": palette.NEW.colour,
            "This step (timeline: stage_step)": None,
            "Coverage, % (timeline: stage_step)": palette.GREEN,
        }),
        "Stops": (step("stop", 2), {
            "Why this stop (timeline: stop)": palette.LOST,
            "In words (timeline: stop)": None,
        }),
        "Candidates": (step("candidate", 1), {
            "Navigable space and candidates": palette.STOP_AREA,
            "What a candidate sees (timeline: candidate)": palette.SEEN.colour,
        }),
        "Run": (END, {
            "States": None,
            "Distance from the route, mm (left positive)": palette.FAILED.colour,
            "Deviation at each stop, mm": palette.FAILED.colour,
            "Battery, %": palette.FAILED.colour,
        }),
        "Log": (END, {"Log": None}),
    },
    "field": {
        "Mission": (AFTER, {"Plan and run": palette.DRIVEN, "3D": palette.DRIVEN, "Report": None}),
        "Run": (AFTER, {
            "States": None,
            "Distance from the route, mm (left positive)": palette.DRIVEN,
            "Deviation at each stop, mm": palette.FAILED.colour,
            "Battery, %": palette.DRIVEN,
        }),
        "Log": (AFTER, {"Log": None}),
    },
}  # fmt: skip
"""Views by tab, when they are looked at, and a colour that each must show."""


@pytest.fixture(scope="module")
def plan_viewer(plan: Path) -> Iterator[ViewerClient]:
    with viewer([plan], size=WINDOW) as client:
        yield client


def test_every_view_of_a_plan_shows_its_subject(plan_viewer: ViewerClient, tmp_path: Path) -> None:
    assert_every_view_shown(plan_viewer, "plan", tmp_path)


def test_every_view_of_a_run_shows_its_subject(field: Path, tmp_path: Path) -> None:
    with viewer([field], size=WINDOW) as client:
        assert_every_view_shown(client, "field", tmp_path)


def test_no_view_of_a_plan_opens_empty(plan_viewer: ViewerClient, tmp_path: Path) -> None:
    """It opens at the mission's end, whichever timeline a view is best looked at on; the others are shown."""
    set_time(plan_viewer, END)
    for tab, (moment, colours) in VIEWS["plan"].items():
        if moment != END:
            assert_shown(plan_viewer, tab, dict.fromkeys(colours), tmp_path)


def set_time(client: ViewerClient, moment: Moment) -> None:
    timeline, of_it = moment
    client.set_time(timeline, **of_it)


def assert_every_view_shown(client: ViewerClient, which: str, into: Path) -> None:
    """Each looks as it did when somebody looked at it; emptied, turned over or recoloured it would not."""
    for tab, (moment, colours) in VIEWS[which].items():
        set_time(client, moment)
        views = assert_shown(client, tab, colours, into, which)
        for name, colour in colours.items():
            found, expected = fields(views[name][1]), fields(kept(picture_name(which, name)))
            for wrong, spoilt in WRONG.items():
                if colour is not None or wrong == "empty":
                    assert difference(spoilt(found), expected) > LIMIT, f"{name}: {wrong}"


def drawn_views(into: Path) -> Iterator[tuple[str, Path]]:
    """Every view and its picture, once it has settled."""
    mission: Mission = world.nouns_at()[-1]
    files = {"plan": write_plan(into / "plan.rrd"), "field": write_field(into / "field.rrd", mission)}
    for which, path in files.items():
        with viewer([path], size=WINDOW) as client:
            time.sleep(10.0)  # what the viewer first tells of itself is gone
            for tab, (moment, colours) in VIEWS[which].items():
                set_time(client, moment)
                views = assert_shown(client, tab, colours, into)
                yield from ((picture_name(which, name), views[name][1]) for name in colours)


def picture_name(which: str, view: str) -> str:
    return "-".join([which, *re.findall(r"\w+", view.partition(" (")[0])])


def test_what_was_lost_is_shown_over_the_floor(sighted: Path, mission: Mission, tmp_path: Path) -> None:
    """A run with a skip that was recorded with its plan shows floor and loss, without the plan's own file."""
    field = tmp_path / "field.rrd"
    with FieldRecording(field, mission, plan=read_recording(sighted)) as recording:
        for report in run.reports_with_a_skip(mission, "S2"):
            hand_over(recording, report)
    with viewer([field], size=SMALL) as client:
        for colour in (palette.LOST, palette.KIND_COLOURS["walls"], palette.DRIVEN):
            assert_shown(client, "Mission", {"Plan and run": colour}, tmp_path)


def test_a_viewer_follows_a_run_that_is_being_recorded(
    tmp_path: Path, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    with ExitStack() as opened:
        clients: list[ViewerClient] = []

        def start(address: str) -> None:
            clients.append(opened.enter_context(viewer(["--connect", address], size=SMALL)))

        with Viewed(FieldRecording(tmp_path / "field.rrd"), start) as record:
            record.mission(mission)
            assert_shown(clients[0], "Mission", {"Plan and run": palette.ROUTE}, tmp_path)
            for report in run.reports(mission):
                hand_over(record, report)
            assert_shown(clients[0], "Mission", {"Plan and run": palette.DRIVEN}, tmp_path)


def assert_shown(
    client: ViewerClient, tab: str, colours: Mapping[str, palette.Colour | None], into: Path, which: str = ""
) -> dict[str, tuple[View, Path]]:
    """No view of the tab reports anything, and before long each named one shows its colour.

    With `which`, each also looks like the picture that is kept of it.
    """
    deadline = time.monotonic() + PATIENCE_S
    while True:
        views = look(client, tab, into)
        assert not {name: view.reports for name, (view, _) in views.items() if view.reports}
        missing = {name for name, colour in colours.items() if not shows(views[name][1], colour)}
        if which:
            missing |= {name for name in colours if _difference(views[name][1], which, name) > LIMIT}
        if not missing:
            return views
        assert time.monotonic() < deadline, f"{tab}: {missing} not shown"


def _difference(picture: Path, which: str, view: str) -> float:
    return difference(fields(picture), fields(kept(picture_name(which, view))))


def shows(picture: Path, colour: palette.Colour | None) -> bool:
    """Return True if at least ten pixels have the colour; without a colour, if the picture is not blank."""
    if colour is None:
        return len(np.unique(pixels(picture).astype(np.int64) @ (1, 256, 256**2))) > 20
    away = np.abs(pixels(picture).astype(int) - colour[:3]).max(axis=1)
    return int((away <= 3).sum()) >= 10


def pixels(picture: Path) -> np.ndarray:
    return np.asarray(Image.open(picture).convert("RGB")).reshape(-1, 3)
