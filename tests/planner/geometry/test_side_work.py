"""Work in a second process: the same result with it, without it, and after its death."""

from __future__ import annotations

import os
import signal
import sys
import threading
from functools import partial
from pathlib import Path

import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.settings import Settings
from stopgo.planner import pipeline
from stopgo.planner.geometry.side_work import GIVING_WAY, SideWork, in_halves
from stopgo.planner.overlap import boundary
from stopgo.planner.space import navigable
from tests.planner.worlds import two_rooms
from tests.waiting import wait_until


@pytest.fixture(autouse=True)
def _two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run with two cores, and without the threads that other tests have left behind."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1}, raising=False)
    running = threading.enumerate
    left_behind = {*running()} - {threading.main_thread()}
    monkeypatch.setattr(
        threading, "enumerate", lambda: [thread for thread in running() if thread not in left_behind]
    )


def _noted(place: Path) -> str:
    """Note the process that works."""
    with open(place, "a") as file:
        file.write(f"{os.getpid()}\n")
    return "done"


def _workers(place: Path) -> list[int]:
    return [int(line) for line in place.read_text().split()] if place.exists() else []


@pytest.mark.parametrize("forked", [True, False])
def test_work_is_done_once_in_the_process_asked_for(tmp_path: Path, *, forked: bool) -> None:
    place = tmp_path / "workers"
    with SideWork(partial(_noted, place), forked=forked) as work:
        assert work.is_beside == forked
        assert [work.result(), work.result()] == ["done", "done"]
    (worker,) = _workers(place)
    assert (worker != os.getpid()) == forked


def test_work_is_done_here_if_its_process_dies(tmp_path: Path) -> None:
    def die_in_another_process() -> str:
        if os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return _noted(tmp_path / "workers")

    here = os.getpid()
    with SideWork(die_in_another_process, forked=True) as work:
        assert work.result() == "done"
    assert _workers(tmp_path / "workers") == [here]


def test_an_error_of_the_work_is_raised_where_its_result_is_asked_for() -> None:
    def fail() -> str:
        raise InputError("no floor")

    with SideWork(fail, forked=True) as work, pytest.raises(InputError, match="no floor"):
        work.result()


def test_the_end_of_the_block_ends_the_work(tmp_path: Path) -> None:
    def work_for_ever() -> None:
        _noted(tmp_path / "workers")
        threading.Event().wait()

    with SideWork(work_for_ever, forked=True):
        wait_until(lambda: _workers(tmp_path / "workers"))
    with pytest.raises(ProcessLookupError):
        os.kill(_workers(tmp_path / "workers")[0], 0)


def test_work_begins_once_that_before_it_has_answered(tmp_path: Path) -> None:
    def work_when_allowed() -> str:
        wait_until((tmp_path / "allowed").exists)
        return _noted(tmp_path / "workers")

    with (
        SideWork(work_when_allowed, forked=True) as one,
        SideWork(lambda: len(_workers(tmp_path / "workers")), forked=True, after=one) as other,
    ):
        (tmp_path / "allowed").touch()
        assert [other.result(), one.result()] == [1, "done"]


def test_work_is_done_again_in_another_way_if_its_process_dies() -> None:
    def die() -> str:
        os.kill(os.getpid(), signal.SIGKILL)
        return "never"

    with SideWork(die, forked=True, again=lambda: "again") as work:
        assert work.result() == "again"


def test_a_process_with_other_threads_is_not_forked(tmp_path: Path) -> None:
    ended = threading.Event()
    other = threading.Thread(target=ended.wait)
    other.start()
    with SideWork(partial(_noted, tmp_path / "workers"), forked=True) as work:
        assert work.result() == "done"
    ended.set()
    other.join()
    assert _workers(tmp_path / "workers") == [os.getpid()]


@pytest.mark.parametrize(("fov", "refine"), [(360.0, False), (360.0, True), (270.0, False)])
def test_a_plan_is_the_same_with_a_second_process(
    monkeypatch: pytest.MonkeyPatch, fov: float, *, refine: bool
) -> None:
    plans = []
    for many in (0, 10**9):
        monkeypatch.setattr(pipeline, "MANY", many)
        monkeypatch.setattr(navigable, "MANY", many)
        monkeypatch.setattr(boundary, "MANY", many)
        plans.append(pipeline.plan(two_rooms(0.9), Settings(d_dis=0.1, refine=refine, fov=fov)))
    forked, alone = plans
    assert forked.figures == alone.figures
    assert forked.mission == alone.mission
    assert not forked.space.targets.a.flags.writeable


@pytest.mark.parametrize("fov", [360.0, 270.0])
def test_a_plan_is_the_same_where_second_processes_end_without_a_result(
    monkeypatch: pytest.MonkeyPatch, fov: float
) -> None:
    """The lines of sight without limits, which only such a process needs, are found again then."""
    settings = Settings(d_dis=0.1, fov=fov, refine=False)
    alone = pipeline.plan(two_rooms(0.9), settings)
    assert alone.figures.quality is not None
    monkeypatch.setattr(pipeline, "MANY", 0)
    monkeypatch.setattr(SideWork, "_serve", lambda *_: os._exit(0))
    again = pipeline.plan(two_rooms(0.9), settings)
    assert again.figures == alone.figures
    assert again.mission == alone.mission
    in_sight = again.parts[0].route.selection.visibility.in_sight
    assert in_sight is not None
    assert not len(in_sight.first)


def test_a_process_whose_end_was_taken_note_of_elsewhere_is_no_error() -> None:
    """A parent that ignores SIGCHLD passes that on, and children then go without being waited for."""
    before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        with SideWork(lambda: "done", forked=True) as work:
            assert work.result() == "done"
        with SideWork(lambda: "done", forked=True):
            pass
    finally:
        signal.signal(signal.SIGCHLD, before)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a process with its parent")
def test_what_a_killed_process_has_begun_ends_with_it(tmp_path: Path) -> None:
    place = tmp_path / "workers"

    def long_work() -> str:
        _noted(place)
        signal.alarm(60)
        signal.pause()
        return ""

    def nested() -> str:
        with SideWork(long_work, forked=True) as inner:
            return inner.result()

    with SideWork(nested, forked=True):
        wait_until(lambda: place.exists() and bool(_workers(place)))
        (worker,) = _workers(place)
    wait_until(lambda: not _runs(worker))


def _runs(process: int) -> bool:
    """True unless a process has ended; one that nobody has waited for has ended too."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("forked", [False, True])
def test_halves_keep_the_order_of_items(forked: bool) -> None:
    found = in_halves(lambda some: [(item, os.getpid()) for item in some], range(5), forked=forked)
    assert [item for item, _ in found] == [0, 1, 2, 3, 4]
    assert len({process for _, process in found}) == 1 + (forked and sys.platform == "linux")


def test_work_that_gives_way_has_less_of_the_cores() -> None:
    with SideWork(lambda: os.nice(0), forked=True, gives_way=True) as work:
        assert work.is_apart
        assert work.result() == os.nice(0) + GIVING_WAY
