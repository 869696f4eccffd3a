"""Second process for a part of the work, forked from this one: nothing is copied to it first.

The result is the same with and without a second process. Where none can be forked, or it has ended without
a result, the work is done when its result is needed.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import os
import pickle
import select
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any, Generic, TypeVar

import numpy as np

from stopgo.mission.console.freed_memory import give_back
from stopgo.mission.console.running_step import TICKING
from stopgo.mission.geometry import frozen

T = TypeVar("T")
Argument = TypeVar("Argument")
GIVING_WAY = 5
"""Niceness of work that gives way: it has a third of the weight of others."""
PR_SET_PDEATHSIG = 1
"""Option of Linux's prctl: the signal that a process gets when its parent ends."""


class SideWork(Generic[T]):
    """Work that goes on at the same time as other work; the end of the block ends it."""

    def __init__(
        self,
        work: Callable[[], T],
        *,
        forked: bool,
        again: Callable[[], T] | None = None,
        after: SideWork[Any] | None = None,
        gives_way: bool = False,
    ) -> None:
        """Begin the work in a process of its own if `forked`, and if this process can be forked.

        `again` is done if that process ends without a result: what the work holds is then not kept. The
        process waits until that of the work `after` answers, so that both do not take more than one core.
        One that gives way is for a result that is needed much later: others get more of the cores.
        """
        self._work, self._process, self._answer, self._gives_way = work, 0, -1, gives_way
        self._before = -1 if after is None else after._answer
        self._found: list[T] = []
        if forked and can_fork():
            self._fork()
            self._work = work if again is None or not self._process else again

    @property
    def is_apart(self) -> bool:
        """True until the result is there, if another process does the work."""
        return self._process != 0

    @property
    def is_beside(self) -> bool:
        """True if another process has begun with it, so that its result costs nothing here."""
        return self._process > 0 or bool(self._found)

    def result(self) -> T:
        """The result, also when it is requested again; an error of the work is raised."""
        if not self._found:
            data = self._answered()
            self._found.append(pickle.loads(data) if data else self._work())
        return self._found[0]

    def __enter__(self) -> SideWork[T]:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def _fork(self) -> None:
        self._answer, end = os.pipe()
        process, parent = 0, os.getpid()
        give_back()  # what is free would be used, and so copied, by both
        with contextlib.suppress(OSError):  # too many processes, or too little memory
            process = os.fork()
            if not process:
                self._serve(end, parent)
        os.close(end)
        self._process = process

    def _serve(self, end: int, parent: int) -> None:
        """In the other process: do the work, and answer; it never returns."""
        try:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            _end_with(parent)
            os.close(self._answer)
            if self._gives_way:
                os.nice(GIVING_WAY)
            if self._before >= 0:
                select.select([self._before], [], [])  # there is something to read, or its process has ended
            with open(os.devnull, "w") as nowhere, contextlib.redirect_stderr(nowhere):
                data = _pickled(self._work())  # a thread may have held the lock of the real one
            with open(end, "wb") as answer:
                answer.write(data)
        finally:
            os._exit(0)  # an error is raised again where the work is then done

    def _answered(self) -> bytes:
        """The answer of the other process, once it has ended; empty if there is none or it has failed."""
        if not self._process:
            return b""
        with open(self._answer, "rb", closefd=False) as answer:
            data = answer.read()
        self._end()
        return data

    def _end(self) -> None:
        if self._answer >= 0:
            os.close(self._answer)
        if self._process:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._process, signal.SIGKILL)
            with contextlib.suppress(ChildProcessError):  # where SIGCHLD is ignored it has gone by itself
                os.waitpid(self._process, 0)
        self._process, self._answer = 0, -1


def in_halves(
    work: Callable[[Sequence[Argument]], list[T]], items: Sequence[Argument], *, forked: bool
) -> list[T]:
    """Return the results of items, in their order; another process finds those of the second half."""
    middle = len(items) // 2 if forked else len(items)
    with SideWork(lambda: work(items[middle:]), forked=forked) as rest:
        return [*work(items[:middle]), *rest.result()]


class _ResultPickler(pickle.Pickler):
    """Pickles results; arrays that are read-only stay so."""

    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, np.ndarray) and not value.flags.writeable:
            return frozen, (value.copy(), value.dtype)
        return NotImplemented


def _pickled(value: object) -> bytes:
    file = io.BytesIO()
    _ResultPickler(file, protocol=pickle.HIGHEST_PROTOCOL).dump(value)
    return file.getvalue()


def can_fork() -> bool:
    """True on Linux with several cores, for a process whose threads hold nothing that the work needs.

    Other threads do not outlive a fork, and their locks are never released.
    """
    others = [thread for thread in threading.enumerate() if thread.name != TICKING]
    alone = others == [threading.main_thread()]
    return sys.platform == "linux" and len(os.sched_getaffinity(0)) > 1 and alone


def _end_with(parent: int) -> None:
    """Let this process end with the one that forked it, also if that is killed; on Linux."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(signal.SIGKILL))
    if os.getppid() != parent:
        os._exit(0)
