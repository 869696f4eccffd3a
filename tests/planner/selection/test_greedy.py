"""Greedy: the same rows in numpy, by the kernel as written, and by the compiled one."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module

import numpy as np
import pytest

from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.greedy import greedy, in_greedy_order
from tests.faults.sizes import size
from tests.planner.kernels import machine_code
from tests.planner.selection.test_swaps import cover_of_rooms


def by_each_kernel(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """In numpy, by the kernel as written, and by the compiled one."""
    module = import_module(greedy.__module__)
    for kernels in (lambda kernel: None, lambda kernel: kernel, machine_code):
        monkeypatch.setattr(module, "compiled", lambda kernel, *, large, by=kernels: by(kernel))
        yield


@pytest.mark.parametrize("views", [1, 3])
@pytest.mark.parametrize("seed", range(size(short=4, full=100)))
def test_rows_and_their_order_are_the_same_in_numpy_as_written_and_compiled(
    seed: int, views: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    random = np.random.default_rng(seed)
    rows, columns = int(random.integers(2, 60)), int(random.integers(1, 200))
    cover = cover_of_rooms(seed, rows=rows, columns=columns, rooms=1 + seed % 7, views=views)
    sets = [np.sort(random.choice(rows, random.integers(1, rows), replace=False)) for _ in range(seed % 3)]
    cover = cover.with_one_of_each(sets)
    some = random.permutation(rows)[: rows // 2]
    found = [
        (greedy(cover).tolist(), in_greedy_order(cover, some).tolist()) for _ in by_each_kernel(monkeypatch)
    ]
    assert found[0] == found[1] == found[2]
    assert sorted(found[0][1]) == sorted(some.tolist())


def test_greedy_ends_where_the_rows_offered_do_not_see_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    cover = cover_of_rooms(0)
    short = Cover(cover.sees, cover.worth, cover.needed + 10_000)
    found = [greedy(short).tolist() for _ in by_each_kernel(monkeypatch)]
    assert found[0] == found[1] == found[2]
    assert len(found[0]) < cover.rows
