"""Ages of the tables in benchmarks/README.md: each names the code that it measured.

`python -m benchmarks.ages` lists them, and marks those whose code has changed since. A stamp has the digest of all
modules of ours that the benchmark imports, at any depth. Lines of comments and docstrings do not count.
"""

from __future__ import annotations

import ast
import datetime
import hashlib
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
README = Path(__file__).with_name("README.md")
FOLDERS = ("mission", "planner", "bridge", "recordings")

BY_COMMAND = {
    "campus": ("stopgo.commands.batch_command",),
    "former": ("stopgo.commands.plan_command",),
    "growth": ("benchmarks.floors",),
    "whole-plans": ("stopgo.commands.plan_command",),
    "recordings": ("stopgo.commands.plan_command", "stopgo.recordings.runs.field"),
    "bridge": ("stopgo.bridge.commands.spawn", "stopgo.bridge.robot", "stopgo.bridge.station"),
    "site": ("stopgo.site.web_server",),
    "verdicts": ("stopgo.commands.replay_command", "stopgo.commands.review_command"),
}
"""Modules that a benchmark starts in processes of their own, so that no import shows them."""
LEFT_OUT = ("stopgo", "benchmarks.table")
"""Modules that belong to no benchmark's code: one imports everything, the other writes tables."""
MODULE_OF = {"ways": "tours", "former": "whole_plans"}
"""The benchmark that makes a table, where it has another name."""

CURRENT = re.compile(r"^Measured (?P<day>[\d-]+), code (?P<code>[0-9a-f]{12}) \((?P<name>[\w-]+)\)\.$", re.M)
OLDER = re.compile(r"^Older than the code: measured .* \((?P<name>[\w-]+)\)\.$", re.M)


def stamp(name: str, day: str = "") -> str:
    """The line below a table that has just been measured."""
    return f"Measured {day or datetime.date.today().isoformat()}, code {digest(name)} ({name})."


@cache
def digest(name: str) -> str:
    """Digest of the code that a benchmark measures, and of the benchmark itself."""
    own = f"benchmarks.{MODULE_OF.get(name, name).replace('-', '_')}"
    whole = hashlib.sha256()
    for module in sorted(_imported([own, *BY_COMMAND.get(name, ())])):
        whole.update(f"{module}\n{_meaning(module)}\n".encode())
    return whole.hexdigest()[:12]


def _imported(begin: list[str]) -> set[str]:
    """Modules of ours that these import, at any depth, with the packages that they lie in."""
    found: set[str] = set()
    left = list(begin)
    while left:
        module = left.pop()
        if module not in found and module not in LEFT_OUT and _path(module) is not None:
            found.add(module)
            left += [module.rpartition(".")[0], *_names(module)]
    return found


@cache
def _path(module: str) -> Path | None:
    """The file of a module of ours; None if there is none."""
    first, *rest = module.split(".")
    if first == "stopgo" and rest and rest[0] in FOLDERS:
        stem = ROOT.joinpath(*rest)
    elif first in ("stopgo", "benchmarks"):
        stem = ROOT.joinpath(first, *rest)
    else:
        return None
    paths = (stem / "__init__.py", stem.with_suffix(".py"))
    return next((path for path in paths if path.is_file()), None)


def _names(module: str) -> Iterator[str]:
    """Imports of a module, and names of modules in its texts: those of readers and processes."""
    for node in _statements(_source(module)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
    yield from re.findall(r"stopgo(?:\.\w+)+", _told(_source(module)))


@cache
def _source(module: str) -> str:
    path = _path(module)
    assert path is not None
    return path.read_text(encoding="utf-8")


@cache
def _meaning(module: str) -> str:
    """Code of a module, and the types with which it is compiled."""
    path = _path(module)
    assert path is not None
    types = path.with_name(f"{path.stem}_compiled.pxd")
    return _told(_source(module)) + (types.read_text(encoding="utf-8") if types.is_file() else "")


@cache
def parsed(source: str) -> ast.Module:
    """Tree of a module, parsed once for all who look at it."""
    return ast.parse(source)


@cache
def _statements(source: str) -> list[ast.stmt]:
    """All statements of a module, in no order; expressions are not searched."""
    found: list[ast.stmt] = []
    left: list[ast.AST] = [parsed(source)]
    while left:
        node = left.pop()
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            inner = getattr(node, name, None)
            if isinstance(inner, list):
                left += inner
                found += [item for item in inner if isinstance(item, ast.stmt)]
    return found


@cache
def _told(source: str) -> str:
    """The lines of a module, without docstrings, blank lines, and lines that are comments."""
    lines = source.splitlines()
    for node in _statements(source):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            end = node.end_lineno or node.lineno
            lines[node.lineno - 1 : end] = [""] * (end - node.lineno + 1)
    return "\n".join(line for line in lines if line.strip() and not line.lstrip().startswith("#"))


@dataclass(frozen=True)
class Section:
    """A block of the README that a benchmark writes."""

    name: str
    text: str

    @property
    def problem(self) -> str:
        """Problem of its age; empty if every table is current, or marked as older."""
        stamps = list(CURRENT.finditer(self.text))
        if not stamps and not OLDER.search(self.text):
            return f"{self.name}: does not say with what code it was measured"
        old = [found["name"] for found in stamps if found["code"] != digest(found["name"])]
        if not old:
            return ""
        return f"{self.name}: older than its code ({', '.join(old)}); measure it, or run benchmarks.ages"


BLOCK = re.compile(r"<!-- ([\w-]+): begin -->(.*?)<!-- \1: end -->", re.S)
"""What a benchmark writes between its markers."""
TABLE = re.compile(r"^\| ?:?---", re.M)


def sections(text: str) -> list[Section]:
    """The blocks of a README that benchmarks write, and one for all tables that no benchmark writes."""
    blocks = [Section(found[1], found[2]) for found in BLOCK.finditer(text)]
    rest = BLOCK.sub("", text)
    return [*blocks, *([Section("a table outside of all blocks", "")] if TABLE.search(rest) else [])]


def marked(text: str) -> str:
    """The README with a mark at each table that is older than the code that it measures."""

    def mark(found: re.Match[str]) -> str:
        if found["code"] == digest(found["name"]):
            return found[0]
        return f"Older than the code: measured {found['day']}, code {found['code']} ({found['name']})."

    return CURRENT.sub(mark, text)


def main() -> None:
    """Mark what is older than its code, and list it."""
    text = marked(README.read_text(encoding="utf-8"))
    README.write_text(text, encoding="utf-8")
    for found in OLDER.finditer(text):
        print(found[0])
    problems = [section.problem for section in sections(text) if section.problem]
    print("\n".join(problems))
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
