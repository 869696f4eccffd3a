"""Pieces of something large, several under way at once: as many as fill the line, and hardly more.

A line of long round trips stands idle where each piece waits for the answer to the last one. One piece too
many lies in somebody's buffer instead, and an order that comes after it waits for it. So what is under way
follows what the answers take: the shortest that was seen is that of an empty line (as TCP Vegas has it:
Brakmo and Peterson, 1995), and the rest is what lies in the way.
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
"""Answers that come as soon as this make one piece after the other quick enough."""
FIRST = 4
"""Pieces that a line of longer round trips is tried with."""
MOST = 128
"""Of 32 kB, what 40 Mbit/s hold at 800 ms."""
FEWEST_WAIT, MOST_WAIT = 0.3, 1.0
"""Pieces that lie in the way: with fewer, one more is sent; with more, one less."""
ROUGH_S = 0.01
"""Answers differ by so much without anything in their way."""

P = TypeVar("P")
T = TypeVar("T")


class Window:
    """How many pieces may be under way.

    While the line is being tried there are at most twice as many in each round of answers: as many as it
    holds, going by how soon after one another answers come.
    """

    def __init__(self, round_trip_s: float) -> None:
        """`round_trip_s` is what a small question has just taken."""
        self._size = 1.0 if round_trip_s < QUICK_S else float(FIRST)
        self._least_s = math.inf
        self._round: list[float] | None = []
        """When the pieces of this round were answered; none once the line has been tried."""

    @property
    def size(self) -> int:
        return int(self._size)

    def answered(self, took_s: float, at_s: float) -> None:
        """Learn from an answer, how long it took and when it came."""
        self._least_s = min(self._least_s, took_s)
        if took_s < QUICK_S:
            return
        if self._round is not None:
            self._try(self._round, at_s)
        else:
            self._keep(self._size * max(0.0, took_s - self._least_s - ROUGH_S) / took_s)
        self._size = min(max(self._size, 1.0), float(MOST))

    def _try(self, answers: list[float], at_s: float) -> None:
        answers.append(at_s)
        if len(answers) < max(2, self.size):
            return
        apart_s = statistics.median(after - before for before, after in pairwise(answers))
        holds = self._least_s / max(apart_s, 1e-6)
        self._round = [] if holds > 2 * self._size else None
        self._size = min(holds, 2 * self._size)

    def _keep(self, waiting: float) -> None:
        if waiting > MOST_WAIT:
            self._size -= 1 / self._size
        elif waiting < FEWEST_WAIT:
            self._size += 1 / self._size


@dataclass(frozen=True)
class SentPiece(Generic[P, T]):
    """A piece, and what it was answered with or what went wrong."""

    number: int
    piece: P
    answer: T | None
    error: BaseException | None
    took_s: float
    at_s: float

    def got(self) -> tuple[P, T]:
        """The piece and its answer; raises what went wrong."""
        if self.error is not None:
            raise self.error
        return self.piece, cast(T, self.answer)


def windowed(pieces: Iterable[P], ask: Callable[[P], T], window: Window) -> Iterator[tuple[P, T]]:
    """Every piece in order, with what `ask` gives for it; that is called on threads, several at a time.

    What it raises is raised here; what else is under way is then let go.
    """
    done: queue.SimpleQueue[SentPiece[P, T]] = queue.SimpleQueue()
    waiting = enumerate(pieces)
    ahead: dict[int, SentPiece[P, T]] = {}
    under_way = told = 0
    while True:
        for number, piece in islice(waiting, max(0, window.size - under_way)):
            under_way += 1
            begin = partial(_ask, number, piece, ask, done)
            begin() if window.size == 1 else threading.Thread(target=begin, daemon=True).start()
        if not under_way:
            return
        asked = done.get()
        under_way -= 1
        window.answered(asked.took_s, asked.at_s)
        ahead[asked.number] = asked
        while told in ahead:
            yield ahead.pop(told).got()
            told += 1


def _ask(number: int, piece: P, ask: Callable[[P], T], done: queue.SimpleQueue[SentPiece[P, T]]) -> None:
    began = time.monotonic()
    answer, error = None, None
    try:
        answer = ask(piece)
    except BaseException as raised:  # noqa: BLE001 (the end of a thread; raised again where it is waited for)
        error = raised
    at_s = time.monotonic()
    done.put(SentPiece(number, piece, answer, error, at_s - began, at_s))
