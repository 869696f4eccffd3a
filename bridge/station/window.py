"""Transfer of chunks with a window: as many in flight as fill the link, and hardly more.

With one chunk at a time, a link of long round trips is idle while each chunk waits for its answer. Too many
chunks fill buffers, and delay a command that is sent after them. So the window follows the round trips, as in
TCP Vegas (Brakmo and Peterson, 1995). The shortest round trip is that of an empty link. The excess of the
others over it gives the number of chunks that wait in buffers.

Invariants of `Window`:
- `size` is between 1 and `MOST`; a link with quick answers keeps a size of 1.
- `_round` is a list while the link is being probed: times of the answers of this round. It is `None` after
  that.
- While probing, each round at most doubles the size. After that each answer changes it by at most 1 / size.
"""

from __future__ import annotations

import math
import queue
import statistics
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice, pairwise
from typing import Generic, TypeVar, cast

QUICK_S = 0.02
"""Round trips below this need no window: one chunk at a time is quick enough."""
FIRST = 4
"""First size of the window on a link of longer round trips."""
MOST = 128
"""Largest size of the window: chunks of 32 kB that 40 Mbit/s hold at 800 ms."""
FEWEST_WAITING, MOST_WAITING = 0.3, 1.0
"""Chunks that wait in buffers: with fewer the window grows, with more it shrinks."""
JITTER_S = 0.01
"""Variation of round trips on an empty link."""

C = TypeVar("C")
T = TypeVar("T")


class Window:
    """Number of chunks that may be in flight.

    While the link is being probed, each round of answers at most doubles it, up to the number that the link
    holds. That number follows from the time between answers.
    """

    def __init__(self, round_trip_s: float) -> None:
        """Start from the round trip of a small query, in seconds."""
        self._size = 1.0 if round_trip_s < QUICK_S else float(FIRST)
        self._least_s = math.inf
        self._round: list[float] | None = []
        """Times of the answers of this round; `None` once the link was probed."""

    @property
    def size(self) -> int:
        return int(self._size)

    def answered(self, took_s: float, at_s: float) -> None:
        """Adapt the window to an answer, which took `took_s` and came at `at_s`."""
        self._least_s = min(self._least_s, took_s)
        if took_s < QUICK_S:
            return
        if self._round is not None:
            self._probe(self._round, at_s)
        else:
            self._adjust(self._size * max(0.0, took_s - self._least_s - JITTER_S) / took_s)
        self._size = min(max(self._size, 1.0), float(MOST))

    def _probe(self, answers: list[float], at_s: float) -> None:
        answers.append(at_s)
        if len(answers) < max(2, self.size):
            return
        interval_s = statistics.median(after - before for before, after in pairwise(answers))
        capacity = self._least_s / max(interval_s, 1e-6)
        self._round = [] if capacity > 2 * self._size else None
        self._size = min(capacity, 2 * self._size)

    def _adjust(self, waiting: float) -> None:
        if waiting > MOST_WAITING:
            self._size -= 1 / self._size
        elif waiting < FEWEST_WAITING:
            self._size += 1 / self._size


@dataclass(frozen=True)
class AnsweredChunk(Generic[C, T]):
    """Chunk, and its answer or the error instead."""

    number: int
    chunk: C
    answer: T | None
    error: BaseException | None
    took_s: float
    at_s: float

    def value(self) -> tuple[C, T]:
        """Return the chunk and its answer; raise the error if there is one."""
        if self.error is not None:
            raise self.error
        return self.chunk, cast(T, self.answer)


def windowed(chunks: Iterable[C], ask: Callable[[C], T], window: Window) -> Iterator[tuple[C, T]]:
    """Yield every chunk in order with its answer by `ask`, which is called on several threads at a time.

    An error of `ask` is raised here; the answers of other chunks in flight are then ignored.
    """
    done: queue.SimpleQueue[AnsweredChunk[C, T]] = queue.SimpleQueue()
    unsent = enumerate(chunks)
    early: dict[int, AnsweredChunk[C, T]] = {}
    in_flight = yielded = 0
    while True:
        for number, chunk in islice(unsent, max(0, window.size - in_flight)):
            in_flight += 1
            begin = partial(_ask, number, chunk, ask, done)
            begin() if window.size == 1 else threading.Thread(target=begin, daemon=True).start()
        if not in_flight:
            return
        answered = done.get()
        in_flight -= 1
        window.answered(answered.took_s, answered.at_s)
        early[answered.number] = answered
        while yielded in early:
            yield early.pop(yielded).value()
            yielded += 1


def _ask(number: int, chunk: C, ask: Callable[[C], T], done: queue.SimpleQueue[AnsweredChunk[C, T]]) -> None:
    began = time.monotonic()
    answer, error = None, None
    try:
        answer = ask(chunk)
    except BaseException as raised:  # noqa: BLE001 (the end of a thread; raised again where it is waited for)
        error = raised
    at_s = time.monotonic()
    done.put(AnsweredChunk(number, chunk, answer, error, at_s - began, at_s))
