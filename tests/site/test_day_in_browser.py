"""A site engineer's day in a real browser: after the first command everything is done on the page."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from stopgo.site.web_server import SiteOptions, serving_site
from tests.ports import free_port
from tests.site.chromium import Browser, Tab, browser, needs_chromium
from tests.site.two_rooms import two_rooms

ROOT = Path(__file__).parents[2]
pytestmark = needs_chromium


@contextmanager
def command(folder: Path, ready: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A stopgo command in its own process, from the line on stderr that begins so until the block ends."""
    process = subprocess.Popen(
        [sys.executable, "-m", "stopgo", *arguments], cwd=folder, stderr=subprocess.PIPE, text=True,
        stdout=(folder / f"{arguments[0]}.out").open("w"), env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert process.stderr is not None
    try:
        for line in process.stderr:
            if line.startswith(ready):
                break
        yield process
    finally:
        process.kill()
        process.communicate()


def robot(folder: Path, endpoint: str, *more: str) -> AbstractContextManager[subprocess.Popen[str]]:
    """A simulated robot."""
    return command(folder, "ready", "robot", "--name", "r1", "--listen", endpoint, "--state", "r1", *more)


FAST = ("--speed-up", "60")


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with browser() as started:
        yield started


def state_is(tab: Tab, *words: str) -> None:
    """Wait until the card of the first robot has one of the states."""
    listed = "[" + ",".join(f"'{word}'" for word in words) + "]"
    tab.until(f"{listed}.includes(document.querySelector('.card .state')?.textContent)")


def plan_and_push(tab: Tab) -> None:
    """Plan the only floor of the folder, save the plan, and push it to the robot."""
    tab.run("location.hash = '#plan'")
    tab.shows("32 m², 2 rooms, 1 openings")
    tab.press("Plan")
    tab.press("Save")
    tab.shows("Saved as plans/house/mission.json")
    tab.run("location.hash = '#live'")
    tab.press("Push mission")
    tab.shows("The robot holds no mission.", ".difference")
    tab.press("Push to r1")
    state_is(tab, "ready")


def test_a_day_from_the_floor_to_the_report(chromium: Browser, tmp_path: Path) -> None:
    """Plan, save, push, start, skip a stop, finish, read the report, and plan what is missing."""
    endpoint, place = f"tcp/127.0.0.1:{free_port()}", tmp_path / "site"
    place.mkdir()
    two_rooms(place / "house.dxf")
    options = SiteOptions(place, endpoint, commander="anna", port=free_port())
    blocked = (*FAST, "--fault", "blocked@2")
    with robot(tmp_path, endpoint, *blocked), serving_site(options, say=lambda line: None) as address:
        tab = chromium.tab(address)
        state_is(tab, "idle")
        plan_and_push(tab)
        tab.press("Start")
        tab.shows("Started by anna", ".events")
        state_is(tab, "HELD")
        tab.shows("HELD: ", ".card .reason")
        tab.press("Skip stop")
        tab.press("Skip stop", ".question button")
        tab.shows("skipped", ".events")
        state_is(tab, "finished")
        tab.until("document.querySelectorAll('.map .stop.done').length > 0")
        tab.until("document.querySelectorAll('.map .stop.skipped').length == 1")
        tab.until("document.querySelector('.map .target.lost').getAttribute('d').length > 0")
        tab.run("location.hash = '#back'")
        tab.shows("Report of 1 runs")
        tab.shows("NO", ".missions td")
        report = tab.run("fetch(document.querySelector('a.primary').href).then((one) => one.text())")
        assert "skipped" in report
        tab.press("Plan what is missing")
        tab.shows("1 stops for what is missing: plans/house/follow-up/mission.json")
        assert tab.problems == []
        own = address.partition("#")[0]
        assert [one for one in tab.requested if not one.startswith((own, "data:"))] == []
        tab.close()


def test_stop_is_sent_heard_and_standing_also_from_the_keyboard(chromium: Browser, tmp_path: Path) -> None:
    endpoint, place = f"tcp/127.0.0.1:{free_port()}", tmp_path / "site"
    place.mkdir()
    two_rooms(place / "house.dxf")
    options = SiteOptions(place, endpoint, commander="anna", port=free_port())
    with serving_site(options, say=lambda line: None) as address:
        tab = chromium.tab(address)
        with robot(tmp_path, endpoint) as driven:
            state_is(tab, "idle")
            tab.run("document.getElementById('stop').click()")
            tab.shows("refused", "#stopped")
            plan_and_push(tab)
            tab.press("Start")
            state_is(tab, "running")
            for _ in range(2):
                for kind in ("keyDown", "keyUp"):
                    tab.call("Input.dispatchKeyEvent", type=kind, key="Escape", code="Escape")
            tab.until(
                "/sent .* heard .* standing /.test(document.querySelector('#stopped .good')?.innerText)"
            )
            state_is(tab, "paused")
            second_person(chromium, tab, place, endpoint)
            driven.send_signal(signal.SIGSTOP)
            tab.until("document.querySelector('.card.old .age')")
            tab.run("document.getElementById('stop').click()")
            tab.shows("UNKNOWN", "#stopped .bad")
            assert tab.run("document.getElementById('stop').disabled") is False
            driven.send_signal(signal.SIGCONT)
        tab.close()


def second_person(chromium: Browser, tab: Tab, place: Path, endpoint: str) -> None:
    """Another person's page names who commands the robot, and asks before it takes over."""
    options = SiteOptions(place, endpoint, commander="berta", port=free_port())
    with serving_site(options, say=lambda line: None) as address:
        theirs = chromium.tab(address)
        theirs.shows("anna commands it.")
        theirs.press("Resume")
        theirs.shows("anna commands r1. Take it over?", ".question")
        theirs.press("Take over")
        tab.shows("berta commands it.")
        tab.shows("Resumed by berta", ".events")
        assert theirs.problems == []
        theirs.close()


def test_a_killed_server_misses_nothing(chromium: Browser, tmp_path: Path) -> None:
    """The run goes on, and the page catches up every event once the server is there again."""
    endpoint, place, port = f"tcp/127.0.0.1:{free_port()}", tmp_path / "site", str(free_port())
    place.mkdir()
    two_rooms(place / "house.dxf")
    site = ("site", "site", "--connect", endpoint, "--port", port, "--as", "anna")
    with robot(tmp_path, endpoint, *FAST):
        with command(tmp_path, "open it", *site) as first:
            tab = chromium.tab((tmp_path / "site.out").read_text().split(": ", 1)[1].strip())
            state_is(tab, "idle")
            plan_and_push(tab)
            tab.press("Start")
            tab.shows("Started by anna", ".events")
            first.kill()
        tab.until("!document.getElementById('offline').hidden")
        with command(tmp_path, "open it", *site):
            tab.until("document.getElementById('offline').hidden")
            state_is(tab, "finished")
            stops = tab.until("document.querySelectorAll('.map .stop').length")
            lines = "[...document.querySelectorAll('.events li')].map((one) => one.innerText)"
            tab.until(f"{lines}.filter((one) => one.includes(': scanned')).length == {stops}")
            assert "Started by anna" in tab.run(lines)[-1]
        tab.close()
