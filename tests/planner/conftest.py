"""The planner's tests run compiled kernels and draw no recordings; in the long form they do the reverse."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from stopgo.planner.scan_simulation import verification
from stopgo.recordings.plan import PlanRecording
from tests.faults.sizes import FULL
from tests.planner.kernels import interpret


@pytest.fixture(scope="package", autouse=True)
def _speed() -> Iterator[None]:
    """That both speeds agree has tests of its own, and so have recordings, which no test here looks at."""
    with pytest.MonkeyPatch.context() as patch:
        if FULL:
            interpret(patch)
        else:
            patch.setattr(PlanRecording, "write", lambda recording, path: path.write_bytes(b"RRF2"))
        yield


@pytest.fixture
def no_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Register no scans: the test asks what each one acquires, and registration takes most of the time."""
    monkeypatch.setattr(verification, "registered", lambda *given: ())
    monkeypatch.setattr(verification, "surface_of", lambda *given: None)
