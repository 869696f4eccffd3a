"""Opens the Rerun viewer: on recordings that are closed, or on one that is still being written.

The viewer listens on this machine only. It follows a file that grows, so a run is seen as it is recorded.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from mission.document import Mission
from mission.errors import InputError
from mission.events import AnyEvent, PoseReport, StateReport
from recordings.compact import VIEWER
from recordings.field import FieldRecording


def open_viewer(recordings: Sequence[Path]) -> None:
    """Show the recordings, and wait until the viewer is closed."""
    must_have_screen()
    code = subprocess.run(_command(recordings), check=False).returncode
    if code != 0:
        raise InputError(f"the Rerun viewer ended with code {code}; without a screen leave out --view")


def start_viewer(recordings: Sequence[Path]) -> None:
    """Show the recordings in a viewer that stays open, also after Ctrl-C here."""
    subprocess.Popen(
        _command(recordings),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def must_have_screen() -> None:
    """
    Raises
    ------
    InputError
        If there is nothing to show a window on, or no viewer.
    """
    if not VIEWER.exists():
        raise InputError(f"--view: there is no Rerun viewer at {VIEWER}; install rerun-sdk again")
    screens = ("DISPLAY", "WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in screens):
        raise InputError(f"--view: no screen here ({' and '.join(screens)} are not set); leave out --view")


def _command(recordings: Sequence[Path]) -> list[str]:
    return [str(VIEWER), "--bind", "127.0.0.1", "--port", "auto", *map(str, recordings)]


class Viewed:
    """A field recording that is looked at: the viewer opens once there is something to be seen."""

    def __init__(
        self, record: FieldRecording, start: Callable[[Sequence[Path]], None] = start_viewer
    ) -> None:
        self._record = record
        self._start = start
        self._shown = False

    def __enter__(self) -> Viewed:
        must_have_screen()
        self._record.__enter__()
        return self

    def __exit__(self, *exception: object) -> None:
        self._record.__exit__(*exception)  # type: ignore[arg-type]

    def mission(self, mission: Mission) -> None:
        self._record.mission(mission)
        if not self._shown:
            self._shown = True
            self._record.canvas.stream.flush()
            self._start([being_written(self._record.path)])

    def state(self, report: StateReport) -> None:
        self._record.state(report)

    def pose(self, report: PoseReport) -> None:
        self._record.pose(report)

    def event(self, event: AnyEvent) -> None:
        self._record.event(event)


def being_written(path: Path) -> Path:
    """The file that becomes `path` when the recording is closed: the newest of the partial ones."""
    partial = path.parent.glob(f"{path.stem}.partial*.rrd")
    return max(partial, key=lambda file: file.stat().st_mtime_ns, default=path)
