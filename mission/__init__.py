"""The nouns of stopgo and the files they are written to. Imports nothing else of the project."""

from __future__ import annotations

__version__: str


def __getattr__(name: str) -> str:
    """The version, looked up when it is asked for: no command that does not print it waits for that."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import PackageNotFoundError, version

    try:
        found = version("stopgo")
    except PackageNotFoundError:  # run from a checkout that was never installed
        found = "0.0.0"
    globals()[name] = found
    return found
