"""Folders of files that all workers use, and that the first who needs them writes."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from tests.workers import NUMBER


def shared_folder(factory: pytest.TempPathFactory, name: str, write: Callable[[Path], object]) -> Path:
    """Folder that `write` has filled.

    Workers that need it at the same moment write it each; the first to finish gives it to all others.
    """
    base = factory.getbasetemp()
    shared = (base.parent if NUMBER in os.environ else base) / f"shared-{name}"
    if not shared.exists():
        own = factory.mktemp(name)
        write(own)
        with suppress(OSError):  # another has just given it
            own.rename(shared)
    return shared
