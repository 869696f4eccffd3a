"""The step that a command is working on, named on stderr while it runs."""

from __future__ import annotations

import contextlib
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from stopgo.mission.console.table import duration, printable

INTERVAL_S = 1.0
PATIENCE_S = 5.0
"""Duration after which a step is named where stderr is no terminal."""
WIPE = "\r\033[K"
TICKING = "running step"
"""Name of the thread that writes it; it holds nothing that other work needs."""


class RunningStep:
    """The running step: on a terminal one line that is rewritten, elsewhere one line for each long step."""

    def __init__(self, stream: TextIO, name: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream, self._clock = stream, clock
        self._terminal = stream.isatty()
        self._lock = threading.RLock()
        self._shown = False
        self.begin(name)

    def begin(self, name: str) -> None:
        """Name the step that begins, and count its time from now on."""
        with self._lock:
            self._name, self._begun, self._named = name, self._clock(), False
            if self._terminal:
                self.show()

    def progress(self, name: str) -> None:
        """Name the present part of the running step; its time goes on."""
        with self._lock:
            self._name = name

    def show(self) -> None:
        """Write the step with its time, if it is due."""
        with self._lock:
            passed = self._clock() - self._begun
            if self._terminal:
                line = (
                    f"{printable(self._name)}  {duration(passed)}" if passed >= 1 else printable(self._name)
                )
                self._write(f"{WIPE}{line[: shutil.get_terminal_size().columns - 1]}")
                self._shown = True
            elif passed >= PATIENCE_S and not self._named:
                self._write(f"{printable(self._name)}: running\n")
                self._named = True

    def wipe(self) -> None:
        """Remove the line from the terminal."""
        with self._lock:
            if self._shown:
                self._write(WIPE)
                self._shown = False

    def write(self, text: str) -> int:
        """Write a message on stderr in place of the line."""
        with self._lock:
            self.wipe()
            return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _write(self, text: str) -> None:
        with contextlib.suppress(OSError, ValueError, UnicodeError):  # closed, or of another character set
            self._stream.write(text)
            self._stream.flush()


@contextmanager
def running(name: str) -> Iterator[RunningStep]:
    """Name on stderr what runs in the block, at first `name`.

    Messages on stderr wipe the line first. Results go to stdout after the block.
    """
    before = sys.stderr
    step = RunningStep(before, name)
    ended = threading.Event()

    def tick() -> None:
        while not ended.wait(INTERVAL_S):
            step.show()

    if step.isatty():
        sys.stderr = step
    thread = threading.Thread(target=tick, name=TICKING, daemon=True)
    thread.start()
    try:
        yield step
    finally:
        sys.stderr = before
        ended.set()
        thread.join()
        step.wipe()
