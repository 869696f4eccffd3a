"""The folder in which a station remembers a vehicle."""

from __future__ import annotations

import multiprocessing
from functools import partial
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.auto.logbook import Logbook, forget, logbook, name_of, remember, usual_folder
from stopgo.bridge.mavlink.auto.unfinished_run import check_run_over
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.robot.journal_file import open_journal
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Aborted, Paused
from stopgo.mission.run.states import Change, Run, changed, started
from tests.mission.mavlink.following.worlds import tour

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


def test_processes_at_once_agree(tmp_path: Path) -> None:
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
        assert book.listed is None
        remember(book, mission, sent)
    with logbook(URL, 1, tmp_path) as book:
        assert book.listed is not None
        assert book.listed.mission == mission
        assert repr(book.listed.sent) == repr(sent)
        assert (book.run.state, book.run.mission_id) == ("READY", mission.id)


def test_the_usual_folder_is_named_by_url_and_vehicle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    folder = usual_folder(Url("serial", "/dev/ttyACM0", 57600), 3)
    assert folder == tmp_path / "stopgo" / "serial-dev-ttyACM0-57600-vehicle-3"


def test_a_mission_that_was_cleared_is_forgotten_and_its_run_over(tmp_path: Path) -> None:
    mission = tour()
    with logbook(URL, 1, tmp_path) as book:
        remember(book, mission, translate(mission, "px4"))
        book.move(lambda run: (started(run, run_id="r", now_ns=0, by="me"),))
        forget(book)
        assert (book.run, book.listed) == (Run(), None)
        last = book.journal.events()[-1]
        assert isinstance(last, Aborted) and (last.run_id, last.mission_id) == ("r", mission.id)
        assert "cleared" in last.reason
        assert book.journal.has_run(mission.id, mission.revision)


@pytest.mark.parametrize("state", ["RUNNING", "PAUSED", "HELD"])
def test_a_mission_is_not_taken_from_under_a_run(state: str, tmp_path: Path) -> None:
    mission = tour()
    with logbook(URL, 1, tmp_path) as book:
        check_run_over("it", book, "a push")
        remember(book, mission, translate(mission, "px4"))
        check_run_over("it", book, "a push")
        book.move(lambda run: (started(run, run_id="r7", now_ns=0, by="me"),))
        book.move(lambda run: (Change(changed(run, state=state, done=("S1",))),))  # type: ignore[arg-type]
        with pytest.raises(NegativeResult) as no:
            check_run_over("it", book, "a push")
    said = str(no.value)
    assert f"run r7 of room (0123456789ab) is {state}, 1 of 3 stops done, and a push would end it" in said
    assert (
        f"stopgo abort --mavlink udpout:127.0.0.1:14550 --state {tmp_path})" in said
        and "--while-running" in said
    )
    assert "nothing was sent" in said and ("watch" in said) == (state == "RUNNING")
