"""Modules that libraries load and no plan uses: each is loaded at its first use."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from importlib.util import LazyLoader, find_spec, module_from_spec

SPARED = ("numpy.f2py", "numpy.ma", "numpy.random", "numpy.testing")
"""Loaded by scipy, which copies all names of numpy: half of the time that scipy.sparse takes to load."""


def load_when_used(names: Iterable[str] = SPARED) -> None:
    """Put a stand-in for each of these modules; it loads the module when that is imported or used."""
    for name in names:
        package, _, own = name.rpartition(".")
        spec = None if name in sys.modules else find_spec(name)
        if spec is None or spec.loader is None:
            continue
        spec.loader = LazyLoader(spec.loader)
        module = module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
        setattr(sys.modules[package], own, module)
