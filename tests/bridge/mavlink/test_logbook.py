"""The folder in which a station remembers a vehicle."""

from __future__ import annotations

import multiprocessing
from functools import partial
from pathlib import Path

import pytest

from bridge.journal import open_journal
from bridge.mavlink.desk.logbook import Logbook, logbook, name_of, remember, usual_folder
from bridge.mavlink.line.url import Url
from bridge.run import Change, Run, changed
from mission.errors import InputError
from mission.events import Paused
from mission.mavlink.translate import translate
from tests.bridge.mavlink.site import tour

URL = Url("udpout", "127.0.0.1", 14550)


def counted(book: Logbook) -> None:
    """One step of a run that counts its attempts."""

    def step(run: Run) -> tuple[Change, ...]:
        return (Change(changed(run, attempt=run.attempt + 1), (partial(Paused, reason="counted"),)),)

    book.move(step)


def count_often(folder: Path, times: int) -> None:
    with logbook(URL, 1, folder) as book:
        for _ in range(times):
            counted(book)


def test_processes_at_once_tell_one_story(tmp_path: Path) -> None:
    spawn = multiprocessing.get_context("spawn")
    workers = [spawn.Process(target=count_often, args=(tmp_path, 25)) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    with logbook(URL, 1, tmp_path) as book:
        assert book.run.attempt == 75
        assert [event.number for event in book.journal.events()] == list(range(1, 76))


def test_a_robot_and_a_station_do_not_share_a_folder(tmp_path: Path) -> None:
    robots, stations = partial(open_journal, tmp_path, name_of(1)), partial(logbook, URL, 1, tmp_path)
    for one, other in ((robots, stations), (stations, robots)):
        with one(), pytest.raises(InputError, match="in use"), other():
            pass


def test_what_was_sent_is_remembered_item_by_item(tmp_path: Path) -> None:
    mission = tour()
    sent = translate(mission, "px4")
    with logbook(URL, 1, tmp_path) as book:
        assert book.course is None
        remember(book, mission, sent)
    with logbook(URL, 1, tmp_path) as book:
        assert book.course is not None
        assert book.course.mission == mission
        assert repr(book.course.sent) == repr(sent)
        assert (book.run.state, book.run.mission_id) == ("READY", mission.id)


def test_a_vehicle_whose_clock_begins_later_was_started_anew(tmp_path: Path) -> None:
    with logbook(URL, 1, tmp_path) as book:
        now_ns = book.clock.now_ns()
        assert not book.booted(now_ns)
        first = book.boot_id
        assert not book.booted(now_ns + 10**9)
        assert not book.booted(now_ns - 10**9)
        assert book.boot_id == first
        assert book.booted(now_ns + 10 * 10**9)
        assert book.boot_id != first


def test_the_usual_folder_is_named_by_url_and_vehicle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    folder = usual_folder(Url("serial", "/dev/ttyACM0", 57600), 3)
    assert folder == tmp_path / "stopgo" / "serial-dev-ttyACM0-57600-vehicle-3"
