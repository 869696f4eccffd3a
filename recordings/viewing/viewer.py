"""Rerun viewer on closed recordings, or on a run that is being recorded.

A viewer reads a file once and does not see it grow, so a live run is also sent to it while it is recorded.
Both listen on this machine only.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from stopgo.mission.console.ports import free_port
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import AnyEvent, Health, PoseReport, PosesMissing, ReportsMissing, StateReport
from stopgo.recordings.rrd.compact import VIEWER
from stopgo.recordings.runs.field import FieldRecording


def open_viewer(recordings: Sequence[Path]) -> None:
    """Show the recordings, and wait until the viewer is closed."""
    must_have_screen()
    code = subprocess.run(_command(list(map(str, recordings))), check=False).returncode
    if code != 0:
        raise InputError(f"the Rerun viewer ended with code {code}; without a screen leave out --view")


def start_viewer(address: str) -> None:
    """Show a live recording in a viewer that stays open, also after Ctrl-C here."""
    subprocess.Popen(
        _command(["--connect", address]),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def must_have_screen() -> None:
    """Refuse where no window can be shown.

    Raises
    ------
    InputError
        If there is no screen, or no viewer.
    """
    if not VIEWER.exists():
        raise InputError(f"--view: there is no Rerun viewer at {VIEWER}; install rerun-sdk again")
    screens = ("DISPLAY", "WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in screens):
        raise InputError(f"--view: no screen ({' and '.join(screens)} are not set); leave out --view")


def _command(what: Sequence[str]) -> list[str]:
    return [str(VIEWER), "--bind", "127.0.0.1", "--port", "auto", *what]


class Viewed:
    """Field recording with a viewer that opens once there is something to show."""

    def __init__(self, record: FieldRecording, start: Callable[[str], None] = start_viewer) -> None:
        self._record = record
        self._start = start
        self._port = free_port()
        self._shown = False

    def __enter__(self) -> Viewed:
        must_have_screen()
        self._record.serve(self._port)
        self._record.__enter__()
        return self

    def __exit__(self, *exception: object) -> None:
        self._record.__exit__(*exception)  # type: ignore[arg-type]

    def mission(self, mission: Mission) -> None:
        self._record.mission(mission)
        if not self._shown:
            self._shown = True
            self._start(f"rerun+http://127.0.0.1:{self._port}/proxy")

    def state(self, report: StateReport) -> None:
        self._record.state(report)

    def pose(self, report: PoseReport) -> None:
        self._record.pose(report)

    def event(self, event: AnyEvent) -> None:
        self._record.event(event)

    def health(self, health: Health) -> None:
        self._record.health(health)

    def missing(self, gap: PosesMissing) -> None:
        self._record.missing(gap)

    def incomplete(self, report: ReportsMissing) -> None:
        self._record.incomplete(report)
