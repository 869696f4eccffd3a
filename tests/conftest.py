"""What holds for every test."""

from __future__ import annotations

import gc
import os
import signal
import tempfile
from collections.abc import Iterator
from contextlib import nullcontext

import pytest
from hypothesis import settings

from tests.alone import first_alone
from tests.faults.sizes import FULL, size

# The same examples every time, and no deadline on a shared machine.
settings.register_profile(
    "tests", deadline=None, derandomize=True, max_examples=size(short=30, full=300), database=None
)
settings.register_profile("search", deadline=None, max_examples=20_000)
settings.load_profile(os.environ.get("STOPGO_HYPOTHESIS", "tests"))


def pytest_configure() -> None:
    """Let no test depend on where the tests run, or on which of them ran before in the same process.

    A shell without job control starts background programs with SIGINT ignored, and children inherit that.
    What commands remember of robots and vehicles goes to a folder of the tests' own.
    pymavlink asks this variable for its version, at its import and again later; the bridge sets it.
    """
    os.environ["MAVLINK20"] = "1"
    if "PYTEST_XDIST_WORKER" not in os.environ:  # workers have their parent's
        os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="stopgo-tests-")
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Let one worker compile what all import; and look for no garbage among modules, which all stay."""
    gc.disable()
    with first_alone("collection") if "PYTEST_XDIST_WORKER" in os.environ else nullcontext():
        yield
    gc.enable()


def pytest_collection_finish() -> None:
    """Look no more for garbage among thousands of collected tests: that takes a tenth of all time."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def own_time(request: pytest.FixtureRequest) -> Iterator[None]:
    """The test's threads wait in a time of their own; in the long form of the tests, in real time."""
    if FULL or request.node.get_closest_marker("real_time"):
        yield
        return
    from tests.own_time import stepped_into

    with stepped_into():
        yield
