"""Tests of `stopgo batch` from its file to the folders, the record and the page."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

import stopgo
from stopgo.batches import engine
from stopgo.batches.futures import PlannedBatch
from stopgo.batches.record import EntryRecord, read_record
from stopgo.batches.work import work
from tests.batches.halls import batch_file, hall
from tests.batches.inline_engine import InlineEngine
from tests.called import stopgo as called

TWO = '[[floors]]\nfiles = "*.dxf"'


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A folder with two floors and a batch of both."""
    hall(tmp_path / "a.dxf")
    hall(tmp_path / "b.dxf", width=8.0)
    batch_file(tmp_path, TWO)
    return tmp_path


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the entries be planned by the test's own process, which has loaded everything."""
    monkeypatch.setattr(engine, "LocalEngine", lambda workers: InlineEngine(workers, work))


def batch(site: Path, *options: str) -> tuple[int, dict[str, Any], str]:
    done = called(
        "batch", str(site / "plans.toml"), "-o", str(site / "out"), "--workers", "1", "--json", *options
    )
    return done.returncode, json.loads(done.stdout) if done.stdout.startswith("{") else {}, done.stderr


def statuses(record: dict[str, Any]) -> dict[str, str]:
    return {item["name"]: item["status"] for item in record["entries"]}


@pytest.mark.usefixtures("in_this_process")
def test_a_batch_is_planned_once_and_again_only_where_it_changed(site: Path) -> None:
    code, record, _ = batch(site)
    assert code == 0
    assert statuses(record) == {"a": "planned", "b": "planned"}
    direct = called("plan", str(site / "b.dxf"), "-o", str(site / "direct"))
    assert direct.returncode == 0
    for name in ("mission.json", "coverage.json", "plan.svg"):
        assert (site / "direct" / name).read_bytes() == (site / "out" / "b" / name).read_bytes(), name
    assert "a.dxf" not in (site / "out" / "b" / "plan.log").read_text()

    code, record, _ = batch(site)
    assert (code, statuses(record)) == (0, {"a": "kept", "b": "kept"})
    hall(site / "a.dxf", note="issued again")
    hall(site / "b.dxf", width=12.0)
    why = called("batch", str(site / "plans.toml"), "-o", str(site / "out"), "--why", "b")
    assert "b: would be planned again: outline: changed" in why.stdout
    code, record, _ = batch(site)
    assert statuses(record) == {"a": "kept", "b": "planned"}
    changed = {item["name"]: item["changed"] for item in record["entries"]}
    assert changed["a"] == ""
    assert "stop" in changed["b"] or "same figures" in changed["b"]
    why = called("batch", str(site / "plans.toml"), "-o", str(site / "out"), "--why", "b")
    assert "b: was planned because: outline: changed" in why.stdout

    page = (site / "out" / "index.html").read_text()
    assert "1 planned now, 1 unchanged" in page
    assert (site / "out" / "batch.csv").read_text().count("\n") == 3


@pytest.mark.usefixtures("in_this_process")
def test_an_entry_that_cannot_be_planned_leaves_the_others(site: Path) -> None:
    (site / "c.dxf").write_text("no drawing")
    code, record, error = batch(site)
    assert code == 2
    assert statuses(record) == {"a": "planned", "b": "planned", "c": "failed"}
    assert f"c: {site / 'c.dxf'}" in error
    page = (site / "out" / "index.html").read_text()
    assert "Failed" in page


@pytest.mark.usefixtures("in_this_process")
def test_faults_of_the_file_are_reported_before_anything_is_planned(site: Path) -> None:
    batch_file(site, TWO + '\n[[floors]]\nfiles = "x.dxf"')
    code, record, error = batch(site)
    assert (code, record["error"]["exit_code"] if "error" in record else 2) == (2, 2)
    assert "x.dxf: no such file" in error
    assert "1 fault, 2 sound entries; correct the file" in error
    assert not (site / "out" / "a").exists()
    code, record, _ = batch(site, "--skip-faulty")
    assert (code, statuses(record)) == (2, {"a": "planned", "b": "planned"})


@pytest.mark.usefixtures("in_this_process")
def test_a_fault_of_a_table_names_its_place_once(site: Path) -> None:
    batch_file(site, TWO + '\n[[floors]]\nfiles = "a.dxf"\nstoreys = [1]')
    code, _, error = batch(site, "--dry-run")
    assert code == 2
    assert f"stopgo: {site / 'plans.toml'}: line" in error


def test_a_dry_run_lists_the_entries_and_plans_nothing(site: Path) -> None:
    code, record, _ = batch(site, "--dry-run")
    assert code == 0
    assert [item["entry"] for item in record["entries"]] == ["a", "b"]
    assert not (site / "out" / "a").exists()


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize("option", [("--store-gb", "nan"), ("--store-gb", "inf"), ("--unused-for", "²d")])
def test_sizes_and_ages_that_are_none_are_refused_before_anything_is_planned(
    option: tuple[str, str], site: Path
) -> None:
    """A size was first looked at when the last entry had been planned."""
    done = called("batch", str(site / "plans.toml"), "-o", str(site / "out"), "--gc", *option)
    assert done.returncode == 2 and option[0] in done.stderr
    assert not (site / "out").exists() or not (site / "out" / "a").exists()


@pytest.mark.usefixtures("in_this_process")
def test_old_results_are_removed_on_request(site: Path) -> None:
    batch(site)
    done = called("batch", str(site / "plans.toml"), "-o", str(site / "out"), "--gc", "--store-gb", "0")
    assert "removed 2 results" in done.stdout
    assert called("batch", "x", "-o", str(site / "out"), "--gc", "--unused-for", "soon").returncode == 2
    _, record, _ = batch(site)
    assert statuses(record) == {"a": "planned", "b": "planned"}


@pytest.mark.usefixtures("in_this_process")
def test_a_batch_from_python_has_a_future_for_each_entry(site: Path) -> None:
    made = stopgo.batch(site / "plans.toml", site / "out", workers=1)
    assert sorted(made.futures) == ["a", "b"]
    assert made.futures["b"].result().stops
    assert made.wait()
    assert "<table" in made._repr_html_()
    assert read_record(site / "out") is not None


def test_a_notebook_shows_the_table_as_it_grows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    place = SimpleNamespace(update=shown.append)

    def display(html: str, *, display_id: bool) -> object:
        shown.append(html)
        return place

    fake = SimpleNamespace(display=display, HTML=str)
    monkeypatch.setitem(sys.modules, "IPython.display", cast("Any", fake))
    futures: dict[str, Future[EntryRecord]] = {"a": Future(), "b": Future()}
    made = PlannedBatch(futures, tmp_path, threading.Thread(), threading.Event())
    made._ipython_display_()
    futures["b"].set_result(EntryRecord(name="b", floor="b.dxf", place="", status="planned"))
    futures["a"].cancel()
    assert len(shown) == 3
    assert ">b<" not in shown[0]
    assert ">b<" in shown[1]


@pytest.mark.skipif(sys.platform == "win32", reason="a signal that only POSIX has")
def test_a_killed_batch_goes_on_where_it_was(site: Path) -> None:
    arguments = ["batch", str(site / "plans.toml"), "-o", str(site / "out"), "--workers", "1"]
    first = subprocess.Popen([sys.executable, "-m", "stopgo", *arguments])
    results = site / "out" / ".store" / "results"
    while not list(results.glob("*/*/result.json")) and first.poll() is None:
        with suppress(subprocess.TimeoutExpired):
            first.wait(timeout=0.02)
    first.send_signal(signal.SIGKILL)
    first.wait()
    code, record, _ = batch(site)
    assert code == 0
    counts = list(statuses(record).values())
    assert set(counts) <= {"planned", "kept"}
    assert counts.count("kept") >= 1
    assert len(list(results.glob("*/*/result.json"))) == 2, "none twice"


def test_a_batch_on_a_cluster_gives_the_same_bytes(site: Path) -> None:
    distributed = pytest.importorskip("distributed")
    direct = called("plan", str(site / "a.dxf"), "-o", str(site / "direct"))
    assert direct.returncode == 0
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        done = called(
            *("batch", str(site / "plans.toml"), "-o", str(site / "far"), "--json"),
            *("--scheduler", cluster.scheduler_address),
        )
    assert statuses(json.loads(done.stdout)) == {"a": "planned", "b": "planned"}
    for name in ("mission.json", "coverage.json", "plan.svg"):
        assert (site / "far" / "a" / name).read_bytes() == (site / "direct" / name).read_bytes(), name


def test_a_cluster_that_is_not_there_is_one_line(site: Path) -> None:
    pytest.importorskip("distributed")
    code, _, error = batch(site, "--scheduler", "tcp://127.0.0.1:9")
    assert code == 2
    assert "--scheduler tcp://127.0.0.1:9: not reached" in error
    assert "give an address" in batch(site, "--scheduler", "here")[2]
