"""Read files in another process first: some damage makes Rerun end the process that reads."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from stopgo.recordings.rrd.read import looks_like_one

CHILD = """
import json, sys, types
from importlib.machinery import PathFinder
sys.path[:], paths = json.load(sys.stdin)
sys.modules["rerun"] = types.ModuleType("rerun")
sys.modules["rerun"].__path__ = PathFinder.find_spec("rerun").submodule_search_locations
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
"""Program that reads each file to its end, and prints its number first.

It needs one part of Rerun. All of Rerun takes longer to load than a recording takes to read.
"""


def fatal_faults(paths: Sequence[Path]) -> dict[Path, str]:
    """Return the files whose reading ended the process, each with a message.

    One process reads all files. If it ends at one, another process reads the files after that one.
    """
    faults: dict[Path, str] = {}
    left = [path for path in paths if looks_like_one(path)]
    while left:
        arguments = json.dumps([sys.path, [str(path) for path in left]])
        reader = subprocess.run(
            [sys.executable, "-c", CHILD], input=arguments, capture_output=True, text=True, check=False
        )
        begun = len(reader.stdout.split())
        if reader.returncode == 0 or not begun:
            return faults
        path = left[begun - 1]
        if reader.returncode < 0:  # the reader in this process refuses such a file, too
            faults[path] = f"{path}: damaged (reading it ended with signal {-reader.returncode})"
        left = left[begun:]
    return faults
