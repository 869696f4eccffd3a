"""The running step on stderr: its line on a terminal and elsewhere, and its clean end."""

from __future__ import annotations

import io
import sys
import threading

import pytest

from stopgo.mission.console import running_step
from stopgo.mission.console.running_step import WIPE, RunningStep, running


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Closed(Terminal):
    def write(self, text: str) -> int:
        raise BrokenPipeError


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_a_terminal_names_the_step_at_once_and_then_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "20")
    terminal, clock = Terminal(), Clock()
    step = RunningStep(terminal, "reading f.dxf", clock)
    clock.now += 62
    step.show()
    step.begin("visibility\x1b[2J of a large floor")
    step.wipe()
    shown = terminal.getvalue().split(WIPE)
    assert shown == ["", "reading f.dxf", "reading f.dxf  1:02", "visibility\ufffd[2J of a", ""]


def test_elsewhere_a_long_step_has_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running_step, "PATIENCE_S", 5.0)
    log, clock = io.StringIO(), Clock()
    step = RunningStep(log, "reading f.dxf", clock)
    for passed in (0, 4.9, 5.0, 600):
        clock.now = 100 + passed
        step.show()
    step.begin("visibility")
    step.show()
    step.wipe()
    assert log.getvalue() == "reading f.dxf: running\n"


def test_a_message_replaces_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with running("visibility"):
        print("a warning", file=sys.stderr)
    assert sys.stderr is terminal
    assert terminal.getvalue() == f"{WIPE}visibility{WIPE}a warning\n"


def test_it_ends_with_the_block_whatever_ends_that(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt), running("visibility"):
        raise KeyboardInterrupt
    assert terminal.getvalue() == f"{WIPE}visibility{WIPE}"
    assert threading.active_count() == before


def test_a_closed_stderr_stops_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Closed())
    with running("visibility") as step:
        step.begin("selection")
        step.show()
