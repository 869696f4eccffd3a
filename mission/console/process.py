"""The process of a command: a signal ends it through every open `with`, and so does a closed output pipe.

Imports nothing slow, so that signals are handled while everything else is loaded.
"""

from __future__ import annotations

import _thread
import atexit
import os
import select
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType, TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from concurrent.futures import Executor, ProcessPoolExecutor

ENDING = ("SIGINT", "SIGTERM", "SIGHUP")
"""Signals that end a command: Ctrl-C, a service manager, a terminal that was closed."""
PIPE_CLOSED = 141
"""Exit code after a closed output pipe: 128 plus the number of SIGPIPE, which not every system has."""

RAISED_AGAIN_S = 0.05
LOOK_S = 0.5
"""Interval at which a wait looks for signals."""


class Signals:
    """Handles the signals that end a command, during the block; `first` is the first of them.

    Interrupted code may raise another error, as some modules do during their import. The caller can
    recognise that by `first`.

    With `whole_process` the process ends with the block, and further signals kill it at once.
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
        for number in ending_signals():
            if signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
                self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, signal.SIG_DFL if self._whole_process else handler)  # type: ignore[arg-type]

    @property
    def exit_code(self) -> int:
        """Exit code of a process that a signal has ended."""
        return 128 + int(self.first or 0)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self.first = self.first or signal.Signals(number)
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + number)


def wait_for(event: threading.Event) -> None:
    """Wait for an event in the main thread, without missing a signal that another thread got.

    Such a signal ends no wait without a timeout, and is handled in the main thread alone. The system gives a
    signal to any thread of a process that goes on after it was frozen.
    """
    while not event.wait(LOOK_S):
        pass


@contextmanager
def without_ctrl_c() -> Iterator[None]:
    """Keep Ctrl-C from the processes that are started in the block, also while they load: this one ends them.

    In this process a Ctrl-C counts after the block.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # started in the block, it would let Ctrl-C through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def ended_at_once(pool: ProcessPoolExecutor) -> Iterator[None]:
    """Wait for a pool's processes at the end of the block; after an error or a signal, kill them."""
    try:
        yield
    except BaseException:
        kill_workers(pool)
        raise
    pool.shutdown()


def kill_workers(pool: Executor) -> None:
    """End a pool's processes in the middle of their work."""
    processes = list((getattr(pool, "_processes", None) or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.kill()


def ending_signals() -> list[signal.Signals]:
    """Return the signals of ENDING that this system has."""
    return [getattr(signal, name) for name in ENDING if hasattr(signal, name)]


def _raise_again(lost: sys.UnraisableHookArgs) -> None:
    """Raise a Ctrl-C again that came in code that cannot raise, such as a destructor."""
    if isinstance(lost.exc_value, KeyboardInterrupt):
        # Later and from elsewhere: here it would be lost again.
        threading.Timer(RAISED_AGAIN_S, _thread.interrupt_main).start()
    else:
        sys.__unraisablehook__(lost)


class ProcessEnd:
    """The end of this process once `code` is set: after its threads and exit functions, at once.

    To free all memory piece by piece would take 0.1 s, in which Ctrl-C ends a process without a line. Make it
    before other exit functions are registered: the first one runs last.
    """

    def __init__(self) -> None:
        self.code: int | None = None
        """The exit code; None leaves the end to Python, which shows the error."""
        atexit.register(self._leave)

    def _leave(self) -> None:
        if self.code is None:
            return
        with suppress(OSError, ValueError):  # what exit functions printed
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(self.code)


def output_is_closed() -> bool:
    """True if the command's output has no reader any more."""
    if not hasattr(select, "poll"):
        return True
    poll = select.poll()
    for number in (1, 2):
        poll.register(number, 0)
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in poll.poll(0))


def drop_output() -> None:
    """Discard the rest of the output, which cannot be printed."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number in (1, 2):
        os.dup2(nowhere, number)


def have_output() -> None:
    """Open missing output streams, so that no file of ours gets their numbers."""
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)
            setattr(sys, name, open(number, "w", encoding="utf-8", closefd=False))  # noqa: SIM115
