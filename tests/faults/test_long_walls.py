"""Sight along long walls, decided millions of times: one wrong pair would be a false claim."""

from __future__ import annotations

import numpy as np
import pytest

from tests.faults.sizes import size
from tests.planner.long_walls import RANGES, told


def test_no_pair_of_place_and_unit_is_reported_wrongly(monkeypatch: pytest.MonkeyPatch) -> None:
    seeds = range(1000, 1000 + size(short=1, full=40))
    places = size(short=20, full=60)
    found = [
        told(seed, reach=reach, places=places, monkeypatch=monkeypatch) for seed in seeds for reach in RANGES
    ]
    pairs, *wrong = np.sum(found, axis=0)
    print(f"{pairs} pairs within range or a metre beyond")
    assert pairs >= size(short=15_000, full=10_000_000)
    assert wrong == [0, 0]
