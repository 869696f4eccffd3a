"""The planner's small floors are looked over by the compiled kernel, which one process loads but once."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import stopgo.planner.visibility.sight.sight
from tests.alone import first_alone
from tests.faults.sizes import FULL
from tests.planner.worlds import hall, planned


@pytest.fixture(scope="package", autouse=True)
def _compiled() -> Iterator[None]:
    """One worker compiles it for all.

    In the long form small floors are left to the interpreted one; that both agree has tests of its own.
    """
    with pytest.MonkeyPatch.context() as patch:
        if not FULL:
            patch.setattr(stopgo.planner.visibility.sight.sight, "COMPILE_ABOVE", -1)
            with first_alone("kernel"):
                planned(hall())
        yield
