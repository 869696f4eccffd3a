"""The folder in which programs keep their state for a user."""

from __future__ import annotations

import os
from pathlib import Path


def state_folder() -> Path:
    """Return stopgo's folder in `$XDG_STATE_HOME`, else in `~/.local/state`."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "stopgo"
