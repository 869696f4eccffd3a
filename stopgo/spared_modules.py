"""Modules that libraries load and no plan uses: each is loaded at its first use."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType

SPARED = ("numpy.f2py", "numpy.ma", "numpy.random", "numpy.testing")
"""Loaded by scipy, which copies all names of numpy: half of the time that scipy.sparse takes to load."""
SPARED_OF_RERUN = ("rerun.experimental", "rerun.server", "rerun.urdf")
"""Loaded by Rerun: a tenth of the time that it takes to load."""


def load_when_used(names: Iterable[str] = SPARED) -> None:
    """Let each of these modules be loaded when it is used, and not when it is imported."""
    spare = _Spare(frozenset(names))
    if spare not in sys.meta_path:
        sys.meta_path.insert(0, spare)


@dataclass(frozen=True)
class _Spare:
    """Finder of modules that are loaded when they are used."""

    names: frozenset[str]

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path) if name in self.names else None
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec
