"""The fewest rows between components, however many links are looked at together."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from stopgo.planner.selection import connecting_rows as module
from stopgo.planner.selection.connecting_rows import connecting_rows


@pytest.mark.parametrize("block", [1, 7, 1_000_000])
def test_a_line_of_rows_is_joined_over_its_narrowest_gap(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "BLOCK", block)
    row = np.arange(19)
    ends = (np.concatenate([row, row + 1]), np.concatenate([row + 1, row]))
    links = csr_array((np.ones(38, np.int8), ends), shape=(21, 21))  # the last row has no link
    components = [np.array([0, 1]), np.array([8]), np.array([12, 13])]
    near = [np.array([2]), np.array([7, 9]), np.array([11, 14])]
    for region in (np.arange(20), np.arange(4, 20)):
        parts = [part for part in components if part[0] in region]
        found = connecting_rows(links, region, parts, near[-len(parts) :], lambda rows: np.zeros(len(rows)))
        assert found.tolist() == [9, 10, 11]
