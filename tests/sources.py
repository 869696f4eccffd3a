"""Sources of the product as their tests see them: each module is parsed once."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.ages import parsed

ROOT = Path(__file__).parents[1]
FOLDERS = ("mission", "planner", "bridge", "recordings")

Import = ast.Import | ast.ImportFrom


def modules() -> dict[str, Path]:
    """Every module of the front door and of the four folders, by its dotted name."""
    found = {}
    for folder in ("stopgo", *FOLDERS):
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            whole = parts if folder == "stopgo" else ("stopgo", *parts)
            found[".".join(whole[:-1] if whole[-1] == "__init__" else whole)] = path
    return found


MODULES = modules()


@dataclass
class Source:
    """The imports, functions, docstrings and texts of a module."""

    loaded: list[Import] = field(default_factory=list)
    """Imports that are done when the module is loaded."""
    lazy: list[Import] = field(default_factory=list)
    """Imports inside functions."""
    for_types: list[Import] = field(default_factory=list)
    """Imports that are never done, for a checker of types alone."""
    functions: list[tuple[str, int]] = field(default_factory=list)
    """Each function with its number of lines after the first."""
    docstrings: list[str] = field(default_factory=list)
    """Those of the module (first), of classes and of functions; empty where there is none."""
    texts: list[str] = field(default_factory=list)
    """Constants that are no docstrings."""
    types: list[str] = field(default_factory=list)
    """Classes of the module, and names that it gives to values."""

    @property
    def imports(self) -> list[Import]:
        """All imports."""
        return [*self.loaded, *self.lazy, *self.for_types]


@cache
def source_of(name: str) -> Source:
    """Read a module."""
    tree = parsed(MODULES[name].read_text(encoding="utf-8"))
    found = Source(types=[*_named_in(tree)])
    _read(tree, found, found.loaded)
    return found


DOCUMENTED = {ast.Module, ast.ClassDef, ast.FunctionDef}
IMPORTS = (ast.Import, ast.ImportFrom)
FUNCTIONS = {ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda}
LEAVES = {ast.Name, ast.Load, ast.Store, str, int, type(None)}
"""Most of what is in a node, with nothing of what is looked for."""


def _read(node: Any, into: Source, imports: list[Import]) -> None:
    """Add a node and all in it; its imports are added to the one list."""
    kind = type(node)
    if isinstance(node, IMPORTS):
        imports.append(node)
        return
    if kind in FUNCTIONS:
        imports = into.lazy if imports is into.loaded else imports
    elif kind is ast.If and "TYPE_CHECKING" in ast.dump(node.test):
        imports = into.for_types
    if kind in DOCUMENTED:
        into.docstrings.append(ast.get_docstring(node) or "")
    if kind is ast.FunctionDef:
        into.functions.append((node.name, node.end_lineno - node.lineno))
    for value in node.__dict__.values():
        for inner in value if type(value) is list else (value,):
            if type(inner) is ast.Constant:
                into.texts += [inner.value] * isinstance(inner.value, str)
            elif type(inner) not in LEAVES and isinstance(inner, ast.AST) and not _is_comment(inner):
                _read(inner, into, imports)


def _is_comment(node: ast.AST) -> bool:
    """True for a docstring, and for a text that explains a constant."""
    return type(node) is ast.Expr and type(node.value) is ast.Constant


def _named_in(tree: ast.Module) -> Iterator[str]:
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            yield node.targets[0].id
