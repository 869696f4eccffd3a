"""Tests of batches on a cluster: workers that get an entry, and workers or a scheduler that go."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, cast

import pytest

from stopgo.batches import cluster_engine
from stopgo.batches.cluster_engine import ClusterEngine
from stopgo.batches.content import computed_by
from stopgo.batches.engine import Running
from stopgo.batches.work import BASE_BYTES, PlanOutcome, PlanTask
from stopgo.mission.errors import InputError, OutcomeUnknown
from stopgo.mission.settings import Settings

ADDRESS = "tcp://127.0.0.1:8786"
SAME = computed_by()


class FakeClient:
    """A dask client whose workers are as a test needs them; entries end when the test says so."""

    made: ClassVar[list[FakeClient]] = []
    workers: ClassVar[dict[str, Mapping[str, Any]]] = {}
    versions: ClassVar[dict[str, str | Exception]] = {}

    def __init__(self, address: str, timeout: str) -> None:
        self.status = "running"
        self.given: list[tuple[str, list[str], Future[PlanOutcome]]] = []
        self.asked: list[str] = []
        FakeClient.made.append(self)

    def scheduler_info(self, n_workers: int) -> Mapping[str, Any]:
        return {"workers": dict(self.workers)}

    def run(self, function: Callable[[], str], workers: Sequence[str], on_error: str) -> dict[str, Any]:
        self.asked += workers
        return {address: self.versions.get(address, SAME) for address in workers}

    def get_executor(self, *, pure: bool, workers: list[str]) -> Any:
        def submit(function: object, task: PlanTask) -> Future[PlanOutcome]:
            future: Future[PlanOutcome] = Future()
            future.add_done_callback(lambda it: it.cancelled() and it.set_running_or_notify_cancel())
            self.given.append((task.name, workers, future))
            return future

        return SimpleNamespace(submit=submit)

    def close(self) -> None:
        self.status = "closed"


def worker(memory: float = 8e9, threads: int = 1) -> Mapping[str, Any]:
    return {"memory_limit": memory, "nthreads": threads}


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Iterator[type[FakeClient]]:
    monkeypatch.setitem(sys.modules, "distributed", cast("Any", SimpleNamespace(Client=FakeClient)))
    monkeypatch.setattr(cluster_engine, "_must_answer", lambda address: None)
    monkeypatch.setattr(cluster_engine, "ASKED_EACH_S", 0.0)
    FakeClient.made, FakeClient.versions = [], {}
    FakeClient.workers = {"w1": worker()}
    yield FakeClient


def task(folder: Path, name: str = "a") -> PlanTask:
    floor = folder / f"{name}.dxf"
    floor.touch()
    return PlanTask(name=name, floor=floor, settings=Settings(), store=folder)


def ended(future: Future[PlanOutcome], name: str = "a") -> None:
    future.set_result(PlanOutcome(name=name, status="planned", exit_code=0))


@pytest.mark.parametrize(
    ("workers", "versions", "words"),
    [
        ({}, {}, "has no workers"),
        ({"w1": worker()}, {"w1": "older"}, "w1: has another stopgo (older) than this machine"),
        ({"w1": worker()}, {"w1": ModuleNotFoundError("stopgo")}, "w1: has another stopgo (none)"),
        ({"w1": worker(threads=4)}, {}, "w1: has 4 threads; start it with --nthreads 1"),
    ],
)
def test_a_cluster_without_a_worker_that_fits_is_refused(
    cluster: type[FakeClient],
    workers: dict[str, Mapping[str, Any]],
    versions: dict[str, str | Exception],
    words: str,
) -> None:
    cluster.workers, cluster.versions = workers, versions
    with pytest.raises(InputError) as refused:
        ClusterEngine(ADDRESS)
    assert words in str(refused.value)


def test_a_worker_that_does_not_fit_is_named_once_and_gets_no_entry(
    cluster: type[FakeClient], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cluster.workers, cluster.versions = {"w1": worker(), "w2": worker()}, {"w2": "older"}
    engine = ClusterEngine(ADDRESS)
    engine.look()
    engine.submit(0, task(tmp_path))
    assert [workers for _, workers, _ in cluster.made[0].given] == [["w1"]]
    assert capsys.readouterr().err.count("w2: has another stopgo (older)") == 1


def test_an_entry_goes_where_its_memory_fits_and_the_second_time_where_most_is(
    cluster: type[FakeClient], tmp_path: Path
) -> None:
    cluster.workers = {"small": worker(0.5 * BASE_BYTES), "large": worker(4e9), "larger": worker(8e9)}
    engine = ClusterEngine(ADDRESS)
    engine.submit(0, task(tmp_path))
    engine.submit(1, task(tmp_path, "b"), roomiest=True)
    assert [workers for _, workers, _ in cluster.made[0].given] == [["large", "larger"], ["larger"]]


def test_an_entry_that_fits_nowhere_goes_to_the_roomiest_worker(
    cluster: type[FakeClient], tmp_path: Path
) -> None:
    cluster.workers = {"small": worker(0.1 * BASE_BYTES), "larger": worker(0.2 * BASE_BYTES)}
    ClusterEngine(ADDRESS).submit(0, task(tmp_path))
    assert cluster.made[0].given[0][1] == ["larger"]


def test_workers_that_come_later_are_asked_once_and_get_entries(
    cluster: type[FakeClient], tmp_path: Path
) -> None:
    engine = ClusterEngine(ADDRESS)
    assert engine.slots == 2
    cluster.workers = {"w1": worker(), "w2": worker()}
    engine.look()
    engine.look()
    assert engine.slots == 4
    assert cluster.made[0].asked == ["w1", "w2"]


def test_an_entry_whose_workers_are_all_gone_is_tried_on_others(
    cluster: type[FakeClient], tmp_path: Path
) -> None:
    engine = ClusterEngine(ADDRESS)
    running = Running(engine, [task(tmp_path)])

    def goes_on() -> None:
        given = cluster.made[0].given
        if len(given) == 1:
            cluster.workers = {"w2": worker()}
        elif not given[1][2].done():
            ended(given[1][2])

    running.waiting = goes_on
    assert [outcome.status for outcome in running.outcomes()] == ["planned"]
    assert [workers for _, workers, _ in cluster.made[0].given] == [["w1"], ["w2"]]


def test_a_scheduler_that_is_started_again_gets_the_entries_again(
    cluster: type[FakeClient], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    running = Running(ClusterEngine(ADDRESS), [task(tmp_path)])

    def goes_on() -> None:
        first = cluster.made[0]
        if first.status == "running":
            first.status = "closed"
            first.given[0][2].cancel()
        elif len(cluster.made) > 1 and not cluster.made[1].given[0][2].done():
            ended(cluster.made[1].given[0][2])

    running.waiting = goes_on
    assert [outcome.status for outcome in running.outcomes()] == ["planned"]
    assert running._tries == {"a": 1}, "the entry has no part in the loss"
    assert "is back with 1 workers" in capsys.readouterr().err


def test_a_scheduler_that_stays_away_ends_the_batch_as_unknown(
    cluster: type[FakeClient], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine = ClusterEngine(ADDRESS)

    def nobody(address: str) -> None:
        raise InputError("not reached")

    now = [0.0]
    clock = SimpleNamespace(monotonic=lambda: now[0], sleep=lambda s: now.__setitem__(0, now[0] + s))
    monkeypatch.setattr(cluster_engine, "time", clock)
    monkeypatch.setattr(cluster_engine, "_must_answer", nobody)
    engine._client.status = "closed"
    with pytest.raises(OutcomeUnknown, match="is offline; call the batch again"):
        list(Running(engine, [task(tmp_path)]).outcomes())
    assert now[0] >= cluster_engine.PATIENCE_S
