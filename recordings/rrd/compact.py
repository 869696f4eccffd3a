"""Rename a recording to its final name and merge its small chunks: a live one shrinks to a quarter."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import rerun

from stopgo.mission.errors import InputError
from stopgo.recordings.rrd.read import Contents, check

VIEWER = Path(rerun.__file__).parents[1] / "rerun_cli" / "rerun"
"""Native program; ending the `rerun` script would not end it."""


def compact(source: Path, target: Path) -> None:
    """Move `source` to `target`, compacted if that loses no row, else as it is.

    Raises
    ------
    InputError
        When `source` is not readable to its end, as after a full disk; it is not moved.
    """
    written = check(source)
    merged = source.with_name(f"{source.name}.tmp")  # other writers of this target have sources of their own
    try:
        if _merge(source, merged) and _is_complete(merged, written):
            os.replace(merged, target)
            source.unlink()
        else:  # for example, the disk has no room for two
            os.replace(source, target)
    finally:
        merged.unlink(missing_ok=True)


def _merge(source: Path, merged: Path) -> bool:
    """True if Rerun reports that it merged; its exit code alone does not show that all rows are there."""
    command = [str(VIEWER), "rrd", "optimize", str(source), "-o", str(merged)]
    # Ctrl-C ends the recording, not the closing of its file.
    return subprocess.run(command, capture_output=True, check=False, start_new_session=True).returncode == 0


def _is_complete(merged: Path, written: Contents) -> bool:
    """True if the merged file is complete and no entity has fewer rows.

    Rerun may split a row into its archetypes.
    """
    try:
        contents = check(merged)
    except InputError:
        return False
    return contents.complete and all(
        contents.rows.get(name, 0) >= count for name, count in written.rows.items()
    )
