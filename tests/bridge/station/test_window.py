"""Pieces on their way fill a line, and little more: on lines that exist only as numbers."""

from __future__ import annotations

import heapq
import threading
from collections import Counter

import pytest

from stopgo.bridge.station.window import FIRST, QUICK_S, Window, windowed

PIECE_BITS = 32 * 1024 * 8


def sent_s(window: Window, *, pieces: int, bits_per_s: float, round_trip_s: float) -> tuple[float, float]:
    """Seconds that so many pieces take, and the longest that one lay before the line once it was known."""
    piece_s, now, free_at, longest = PIECE_BITS / bits_per_s, 0.0, 0.0, 0.0
    under_way: list[tuple[float, float]] = []
    begun = 0
    while begun < pieces or under_way:
        while begun < pieces and len(under_way) < window.size:
            if begun > pieces / 2:
                longest = max(longest, free_at - now)
            free_at = max(free_at, now) + piece_s
            heapq.heappush(under_way, (free_at + round_trip_s, now))
            begun += 1
        now, asked = heapq.heappop(under_way)
        window.answered(now - asked, now)
    return now, longest


@pytest.mark.parametrize("bits_per_s", [64e3, 256e3, 1e6, 8e6, 40e6])
@pytest.mark.parametrize("round_trip_s", [0.03, 0.3, 0.8])
def test_the_line_is_full_within_a_tenth_and_hardly_anything_waits_for_it(
    bits_per_s: float, round_trip_s: float
) -> None:
    took, longest = sent_s(
        Window(round_trip_s), pieces=4000, bits_per_s=bits_per_s, round_trip_s=round_trip_s
    )
    alone = 4000 * PIECE_BITS / bits_per_s + 5 * round_trip_s  # in which it is tried
    assert took < 1.1 * alone
    assert longest < 2.5 * PIECE_BITS / bits_per_s + 0.03


def test_a_line_that_carries_less_than_it_did_is_not_filled_any_further() -> None:
    window = Window(0.3)
    sent_s(window, pieces=500, bits_per_s=8e6, round_trip_s=0.3)
    before = window.size
    _, longest = sent_s(window, pieces=500, bits_per_s=1e6, round_trip_s=0.3)
    assert window.size < before
    assert longest < 4 * PIECE_BITS / 1e6


def test_where_answers_come_at_once_there_is_one_piece_after_the_other() -> None:
    window, threads = Window(QUICK_S / 2), Counter[str]()

    def ask(piece: int) -> None:
        threads[threading.current_thread().name] += 1

    assert [piece for piece, _ in windowed(range(50), ask, window)] == list(range(50))
    assert threads == {threading.current_thread().name: 50}


def test_pieces_come_in_order_whichever_is_answered_first() -> None:
    last = threading.Event()

    def ask(piece: int) -> int:
        if piece == FIRST - 1:
            last.set()
        assert last.wait(60.0)
        return 10 * piece

    assert list(windowed(range(9), ask, Window(1.0))) == [(piece, 10 * piece) for piece in range(9)]


def test_what_one_piece_raises_is_raised() -> None:
    def ask(piece: int) -> int:
        if piece == 2:
            raise ValueError("piece 2")
        return piece

    told = windowed(range(9), ask, Window(1.0))
    assert [next(told), next(told)] == [(0, 0), (1, 1)]
    with pytest.raises(ValueError, match="piece 2"):
        next(told)
