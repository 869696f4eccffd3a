"""Best swap: the same as that of all swaps evaluated one by one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from stopgo.planner.selection import swaps
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.swaps import SwapBoard
from tests.faults.sizes import size


def cover_of_rooms(seed: int, *, rows: int = 24, columns: int = 70, rooms: int = 5, views: int = 1) -> Cover:
    """A problem whose rows see little beyond their own room; demands of the whole, of rooms, of two kinds."""
    random = np.random.Generator(np.random.PCG64(seed))
    room_of_row, room = random.integers(0, rooms, rows), random.integers(0, rooms, columns)
    chance = np.where(room_of_row[:, None] == room[None, :], 0.5, 0.03)
    sees = csr_array((random.random((rows, columns)) < chance).astype(np.int64))
    weight, kind = random.integers(1, 6, columns), random.integers(0, 2, columns)
    worth = np.zeros((1 + rooms + 2, columns), dtype=np.int64)
    worth[0], worth[1 + room, np.arange(columns)] = weight, weight
    worth[1 + rooms + kind, np.arange(columns)] = weight
    asked = random.integers(1, views + 1, columns)
    visible = np.minimum(asked, np.asarray(sees.sum(axis=0)).ravel()) >= asked
    needed = np.ceil((worth @ visible) * random.choice([0.5, 0.7, 0.9], len(worth))).astype(np.int64)
    return Cover(sees, csr_array(worth), needed, asked)


def _by_trial(cover: Cover, rows: list[int], blocked: list[int], weight: np.ndarray) -> tuple[int, int]:
    """The best swap by counting every one from the start."""

    def cost(out: int, into: int) -> tuple[int, int]:
        covered = cover.covered_by(np.array([row for row in rows if row != out] + [into]))
        return int(weight @ cover.missing(covered)), -int(cover.reached(covered)[0])

    every = [(out, into) for out in sorted(rows) for into in range(cover.rows) if into not in blocked]
    return min(every, key=lambda swap: (*cost(*swap), *swap))


@pytest.mark.parametrize("views", [1, 3])
@pytest.mark.parametrize("seed", range(size(short=1, full=6)))
def test_after_every_swap_the_next_best_one_is_found(
    seed: int, views: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(swaps, "FIRST_OF_FAR", 2)
    monkeypatch.setattr(swaps, "MOST_AT_ONCE", 30)
    cover = cover_of_rooms(seed, views=views)
    rows = np.random.Generator(np.random.PCG64(seed)).permutation(cover.rows)[:7].tolist()
    board, tabu = SwapBoard(cover, rows), []
    for _ in range(20):
        blocked = [*rows, *tabu[-3:]]
        expected = _by_trial(cover, rows, blocked, board.weight.copy())
        out, into = board.best_swap(rows, blocked)
        assert (out, into) == expected
        board.raise_penalties()
        board.drop(out)
        board.take(into)
        rows[rows.index(out)] = into
        tabu.append(out)
