"""Swap search: the same rows in numpy, by the kernel as written, and by the compiled one."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.planner.selection import swap_search
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.selection.swap_kernel import repair
from stopgo.planner.selection.swap_search import by_kernel, repaired
from tests.faults.sizes import size
from tests.planner.checks import meets
from tests.planner.kernels import interpret, machine_code
from tests.planner.selection.test_swaps import cover_of_rooms


@pytest.mark.parametrize("views", [1, 3])
@pytest.mark.parametrize("seed", range(size(short=4, full=100)))
def test_the_search_is_the_same_in_numpy_as_written_and_compiled(
    seed: int, views: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    random = np.random.default_rng(seed)
    rows, columns = int(random.integers(9, 50)), int(random.integers(20, 150))
    cover = cover_of_rooms(seed, rows=rows, columns=columns, rooms=1 + seed % 7, views=views)
    start = random.permutation(greedy(cover))[1:].tolist()
    assert start
    interpret(monkeypatch)
    for swaps in (0, 1, 6, 40):
        found = repaired(cover, list(start), swaps)
        assert found is None or (len(found) == len(start) and meets(cover, found))
        expected = None if found is None else found.tolist()
        for kernel in (repair, machine_code(repair)) if swaps < 7 else (machine_code(repair),):
            again = by_kernel(kernel, cover, list(start), swaps)
            assert (None if again is None else again.tolist()) == expected


def test_some_searches_succeed() -> None:
    covers = [cover_of_rooms(seed, rows=40, columns=100) for seed in range(12)]
    assert any(repaired(cover, greedy(cover)[:-1].tolist(), 40) is not None for cover in covers)


def test_a_search_with_few_other_rows_may_return_them() -> None:
    """Where every other row was removed just now, one of them comes back."""
    for seed in range(12):
        cover = cover_of_rooms(seed, rows=9, columns=60)
        start = list(range(seed % 3 + 5))
        found = swap_search._by_board(cover, list(start), 30)
        again = by_kernel(machine_code(repair), cover, list(start), 30)
        assert (found is None) == (again is None)
        assert found is None or again is None or found.tolist() == again.tolist()
