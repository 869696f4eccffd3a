"""Give a recording its final name, its many small chunks merged into few: a live one shrinks to a quarter."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import rerun

from mission.errors import InputError
from recordings.read import check

VIEWER = Path(rerun.__file__).parents[1] / "rerun_cli" / "rerun"
"""The native program: ending the `rerun` script would leave it running."""


def compact(source: Path, target: Path) -> None:
    """Move `source` to `target`, compacted if that loses no row, else as it is."""
    merged = target.with_name(f"{target.name}.tmp")
    try:
        if _merge(source, merged) and _holds_all(merged, source):
            os.replace(merged, target)
            source.unlink()
        else:
            os.replace(source, target)
    finally:
        merged.unlink(missing_ok=True)


def _holds_all(merged: Path, source: Path) -> bool:
    """Whether no entity has fewer rows than before; Rerun may split a row into its archetypes."""
    rows = check(merged).rows
    return all(rows.get(entity, 0) >= count for entity, count in check(source).rows.items())


def _merge(source: Path, merged: Path) -> bool:
    """Whether Rerun made a readable file; its exit code alone does not tell."""
    command = [str(VIEWER), "rrd", "optimize", str(source), "-o", str(merged)]
    # Ctrl-C ends the recording, not the closing of its file.
    done = subprocess.run(command, capture_output=True, check=False, start_new_session=True)
    try:
        return done.returncode == 0 and check(merged).complete
    except InputError:
        return False
