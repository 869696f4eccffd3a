"""Modules that libraries load and no plan uses: each is loaded at its first use."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.abc import Loader
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import LazyLoader
from types import ModuleType
from typing import Any

SPARED_OF_NUMPY = ("numpy.f2py", "numpy.ma", "numpy.polynomial", "numpy.random", "numpy.testing")
"""Loaded by scipy, which copies all names of numpy: half of the time that scipy.sparse takes to load."""
SPARED = (*SPARED_OF_NUMPY, "ezdxf.fonts.fonts", "ezdxf.tools.pattern")
SPARED_OF_RERUN = ("rerun.experimental", "rerun.server", "rerun.urdf", "PIL.Image", "psutil")
"""Loaded by Rerun: a tenth of the time that it takes to load."""
STAND_INS = {
    "ezdxf.queryparser": "EntityQueryParser",
    "pyparsing": "ParseException",
    "scipy.sparse.csgraph._laplacian": "laplacian",
}
"""Modules from which libraries import one name that no plan uses: 30 ms of ezdxf, 45 ms of scipy."""

GATHERING = {
    "rerun.archetypes": True,
    **dict.fromkeys(("rerun.components", "rerun.encodings"), False),
    **dict.fromkeys((f"rerun.blueprint.{part}" for part in ("archetypes", "components", "encodings")), False),
}
"""Packages that only import names of their modules, of which Rerun has 400 and a plan uses the half.

True: Rerun itself imports all names, and calls them only; so they are stand-ins.
"""
_GATHERED = re.compile(r"^from \.(\w+) import (\([^)]*\)|.*)$", re.MULTILINE)


def load_when_used(names: Iterable[str] = SPARED) -> None:
    """Let each of these modules be loaded when it is used, and not when it is imported."""
    spare = _Spare(frozenset(names))
    if spare not in sys.meta_path:
        sys.meta_path.insert(0, spare)


def gather_when_used() -> None:
    """Let each module of the packages of Rerun be loaded when a name of it is used: 0.1 s."""
    sys.meta_path.insert(0, _Gather())


class _Gather:
    """Finder of packages that load their modules when they are used."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path) if name in GATHERING else None
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Gathering(spec.loader)
        return spec


class _Gathering(Loader):
    """Loader of a package that finds its names in its modules when they are used."""

    def __init__(self, loader: SourceFileLoader) -> None:
        self._loader = loader

    def exec_module(self, module: ModuleType) -> None:
        package = module.__name__
        lines = _GATHERED.findall(self._loader.get_source(package) or "")
        homes = {name: f"{package}.{part}" for part, names in lines for name in re.findall(r"\w+", names)}

        def found(name: str) -> Any:
            if name not in homes:
                raise AttributeError(name)
            load = partial(_named, homes[name], name)
            vars(module)[name] = value = _StandIn(load) if GATHERING[package] else load()
            return value

        vars(module)["__getattr__"] = found


def _named(module: str, name: str) -> Any:
    return getattr(import_module(module), name)


@dataclass(frozen=True)
class _Spare:
    """Finder of modules that are loaded when they are used."""

    names: frozenset[str]

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        known = name in self.names or name in STAND_INS
        spec = PathFinder.find_spec(name, path) if known else None
        if spec is not None and spec.loader is not None:
            imported = STAND_INS.get(name)
            spec.loader = LazyLoader(spec.loader) if imported is None else _Standing(spec.loader, imported)
        return spec


class _Standing(Loader):
    """Loader that gives a module a stand-in for its one name; any use of the module loads the rest."""

    def __init__(self, loader: Loader, name: str) -> None:
        self._loader, self._name = loader, name

    def exec_module(self, module: ModuleType) -> None:
        def found(name: str) -> Any:
            if name == "__path__":  # of a package only; asked by the import itself
                raise AttributeError(name)
            if vars(module).get("__getattr__") is found:
                del vars(module)["__getattr__"]
                self._loader.exec_module(module)
            return getattr(module, name)

        vars(module).update({"__getattr__": found, self._name: _StandIn(partial(found, self._name))})


class _StandIn:
    """Stand-in for a function or another object of a module."""

    def __init__(self, meant: Callable[[], Any]) -> None:
        self._meant = meant

    def __call__(self, *given: Any, **named: Any) -> Any:
        return self._meant()(*given, **named)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._meant(), name)
