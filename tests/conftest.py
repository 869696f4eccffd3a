"""Rules for every test."""

from __future__ import annotations

import gc
import math
import os
import signal
import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import settings

from stopgo.mission.console import running_step
from tests.faults.sizes import FULL, is_long, size
from tests.shell import forget_the_shell
from tests.workers import file_of

# The same examples every time, and no deadline on a shared machine.
settings.register_profile(
    "tests", deadline=None, derandomize=True, max_examples=size(short=20, full=300), database=None
)
settings.register_profile("search", deadline=None, max_examples=20_000)
settings.load_profile(os.environ.get("STOPGO_HYPOTHESIS", "tests"))

TESTS = Path(__file__).parent

HAS_ROBOTS = find_spec("fcntl") is not None
collect_ignore = (
    []
    if HAS_ROBOTS
    else ["bridge/commands", "bridge/conform", "bridge/mavlink", "bridge/robot", "faults", "journeys"]
)
"""Folders whose tests start robots. Robots run on Linux and macOS only."""


def pytest_configure() -> None:
    """Let no test depend on where the tests run, or on which of them ran before in the same process.

    What commands remember of robots and vehicles, and their caches, go to a folder of the tests' own.
    A command that takes long on a busy machine prints no further line for that.
    pymavlink asks this variable for its version, at its import and again later; the bridge sets it.
    """
    os.environ["MAVLINK20"] = "1"
    running_step.PATIENCE_S = math.inf
    os.environ["XDG_STATE_HOME"] = os.environ["XDG_CACHE_HOME"] = tempfile.mkdtemp(prefix="stopgo-tests-")
    forget_the_shell()
    if not HAS_ROBOTS:
        _skip_what_opens_a_journal()


def _skip_what_opens_a_journal() -> None:
    """Skip every test that comes to open a robot's journal in its own process."""
    from stopgo.bridge.robot import journal_file

    def skipped(directory: Path) -> ModuleType:
        pytest.skip("robots run on Linux and macOS only")

    journal_file._file_locks = skipped


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Look for no garbage among modules, which all stay."""
    gc.disable()
    yield
    gc.enable()


def pytest_collection_finish() -> None:
    """Look no more for garbage among all collected tests, and ten times less often among new objects.

    The former takes a tenth of all time, the latter three hundredths.
    """
    gc.freeze()
    gc.set_threshold(7_000, 10, 10)


WAITING = {TESTS / name for name in ("bridge", "faults", "journeys", "ros2")}
"""Folders whose tests mostly wait for other processes; those of the other folders mostly compute."""

LONGEST = {
    TESTS / name
    for name in (
        "batches/test_batch.py", "bridge/commands/test_conform_command.py",
        "bridge/commands/test_vehicle_commands.py", "bridge/link/test_keys.py", "bridge/link/test_zenoh.py",
        "bridge/mavlink/driving/test_driving_processes.py", "bridge/ros2/test_ros2_zenoh_robot.py",
        "bridge/station/test_fleet.py", "faults/test_freezes.py", "faults/test_kill.py",
        "faults/test_links.py", "journeys/test_readme.py", "site/test_day_in_browser.py", "test_docs.py",
        "test_workers.py",
    )
}  # fmt: skip
"""Files that take ten seconds and more, most of which they wait for other processes: none may end alone."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the long form, and deal both kinds of files out.

    They are dealt out evenly, so that at any time some tests compute while others wait. The longest files are
    begun first, and then the folders that wait from the last one: longer files are there.
    """
    if not FULL:
        config.hook.pytest_deselected(items=[item for item in items if is_long(item.nodeid)])
        items[:] = [item for item in items if not is_long(item.nodeid)]
    longest = {file_of(item) for item in items if item.path in LONGEST}
    kinds: tuple[list[object], list[object]] = [], []
    for file, path in {file_of(item): item.path for item in items}.items():
        kinds[file in longest or not WAITING.isdisjoint(path.parents)].append(file)
    kinds[1].reverse()
    kinds[1].sort(key=lambda file: file not in longest)
    place = {file: (number + 0.5) / len(kind) for kind in kinds for number, file in enumerate(kind)}
    items.sort(key=lambda item: (place[file_of(item)], item.path))


LONGEST_S = size(short=240, full=7200)
"""A test that takes longer waits for what never comes; far above any test on a busy machine."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """End a test that hangs, so that the others go on."""
    if not hasattr(signal, "SIGALRM"):
        return (yield)

    def hangs(*_: object) -> None:
        pytest.fail(f"{item.nodeid} did not end within {LONGEST_S} s")

    before = signal.signal(signal.SIGALRM, hangs)
    signal.alarm(LONGEST_S)
    try:
        return (yield)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture
def own_time(request: pytest.FixtureRequest) -> Iterator[None]:
    """The test's threads wait in a time of their own; in the long form of the fault tests, in real time."""
    long = FULL and TESTS / "faults" in request.path.parents
    if long or request.node.get_closest_marker("real_time"):
        yield
        return
    from tests.own_time import stepped_into

    with stepped_into():
        yield
