"""The planner's tests run compiled kernels; in the long form the interpreted ones."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.faults.sizes import FULL
from tests.planner.kernels import interpret


@pytest.fixture(scope="package", autouse=True)
def _speed() -> Iterator[None]:
    """That both speeds agree has tests of its own."""
    with pytest.MonkeyPatch.context() as patch:
        if FULL:
            interpret(patch)
        yield
