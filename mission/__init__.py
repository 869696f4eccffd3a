"""The nouns of stopgo and the files they are written to. Imports nothing else of the project."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("stopgo")
except PackageNotFoundError:  # run from a checkout that was never installed
    __version__ = "0.0.0"
