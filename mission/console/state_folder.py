"""The folder in which programs keep their state for a user, and the home of a user without one."""

from __future__ import annotations

import os
import stat
from pathlib import Path

NO_HOME = "/nonexistent"
"""Home that nothing is read from and nothing can be written to."""


def state_folder() -> Path:
    """Return stopgo's folder in `$XDG_STATE_HOME`, else in `~/.local/state`."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "stopgo"


def have_home() -> None:
    """Give this process a home if its user has none, or none that may be entered.

    Such users are numbers without a name in a container, and those who kept another's HOME. The home is a
    folder of this user alone among the temporary files. Without it, libraries that look for their settings
    could not be imported.
    """
    if os.name == "posix" and not _has_home():
        home = f"{os.environ.get('TMPDIR') or '/tmp'}/stopgo-home-{os.getuid()}"
        os.environ["HOME"] = home if _is_private(home) else NO_HOME


def _has_home() -> bool:
    try:
        home = Path.home()
    except RuntimeError:
        return False
    return not os.path.lexists(home) or os.access(home, os.X_OK)


def _is_private(folder: str) -> bool:
    """True if a folder is there, or was made now, and only this user can enter it."""
    try:
        os.makedirs(folder, 0o700, exist_ok=True)
        found = os.lstat(folder)
    except OSError:
        return False
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & 0o077
