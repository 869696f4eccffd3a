"""Small floors are done with after a few steps of the search, and of the bound."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import stopgo.planner.covering_tour.least_time_bound
import stopgo.planner.covering_tour.search
from tests.faults.sizes import size


@pytest.fixture(scope="package", autouse=True)
def _few_steps() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stopgo.planner.covering_tour.search, "STEPS", size(short=60, full=400))
        patch.setattr(stopgo.planner.covering_tour.least_time_bound, "MOST_STEPS", size(short=40, full=240))
        yield
