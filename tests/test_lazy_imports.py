"""Imports inside functions: each spares a command the load of a library, or has a reason."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from functools import cache

import pytest

from tests.sources import MODULES, source_of

pytestmark = pytest.mark.together("sources")

REASONS = {
    "stopgo": "`import stopgo` loads nothing but itself",
    "stopgo.batches.work": "a batch whose plans are all kept loads no planner",
    "stopgo.command_line": "`stopgo --version` and a refused argument load no table",
    "stopgo.commands.demo_command": "only the demo starts a robot and unpacks the sample",
    "stopgo.bridge.station.shared_session": "Windows has no fcntl; the options of sessions are read there",
    "stopgo.site.kept_variants": "Windows has no fcntl; variants are temporary there",
    "stopgo.bridge.link.admission": "Windows has no resource; robots on it use zenoh alone",
    "stopgo.bridge.robot.journal_file": "Windows has no fcntl; everything else of the bridge runs there",
    "stopgo.mission.files.atomic": "Windows has no fcntl; plans do not wait for one another there",
    "stopgo.mission.console.plugins": "importlib.metadata takes 25 ms, and few plans use plug-ins",
    "stopgo.mission.console.freed_memory": "Windows has no resource; it needs no call for this",
    "stopgo.mission.console.process": "only commands that start workers need multiprocessing",
    "stopgo.mission.settings.toml_file": "tomllib takes 7 ms, and most commands read no TOML file",
    "stopgo.mission.plan": "a plan is drawn where a notebook shows it",
    "stopgo.planner.candidates.triangulation": "scipy.spatial takes 0.4 s, and few plans triangulate",
    "stopgo.planner.floors.linework.walls": "as candidates.triangulation: few drawings are loose linework",
    "stopgo.planner.floors.linework.swings": "as candidates.triangulation",
    "stopgo.planner.floors.rings": "as candidates.triangulation",
    "stopgo.planner.routing.grid_graph": "as candidates.triangulation: few plans use grids",
    "stopgo.planner.pipeline": "`import stopgo.planner` loads no stage",
    "stopgo.recordings.viewing.importer": "Rerun asks of every file; most are not ours",
}
"""Modules that import lazily although no library is spared."""


@cache
def _imports(name: str) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Names that a module imports when it is loaded, and those of each import inside a function."""
    source = source_of(name)
    loaded = tuple(one for node in source.loaded for one in _names(node))
    return loaded, tuple(tuple(_names(node)) for node in source.lazy)


def _names(node: ast.Import | ast.ImportFrom) -> Iterator[str]:
    for alias in node.names:
        whole = alias.name if isinstance(node, ast.Import) else f"{node.module}.{alias.name}"
        yield whole if isinstance(node, ast.Import) or whole in MODULES else str(node.module)


@cache
def _libraries(name: str) -> frozenset[str]:
    """Third-party packages that are loaded with a name: its own, or those of our modules below it."""
    package = name.partition(".")[0]
    if package != "stopgo":
        return frozenset() if package in sys.stdlib_module_names else frozenset({package})
    found: set[str] = set()
    open_names, seen = [name], set[str]()
    while open_names:
        parts = open_names.pop().split(".")
        for module in (".".join(parts[:end]) for end in range(1, len(parts) + 1)):
            if module in MODULES and module not in seen:
                seen.add(module)
                for imported in _imports(module)[0]:
                    ours = imported.partition(".")[0] == "stopgo"
                    open_names.append(imported) if ours else found.update(_libraries(imported))
    return frozenset(found)


def test_an_import_inside_a_function_spares_a_library_or_has_a_reason() -> None:
    idle = {name: found for name in MODULES if (found := _sparing_nothing(name))}
    unexplained = {name: found for name, found in idle.items() if name not in REASONS}
    assert not unexplained, "import these where the module begins, or say why not"
    assert not [name for name in REASONS if name not in idle], "these need no reason any more"


@pytest.mark.parametrize("name", ["stopgo.batches", "stopgo.planning_modules"])
def test_a_batch_and_the_process_that_forks_its_workers_load_no_rerun(name: str) -> None:
    assert "rerun" not in _libraries(name), "its threads would not outlive a fork"


def test_a_robot_starts_without_numpy() -> None:
    assert "numpy" not in _libraries("stopgo.bridge.robot.program"), "it takes a third of the time to start"


def _sparing_nothing(name: str) -> list[tuple[str, ...]]:
    """Imports inside functions that load no library but those that the module loads anyway."""
    own = _libraries(name)
    return [names for names in _imports(name)[1] if not frozenset().union(*map(_libraries, names)) - own]
