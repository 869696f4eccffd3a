"""A recording begins with its plan: nothing waits for the plan, and nothing is missing before it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.run.events import Settled, Started
from stopgo.site.event_feed import EventFeed
from stopgo.site.known_missions import KnownMission
from stopgo.site.run_recording import RunRecording
from tests.bridge.world import corridor
from tests.site.test_shown_run import HERE, event

MISSION = corridor()


class Recorder:
    """Collectors of runs that note what they are given."""

    def __init__(self) -> None:
        self.taken: list[str] = []

    @contextmanager
    def open(self, robot: str, run_id: str, known: KnownMission | None) -> Iterator[Any]:
        self.taken.append(f"begin {run_id}")
        yield self
        self.taken.append("end")

    def mission(self, mission: Any) -> None:
        self.taken.append(f"mission {mission.id}")

    def event(self, report: Any) -> None:
        self.taken.append(type(report).__name__)


def recording(recorder: Recorder) -> RunRecording:
    return RunRecording("r1", EventFeed(), recorder.open, lambda mission, revision: MISSION)


def plan_reader() -> tuple[threading.Thread, threading.Event]:
    """A thread that reads a plan until it is allowed to end."""
    read = threading.Event()
    thread = threading.Thread(target=read.wait, daemon=True)
    thread.start()
    return thread, read


def test_what_is_reported_while_the_plan_is_read_is_recorded_after_it() -> None:
    recorder, (thread, read) = Recorder(), plan_reader()
    run = recording(recorder)
    run.begin("a", thread, lambda: None)
    run.take(event(Started, 1, commander="anna"))
    assert (recorder.taken, run.is_open) == ([], True)
    read.set()
    thread.join()
    run.take(event(Settled, 2, stop="s1", pose=HERE))
    run.close()
    assert recorder.taken == ["begin a", f"mission {MISSION.id}", "Started", "Settled", "end"]
    assert not run.is_open


def test_a_run_that_ends_before_its_plan_is_read_is_recorded() -> None:
    recorder, (thread, read) = Recorder(), plan_reader()
    run = recording(recorder)
    run.begin("a", thread, lambda: None)
    run.take(event(Started, 1, commander="anna"))
    threading.Timer(0.0, read.set).start()
    run.close()
    assert recorder.taken[-2:] == ["Started", "end"]


def test_a_recording_that_cannot_be_written_is_shown_once() -> None:
    def refuse(*about: object) -> Any:
        raise InputError("disk full")

    feed = EventFeed()
    run = RunRecording("r1", feed, refuse, lambda mission, revision: pytest.fail("no mission is needed"))
    run.begin("a", None, lambda: None)
    run.take(event(Started, 1, commander="anna"))
    run.close()
    assert feed.value("recording", "r1") == {"run": "a", "trouble": "disk full"}
