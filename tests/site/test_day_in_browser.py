"""A site engineer's day in a real browser: after the first command everything is done on the page."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from stopgo.site.web_server import SiteOptions, serving_site
from tests.bridge.world import corridor
from tests.ports import free_port
from tests.site.chromium import Tab, browser, needs_chromium

ROOT = Path(__file__).parents[2]


@contextmanager
def robot(folder: Path, name: str, endpoint: str, *more: str) -> Iterator[subprocess.Popen[str]]:
    """A simulated robot in its own process, until the block ends."""
    process = subprocess.Popen(
        [sys.executable, "-m", "stopgo", "robot", "--name", name, "--listen", endpoint, "--state", name,
         "--speed-up", "60", *more],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stderr is not None
    try:
        for line in process.stderr:
            if line.startswith("ready"):
                break
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=120)


def state_is(tab: Tab, *words: str) -> None:
    """Wait until the card of the first robot has one of the states."""
    listed = "[" + ",".join(f"'{word}'" for word in words) + "]"
    tab.until(f"{listed}.includes(document.querySelector('.card .state')?.textContent)")


@needs_chromium
def test_a_robot_is_pushed_started_and_stopped_on_the_page(tmp_path: Path) -> None:
    from stopgo.mission.files.mission_json import write

    endpoint, place = f"tcp/127.0.0.1:{free_port()}", tmp_path / "site"
    place.mkdir()
    write(corridor(), place / "mission.json")
    options = SiteOptions(place, endpoint, commander="anna", port=free_port())
    with (
        robot(tmp_path, "r1", endpoint),
        serving_site(options, say=lambda line: None) as address,
        browser() as chromium,
    ):
        tab = chromium.tab(address)
        state_is(tab, "idle")
        tab.press("Push mission")
        tab.shows("The robot holds no mission. It gets 3 stops.", ".difference")
        tab.press("Push to r1")
        state_is(tab, "ready")
        tab.press("Start")
        tab.shows("Started by anna", ".events")
        tab.run("document.getElementById('stop').click()")
        tab.shows("standing", "#stopped .good")
        state_is(tab, "paused")
        second = chromium.tab(address.partition("#")[0])
        second.shows("Started by anna", ".events")
        second.press("Resume")
        state_is(tab, "running", "finished", "driving home")
        assert tab.problems == second.problems == []
        assert all(one.startswith(address.partition("#")[0]) for one in tab.requested)
