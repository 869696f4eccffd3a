"""The entries of the batches' tests are planned without recordings, which no test here looks at."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from stopgo.recordings.plan import PlanRecording
from tests.faults.sizes import FULL


@pytest.fixture(scope="package", autouse=True)
def _no_recordings() -> Iterator[None]:
    """Draw them in the long form."""
    with pytest.MonkeyPatch.context() as patch:
        if not FULL:
            patch.setattr(PlanRecording, "write", lambda recording, path: path.write_bytes(b"RRF2"))
        yield
