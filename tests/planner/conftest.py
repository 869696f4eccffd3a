"""The planner's tests run compiled kernels; in the long form the interpreted ones."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from stopgo.planner.scan_simulation import verification
from tests.faults.sizes import FULL
from tests.planner.kernels import interpret


@pytest.fixture(scope="package", autouse=True)
def _speed() -> Iterator[None]:
    """That both speeds agree has tests of its own."""
    with pytest.MonkeyPatch.context() as patch:
        if FULL:
            interpret(patch)
        yield


@pytest.fixture
def no_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Register no scans: the test asks what each one acquires, and registration takes most of the time."""
    monkeypatch.setattr(verification, "registered", lambda *given: ())
