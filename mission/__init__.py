"""Data of every stage of stopgo, and the files it is written to. Imports nothing else of the project."""

from __future__ import annotations

__version__: str


def __getattr__(name: str) -> str:
    """Return the version; it is looked up on first use, so that other commands do not wait for it."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import PackageNotFoundError, version

    try:
        found = version("stopgo")
    except PackageNotFoundError:  # run from a checkout that was never installed
        found = "0.0.0"
    globals()[name] = found
    return found
