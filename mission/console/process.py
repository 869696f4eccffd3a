"""The process of a command: a signal ends it by way of every open `with`, and so does a reader that has gone.

Imports nothing that takes time, so that it stands while everything else is being loaded.
"""

from __future__ import annotations

import _thread
import os
import select
import signal
import sys
import threading
from types import FrameType, TracebackType

ENDING = ("SIGINT", "SIGTERM", "SIGHUP")
"""What asks a command to end: Ctrl-C, a service manager, a terminal that was closed."""
PIPE_CLOSED = 141
"""As of every program whose reader has gone: 128 and the number of SIGPIPE, which not every system has."""

RAISED_AGAIN_S = 0.05


class Signals:
    """Heeds the signals that end a command, while the block runs; `first` is the one that came first.

    Code that is interrupted may raise something else, as some modules do when their import is. Whoever
    catches what the block raises can tell that from an error by `first`.

    With `whole_process` the process is at its end behind the block, and further signals just kill it.
    """

    def __init__(self, *, whole_process: bool) -> None:
        self.first: signal.Signals | None = None
        self._whole_process = whole_process
        self._before: dict[signal.Signals, object] = {}

    def __enter__(self) -> Signals:
        if threading.current_thread() is not threading.main_thread():
            return self
        if self._whole_process:
            sys.unraisablehook = _raise_again
        for number in _ending():
            if signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
                self._before[number] = signal.signal(number, self._heed)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, signal.SIG_DFL if self._whole_process else handler)  # type: ignore[arg-type]

    @property
    def exit_code(self) -> int:
        """Of a process that a signal has ended."""
        return 128 + int(self.first or 0)

    def _heed(self, number: int, frame: FrameType | None) -> None:
        self.first = self.first or signal.Signals(number)
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + number)


def _ending() -> list[signal.Signals]:
    """Those of ENDING that this system has."""
    return [getattr(signal, name) for name in ENDING if hasattr(signal, name)]


def _raise_again(lost: sys.UnraisableHookArgs) -> None:
    """Let no Ctrl-C be lost in code that cannot raise, such as the end of an object."""
    if isinstance(lost.exc_value, KeyboardInterrupt):
        # Later and from elsewhere: here it would be lost again.
        threading.Timer(RAISED_AGAIN_S, _thread.interrupt_main).start()
    else:
        sys.__unraisablehook__(lost)


def reader_is_gone() -> bool:
    """Whether nobody reads what the command prints any more."""
    if not hasattr(select, "poll"):
        return True
    poll = select.poll()
    for number in (1, 2):
        poll.register(number, 0)
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in poll.poll(0))


def drop_output() -> None:
    """Let what is still to be printed go nowhere, where it could not be printed."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number in (1, 2):
        os.dup2(nowhere, number)


def have_output() -> None:
    """Open what the process was started without, so that no file of ours takes its number."""
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)
            setattr(sys, name, open(number, "w", encoding="utf-8", closefd=False))  # noqa: SIM115
