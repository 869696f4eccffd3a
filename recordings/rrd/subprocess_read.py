"""Files of unknown history are first read in another process: on some damage Rerun ends whoever reads."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from stopgo.recordings.rrd.read import looks_like_one

CHILD = """
import json, sys
sys.path[:], paths = json.load(sys.stdin)
from pathlib import Path
from stopgo.mission.errors import InputError
from stopgo.recordings.rrd.read import check
for number, path in enumerate(paths):
    print(number, flush=True)
    try:
        check(Path(path))
    except InputError:
        pass
"""
"""Reads each file to its end, and says before it which it is."""


def fatal_faults(paths: Sequence[Path]) -> dict[Path, str]:
    """The files at which a reader ends, each with a line that says so.

    One process reads all, and after a file at which it ended another one those behind it.
    """
    faults: dict[Path, str] = {}
    left = [path for path in paths if looks_like_one(path)]
    while left:
        told = json.dumps([sys.path, [str(path) for path in left]])
        reader = subprocess.run(
            [sys.executable, "-c", CHILD], input=told, capture_output=True, text=True, check=False
        )
        begun = len(reader.stdout.split())
        if reader.returncode == 0 or not begun:
            return faults
        path = left[begun - 1]
        if reader.returncode < 0:  # what it refuses in words is refused here, too
            faults[path] = f"{path}: damaged (reading it ended with signal {-reader.returncode})"
        left = left[begun:]
    return faults
