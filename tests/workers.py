"""Runs test files in several processes that are copies of one, which alone imports and collects everything.

``pytest -p tests.workers --workers 8``. Started anew, each process would import all libraries and collect all
tests again: ten seconds of a processor for each. Every worker takes one file after another from one queue.

A copy has no threads but its own. Rerun asks its viewers and servers in threads that begin at its import: the
original runs the files with such a test (marked ``rerun_threads``), meanwhile.
"""

from __future__ import annotations

import os
import queue
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Iterator, Sequence
from itertools import groupby
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any

import pytest

NUMBER = "STOPGO_TEST_WORKER"
"""The variable that tells a test which worker runs it."""

CAN_COPY = sys.platform == "linux"
"""Elsewhere one process runs all tests: a copy with threads breaks on macOS, and Windows makes none."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """So many processes, or this one alone."""
    parser.addoption("--workers", type=int, default=0, help="run test files in so many processes")


def pytest_load_initial_conftests() -> None:
    """Before any library is imported: several threads that compute would only wait for one processor."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Run all tests in workers, where processes can be copied."""
    options = session.config.option
    if not (options.workers and CAN_COPY) or options.collectonly:
        return None
    if session.testsfailed and not options.continue_on_collection_errors:
        raise session.Interrupted(f"{session.testsfailed} errors during collection")
    reporter = session.config.pluginmanager.getplugin("terminalreporter")
    if reporter is not None:
        reporter.showfspath = False  # results of many files come mixed
    _Workers(session).run(options.workers)
    return True


class _Workers:
    """The processes at work, and the tests that each of them has taken and not finished."""

    def __init__(self, session: pytest.Session) -> None:
        self.session = session
        numbered = groupby(enumerate(session.items), key=lambda numbered: file_of(numbered[1]))
        self.files = [[number for number, _ in group] for _, group in numbered]
        here = [any(map(self._needs_threads, file)) for file in self.files]
        self.own = [
            number for file, is_here in zip(self.files, here, strict=True) if is_here for number in file
        ]
        self.queue, entrance = os.pipe()
        os.write(entrance, b"".join(number.to_bytes(2, "big") for number, own in enumerate(here) if not own))
        os.close(entrance)
        self.left: dict[Connection, list[int]] = {}
        self.processes: dict[Connection, tuple[int, int]] = {}
        self.told: queue.SimpleQueue[tuple[Connection, Any]] = queue.SimpleQueue()
        self.base = session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]

    def _needs_threads(self, number: int) -> bool:
        return self.session.items[number].get_closest_marker("rerun_threads") is not None

    def run(self, count: int) -> None:
        """Run the tests of this process; pass every report of every worker on, until all have ended."""
        for number in range(count):
            self._start(number, [])
        for here in self.processes:
            self._listen(here)
        try:
            items = [self.session.items[number] for number in self.own]
            for item, following in zip(items, [*items[1:], None], strict=False):
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
                while not self.told.empty():
                    self._hear()
            while self.processes:
                self._hear()
        finally:
            for process, _ in self.processes.values():
                os.kill(process, signal.SIGTERM)

    def _start(self, number: int, first: Sequence[int]) -> Connection:
        """Copy this process; the copy runs the ``first`` tests, then files of the queue."""
        here, there = Pipe(duplex=False)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python's, of a copy without threads
            process = os.fork()
        if process == 0:
            for other in (here, *self.processes):
                other.close()
            _end_with(_work, self.session, there, self._taken(there, first), self.base / f"w{number}", number)
        there.close()
        self.processes[here] = process, number
        self.left[here] = list(first)
        return here

    def _listen(self, here: Connection) -> None:
        """Let no worker wait while this process runs a test."""

        def listen() -> None:
            try:
                while True:
                    self.told.put((here, here.recv()))
            except EOFError:
                self.told.put((here, None))

        threading.Thread(target=listen, daemon=True).start()

    def _taken(self, there: Connection, first: Sequence[int]) -> Iterator[pytest.Item]:
        """In the worker: its tests, a file at a time."""
        taken = first
        while True:
            for number in taken:
                yield self.session.items[number]
            if not (record := os.read(self.queue, 2)):
                return
            taken = self.files[int.from_bytes(record, "big")]
            there.send(("took", taken))

    def _hear(self) -> None:
        """Do what one message of a worker asks for; without one, it has ended."""
        hook = self.session.config.hook
        here, message = self.told.get()
        if message is None:
            self._bury(here)
            return
        what, content = message
        if what == "took":
            self.left[here] += content
        elif what == "ran":
            self.left[here].pop(0)
            for one in content:
                self._report(one)
        else:
            hook.pytest_warning_recorded.call_historic(kwargs=content)
        if self.session.shouldfail:
            raise self.session.Failed(self.session.shouldfail)

    def _report(self, told: pytest.TestReport | dict[str, Any]) -> None:
        """Pass the result of one phase of a test on."""
        hook, config = self.session.config.hook, self.session.config
        report = (
            hook.pytest_report_from_serializable(config=config, data=told) if isinstance(told, dict) else told
        )
        hook.pytest_runtest_logreport(report=report)

    def _bury(self, here: Connection) -> None:
        """The test that a worker died in has failed; another worker goes on behind it."""
        process, number = self.processes.pop(here)
        here.close()
        status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        left = self.left.pop(here)
        if not left:
            return
        item = self.session.items[left[0]]
        report = pytest.TestReport(
            item.nodeid, item.location, {}, "failed", f"the worker ended here with {status}", "call"
        )
        self.session.config.hook.pytest_runtest_logreport(report=report)
        self._listen(self._start(number, left[1:]))


def file_of(item: pytest.Item) -> object:
    """The item's file, or the name of files that have parsed the same sources for their tests."""
    together = item.get_closest_marker("together")
    return together.args if together else item.path


class _Teller:
    """In a worker: what pytest would tell the terminal goes to the process that has it."""

    def __init__(self, config: pytest.Config, there: Connection) -> None:
        self._config = config
        self._there = there
        self._reports: list[Any] = []
        self._heard_before = True
        config.pluginmanager.register(self)  # which repeats every warning so far
        self._heard_before = False

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep the result of one phase of a test; a failed one holds objects of any class."""
        serializable = self._config.hook.pytest_report_to_serializable
        self._reports.append(report if report.passed else serializable(config=self._config, report=report))

    def ran(self) -> None:
        """Send all results of a test at once."""
        self._there.send(("ran", self._reports))
        self._reports = []

    def pytest_warning_recorded(
        self, warning_message: warnings.WarningMessage, when: str, nodeid: str, location: Any
    ) -> None:
        """Send a warning in words: its object may be of any class."""
        if self._heard_before:
            return
        words = UserWarning(f"{warning_message.category.__name__}: {warning_message.message}")
        plain = warnings.WarningMessage(words, UserWarning, warning_message.filename, warning_message.lineno)
        told = {"warning_message": plain, "when": when, "nodeid": nodeid, "location": location}
        self._there.send(("warned", told))


def _work(
    session: pytest.Session, there: Connection, items: Iterator[pytest.Item], folder: Path, number: int
) -> None:
    """Run the tests, with a folder and captured output of this process alone."""
    config = session.config
    os.environ[NUMBER] = str(number)
    folder.mkdir(exist_ok=True)
    config._tmp_path_factory._basetemp = folder  # type: ignore[attr-defined]
    config.pluginmanager.unregister(name="terminalreporter")
    if (capture := config.pluginmanager.getplugin("capturemanager")) is not None:
        capture.stop_global_capturing()
        capture.start_global_capturing()
        capture.suspend_global_capture()
    teller = _Teller(config, there)
    item = next(items, None)
    while item is not None:
        following = next(items, None)
        config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        teller.ran()
        if session.shouldfail or session.shouldstop:
            break
        item = following


def _end_with(work: Any, *arguments: Any) -> None:
    """Do this and end the process, which is a copy: nothing of the original's end may run in it."""
    status = 1
    try:
        work(*arguments)
        status = 0
    except KeyboardInterrupt:
        pass
    except BaseException:  # noqa: BLE001 (the end of a process)
        traceback.print_exc()
    finally:
        os._exit(status)
