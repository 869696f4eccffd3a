"""Give a recording its final name, its many small chunks merged into few: a live one shrinks to a quarter."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import rerun

from stopgo.mission.errors import InputError
from stopgo.recordings.rrd.read import Contents, check

VIEWER = Path(rerun.__file__).parents[1] / "rerun_cli" / "rerun"
"""The native program: ending the `rerun` script would leave it running."""


def compact(source: Path, target: Path) -> None:
    """Move `source` to `target`, compacted if that loses no row, else as it is.

    Raises
    ------
    InputError
        When `source` is not readable to its end, as after a full disk; it is left where it is.
    """
    written = check(source)
    merged = target.with_name(f"{target.name}.tmp")
    try:
        if _merge(source, merged) and _holds(merged, written):
            os.replace(merged, target)
            source.unlink()
        else:  # such as on a disk without room for two
            os.replace(source, target)
    finally:
        merged.unlink(missing_ok=True)


def _merge(source: Path, merged: Path) -> bool:
    """Whether Rerun says that it merged; its exit code alone does not tell that all is there."""
    command = [str(VIEWER), "rrd", "optimize", str(source), "-o", str(merged)]
    # Ctrl-C ends the recording, not the closing of its file.
    return subprocess.run(command, capture_output=True, check=False, start_new_session=True).returncode == 0


def _holds(merged: Path, written: Contents) -> bool:
    """Whether it is whole, and no entity has fewer rows; Rerun may split a row into its archetypes."""
    try:
        held = check(merged)
    except InputError:
        return False
    return held.complete and all(held.rows.get(name, 0) >= count for name, count in written.rows.items())
