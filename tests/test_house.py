"""The house stands as it was drawn: who imports whom, what is slow, and what every command offers."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache

import pytest

from stopgo.command_line import COMMANDS, front_door, main
from tests.sources import FOLDERS, MODULES, ROOT, source_of

pytestmark = pytest.mark.together("sources")

FRONT_DOOR = "stopgo.command_line"


@cache
def imported(name: str) -> tuple[str, ...]:
    """Dotted names of our modules that a module imports, wherever in it."""
    return tuple(_imported(name))


def _imported(name: str) -> Iterator[str]:
    for node in source_of(name).imports:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        else:
            assert node.level == 0, f"{name}: a relative import; write the whole name"
            if str(node.module) in MODULES:
                yield from _from(node)


def _from(node: ast.ImportFrom) -> Iterator[str]:
    for alias in node.names:
        whole = f"{node.module}.{alias.name}"
        yield whole if whole in MODULES else str(node.module)


def composes(name: str) -> bool:
    """True if a module may bring folders together."""
    return not folder_of(name)


def folder_of(name: str) -> str:
    """The one of the four folders that a module is in; none for those of the front door."""
    parts = name.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in FOLDERS else ""


def test_a_folder_imports_itself_and_mission_only() -> None:
    found = {
        name: {item for item in imported(name) if folder_of(item) not in (folder_of(name), "mission")}
        for name in MODULES
        if not composes(name)
    }
    assert not _filled(found), "only stopgo/ composes"


def _filled(found: dict[str, set[str]]) -> dict[str, set[str]]:
    """Modules in which something was found."""
    return {name: items for name, items in found.items() if items}


def test_nobody_imports_what_composes() -> None:
    for name in MODULES:
        if folder_of(name):
            assert not [item for item in imported(name) if composes(item) and item != name], name


Graph = dict[str, set[str]]
"""Who imports whom."""


def circles(graph: Graph) -> list[str]:
    """A shortest circle through each name that is in one, as in "a -> b -> a"."""
    ways = (_way_round(graph, name) for name in sorted(graph))
    return sorted({_from_first(way) for way in ways if way})


def _way_round(graph: Graph, name: str) -> list[str]:
    """The shortest way from a name back to itself; empty if there is none."""
    came_from: dict[str, str] = {}
    here = [name]
    while here and name not in came_from:
        beyond = [(there, one) for one in here for there in sorted(graph.get(one, ()))]
        fresh = {there: one for there, one in reversed(beyond) if there not in came_from}
        came_from |= fresh
        here = sorted(fresh)
    if name not in came_from:
        return []
    way = [came_from[name]]
    while way[-1] != name:
        way.append(came_from[way[-1]])
    return way[::-1]


def _from_first(way: list[str]) -> str:
    first = way.index(min(way))
    return " -> ".join([*way[first:], *way[:first], way[first]])


def siblings(parent: str) -> Graph:
    """Imports between the folders and modules right below a folder, whatever lies in them."""
    graph: Graph = {}
    depth = parent.count(".") + 2
    for name in MODULES:
        if name.startswith(f"{parent}."):
            own = _cut(name, depth)
            needs = {_cut(item, depth) for item in imported(name) if item.startswith(f"{parent}.")}
            graph.setdefault(own, set()).update(needs - {own})
    return graph


def _cut(name: str, depth: int) -> str:
    return ".".join(name.split(".")[:depth])


PACKAGES = [name for name, path in MODULES.items() if path.name == "__init__.py"]


def test_a_circle_is_named() -> None:
    graph = {"a": {"b", "x"}, "b": {"c"}, "c": {"a", "b"}, "x": {"a"}, "y": {"a"}}
    assert circles(graph) == ["a -> x -> a", "b -> c -> b"]
    assert circles({"a": {"b"}, "b": {"c"}, "c": set()}) == []


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Imports that are lazy or for types alone count."""
    assert not circles({name: set(imported(name)) - {name} for name in MODULES})


def test_no_siblings_import_each_other_in_a_circle() -> None:
    """Neither folders nor modules, at any depth; imports that are lazy or for types alone count."""
    assert not _filled({parent: set(circles(siblings(parent))) for parent in PACKAGES})


SAME_NAME = {
    "qgc_plan": "a format's writer and its reader",
    "qgc_waypoints": "a format's writer and its reader",
    "stops_csv": "a format's writer and its reader",
    "floor": "a noun, and how a recording draws it",
    "plan": "a noun, and how a recording draws it",
    "revision": "a noun, and how a recording draws it",
    "drawing": "a drawing that is read, and one that is made",
    "strokes": "lines that are read, and lines that are drawn",
    "report": "what is told of a plan, of a recording and of a run",
    "sight": "what stops see, and how it is computed",
}
"""Why modules of one name may stand beside each other."""


def _is_type(name: str) -> bool:
    bare = name.lstrip("_")
    return len(bare) > 1 and bare[0].isupper() and not bare.isupper()


def test_a_class_name_stands_for_one_thing() -> None:
    homes: dict[str, set[str]] = {}
    for name in MODULES:
        for item in filter(_is_type, source_of(name).types):
            homes.setdefault(item, set()).add(name)
    assert not {item: found for item, found in homes.items() if len(found) > 1}


def test_a_modules_name_stands_once() -> None:
    homes: dict[str, list[str]] = {}
    for name in MODULES:
        if name not in PACKAGES:
            homes.setdefault(name.rpartition(".")[2], []).append(name)
    assert not {item: found for item, found in homes.items() if len(found) > 1 and item not in SAME_NAME}


def test_the_dialect_of_mavlink_is_known_to_its_edges_alone() -> None:
    users = {name for name, path in MODULES.items() if "dialect" in path.read_text(encoding="utf-8")}
    edges = {"frames", "messages", "wire", "tunnel", "vehicle_telemetry", "replies"}
    assert {name.rpartition(".")[2] for name in users if folder_of(name) == "bridge"} <= edges


def test_one_module_decodes_into_kinds() -> None:
    """Two threads that prepare a kind of `msgspec` at once end the process."""
    prepares = re.compile(r"msgspec\.(?:convert|\w+\.Decoder)\b|msgspec\.\w+\.decode\([^#]*?,\s*type=")
    users = {name for name, path in MODULES.items() if prepares.search(path.read_text(encoding="utf-8"))}
    assert users == {"stopgo.mission.document.decoding"}


PURE = ("stopgo.mission.run", "stopgo.mission.mavlink")


def test_what_a_run_is_knows_no_clock_no_disk_and_no_line() -> None:
    """So that what replays a log stands on what follows a robot."""
    outer = {
        "datetime",
        "os",
        "pathlib",
        "pymavlink",
        "random",
        "socket",
        "sqlite3",
        "threading",
        "time",
        "zenoh",
    }
    pure = [name for name in MODULES if name.startswith(PURE)]
    assert pure
    assert not _filled({name: _packages_imported_by(name) & outer for name in pure})


def _packages_imported_by(name: str) -> set[str]:
    nodes = source_of(name).imports
    named = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    named |= {str(node.module) for node in nodes if isinstance(node, ast.ImportFrom)}
    return {one.partition(".")[0] for one in named}


@pytest.mark.parametrize(
    "statement",
    [
        "import stopgo.mission, stopgo.bridge",
        "import stopgo.planner, stopgo.recordings",
    ],
)
def test_importing_a_folder_loads_nothing_slow(statement: str) -> None:
    slow = {"shapely", "scipy", "rerun", "ezdxf", "networkx", "highspy", "pyarrow", "pyproj"}
    code = f"{statement}; import sys; print(*sorted({slow} & set(sys.modules)))"
    assert run(sys.executable, "-c", code).split() == []


def test_the_front_door_opens_without_slow_libraries() -> None:
    code = "from stopgo.command_line import main; import sys; main([]); print(*sys.modules, file=sys.stderr)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert not {"shapely", "scipy", "rerun", "ezdxf", "numpy", "msgspec"} & set(result.stderr.split())


def test_a_stop_loads_what_it_needs_and_no_other_command() -> None:
    stop = "['pause', '--robot', 'r1', '--connect', 'tcp/127.0.0.1:1', '--timeout', '0.1']"
    code = f"from stopgo.command_line import main; import sys; main({stop}); print(*sys.modules)"
    loaded = set(run(sys.executable, "-c", code).split())
    assert "stopgo.bridge.station.station" in loaded
    assert not {"numpy", "pymavlink", "stopgo.planner", "stopgo.recordings", "stopgo.mission.floor"} & loaded
    others = {f"stopgo.commands.{name}" for name in COMMANDS if name != "bridge_commands"}
    assert not others & loaded


def test_a_simulated_robot_loads_nothing_of_autopilots() -> None:
    robot = "['robot', '--name', 'r1', '--state', 'r1.state', '--listen', 'nowhere']"
    code = f"from stopgo.command_line import main; import sys; main({robot}); print(*sys.modules)"
    assert not {"pymavlink", "stopgo.mission.console.plugins"} & set(run(sys.executable, "-c", code).split())


KERNELS = {"grow", "look", "look_all", "look_from_cell", "look_from_all_cells", "iterated_search", "pieces"}
"""Compiled functions: each is one loop, so that it compiles to one."""


def test_no_function_is_longer_than_forty_lines() -> None:
    found = {
        name: {function for function, lines in source_of(name).functions if lines >= 40} for name in MODULES
    }
    assert not _filled({name: long - KERNELS for name, long in found.items()})


QUESTIONS = ("What", "Whether", "How", "Who", "Whose", "Where", "Which", "When", "Why")


def test_docstrings_begin_with_a_noun_or_a_verb() -> None:
    assert not _filled(
        {
            name: {one for one in source_of(name).docstrings if one.split(" ")[0] in QUESTIONS}
            for name in MODULES
        }
    )


def test_the_first_line_of_a_test_module_is_no_question() -> None:
    for path in [*ROOT.glob("tests/**/*.py"), *ROOT.glob("benchmarks/*.py")]:
        with path.open(encoding="utf-8") as lines:
            first = next(lines, "").removeprefix('"""').split(" ")[0]
        assert first not in QUESTIONS, path


def test_every_module_says_what_it_is_for() -> None:
    for name in MODULES:
        assert source_of(name).docstrings[0], f"{name} has no first sentence"


def commands() -> list[str]:
    return sorted(front_door().commands)


@pytest.mark.parametrize("command", commands())
def test_every_command_has_help_with_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"]) == 0
    text = capsys.readouterr().out
    assert "Example" in text, f"stopgo {command} --help shows no example"
    assert f"stopgo {command}" in text


def run(*command: str) -> str:
    result = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=60, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout
