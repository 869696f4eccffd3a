"""The house stands as it was drawn: who imports whom, what is slow, and what every command offers."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from mission.__main__ import build_app

ROOT = Path(__file__).parents[1]
FOLDERS = ("mission", "planner", "bridge", "recordings")
FRONT_DOOR = "mission.__main__"


def modules() -> dict[str, Path]:
    """Every module of the four folders by its dotted name."""
    found = {}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


def imported(name: str, *, at_top_only: bool = False) -> Iterator[str]:
    """Dotted names of our modules that a module imports."""
    tree = ast.parse(MODULES[name].read_text(encoding="utf-8"))
    for node in _at_top(tree) if at_top_only else ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] in FOLDERS)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: a relative import; write the whole name"
            if (node.module or "").split(".")[0] in FOLDERS:
                yield from _from(node)


def _at_top(tree: ast.Module) -> Iterator[ast.stmt]:
    """Statements that run at import, `if TYPE_CHECKING` blocks excepted."""
    for node in tree.body:
        if isinstance(node, ast.Try):
            yield from node.body
        else:
            yield node


def _from(node: ast.ImportFrom) -> Iterator[str]:
    for alias in node.names:
        whole = f"{node.module}.{alias.name}"
        yield whole if whole in MODULES else str(node.module)


def composes(name: str) -> bool:
    """Whether a module may bring folders together."""
    return name == FRONT_DOOR or name in {f"{folder}.cli" for folder in FOLDERS}


@pytest.mark.parametrize("name", [name for name in MODULES if not composes(name)])
def test_a_folder_imports_itself_and_mission_only(name: str) -> None:
    own = name.partition(".")[0]
    strangers = {item for item in imported(name) if item.split(".")[0] not in (own, "mission")}
    assert not strangers, f"{name} imports {strangers}; only cli.py modules compose"


def test_nobody_imports_what_composes() -> None:
    for name in MODULES:
        if name != FRONT_DOOR:
            assert not [item for item in imported(name) if composes(item) and item != name], name


def test_there_are_no_import_cycles() -> None:
    graph = {name: set(imported(name, at_top_only=True)) - {name} for name in MODULES}
    while leaves := [name for name, needs in graph.items() if not needs & set(graph)]:
        for name in leaves:
            del graph[name]
    assert not graph, f"these import each other in a circle: {sorted(graph)}"


@pytest.mark.parametrize("statement", ["import mission, bridge", "import planner, recordings"])
def test_importing_a_folder_loads_nothing_slow(statement: str) -> None:
    slow = {"shapely", "scipy", "rerun", "numba", "ezdxf", "networkx", "highspy", "pyarrow", "pyproj"}
    code = f"{statement}; import sys; print(*sorted({slow} & set(sys.modules)))"
    assert run(sys.executable, "-c", code).split() == []


def test_the_front_door_opens_without_slow_libraries() -> None:
    code = "from mission.__main__ import main; import sys; main(['-h']); print(*sys.modules, file=sys.stderr)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert not {"shapely", "scipy", "rerun", "numba", "ezdxf", "numpy", "msgspec"} & set(
        result.stderr.split()
    )


def test_every_module_says_what_it_is_for() -> None:
    for name, path in MODULES.items():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        assert ast.get_docstring(tree), f"{name} has no first sentence"


def commands() -> list[str]:
    app = typer.main.get_command(build_app())
    return sorted(getattr(app, "commands", {}))


@pytest.mark.parametrize("command", commands())
def test_every_command_has_help_with_an_example(command: str) -> None:
    text = run(sys.executable, "-m", "mission", command, "--help")
    assert "Example" in text, f"stopgo {command} --help shows no example"
    assert f"stopgo {command}" in text


def run(*command: str) -> str:
    result = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=60, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout
