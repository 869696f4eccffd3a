"""Time and memory of reading field logs: `python -m benchmarks.logs [--evo PYTHON]`.

With the Python of an environment in which evo is installed, evo reads the same files too.
"""

from __future__ import annotations

import argparse
import json
import struct
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from benchmarks.table import put, table, versions
from tests.recordings.logs.writing import BEGIN_NS, ODOMETRY, Messages

SMALL, LARGE = 100_000, 1_400_000
"""Messages of odometry; the second makes 1 GB."""
STEP_NS = 10**7
MARK = 1234.5678
"""Marks the bytes of x and y in a message."""
OURS = """
import json, resource, sys, time
from pathlib import Path
from stopgo.recordings.logs import read_log
begin = time.process_time()
track = read_log(Path(sys.argv[1])).poses[0]
print(json.dumps({
    "s": time.process_time() - begin, "mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    "poses": len(track.ns), "sum": float(track.xy.sum()), "last": track.xy[-1].tolist(),
}))
"""
EVOS = """
import json, resource, sys, time
from pathlib import Path
from evo.tools import file_interface
from rosbags.highlevel import AnyReader
begin = time.process_time()
with AnyReader([Path(sys.argv[1])]) as reader:
    from rosbags.rosbag1 import Reader as R1
    from rosbags.rosbag2 import Reader as R2
    kind = R1 if sys.argv[1].endswith(".bag") else R2
with kind(Path(sys.argv[1])) as bag:
    way = file_interface.read_bag_trajectory(bag, "/odom")
xy = way.positions_xyz[:, :2]
print(json.dumps({
    "s": time.process_time() - begin, "mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    "poses": len(xy), "sum": float(xy.sum()), "last": xy[-1].tolist(),
}))
"""


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the logs, read each in a process of its own, and write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--evo", help="Python of an environment that has evo")
    evo = parser.parse_args(arguments).evo
    rows = []
    with TemporaryDirectory() as folder:
        for name, count in (("a.mcap", SMALL), ("a.db3", SMALL), ("a.bag", SMALL), ("large.mcap", LARGE)):
            path = written(Path(folder) / name, count)
            ours = run(sys.executable, OURS, path)
            theirs = run(evo, EVOS, path) if evo else None
            rows.append(row(path, ours, theirs))
    head = ("log", "MB", "messages", "s", "peak MB", "evo s", "evo peak MB", "same poses")
    text = f"CPU seconds. {versions('rosbags', 'numpy')}\n\n{table(head, rows)}"
    put("logs", text)
    print(text)


def row(path: Path, ours: dict[str, Any], theirs: dict[str, Any] | None) -> list[object]:
    size = sum(file.stat().st_size for file in ([path] if path.is_file() else path.iterdir())) / 1e6
    told: list[object] = ["-", "-", "-"]
    if theirs is not None:
        same = ours["poses"] == theirs["poses"] and np.allclose(
            [ours["sum"], *ours["last"]], [theirs["sum"], *theirs["last"]], rtol=1e-12
        )
        told = [theirs["s"], round(theirs["mb"]), "yes" if same else "NO"]
    return [path.name, round(size), ours["poses"], ours["s"], round(ours["mb"]), *told]


def run(python: str, program: str, path: Path) -> dict[str, Any]:
    """Last line printed by a program in a process of its own."""
    done = subprocess.run([python, "-c", program, str(path)], capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def written(path: Path, count: int) -> Path:
    """A log of so many odometry messages, 10 ms apart, on a spiral."""
    messages = Messages(ros2=path.suffix != ".bag")
    storage = {".mcap": StoragePlugin.MCAP, ".db3": StoragePlugin.SQLITE3}.get(path.suffix)
    writer = Writer2(path, version=9, storage_plugin=storage) if storage is not None else Writer1(path)
    with writer:
        odometry = writer.add_connection("/odom", ODOMETRY, typestore=messages.store)
        for ns, data in _bodies(messages, count):
            writer.write(odometry, ns, data)
    return path


def _bodies(messages: Messages, count: int) -> Iterator[tuple[int, bytes]]:
    """One message's bytes with each time and place put in."""
    body = bytearray(messages.raw(messages.odometry(BEGIN_NS, (MARK, MARK, 0.3)), ODOMETRY))
    place = body.index(struct.pack("<dd", MARK, MARK))
    stamp = body.index(struct.pack("<II", BEGIN_NS // 10**9, BEGIN_NS % 10**9))
    for k in range(count):
        ns, turn = BEGIN_NS + k * STEP_NS, k / 5000
        struct.pack_into("<II", body, stamp, ns // 10**9, ns % 10**9)
        struct.pack_into("<dd", body, place, turn * np.cos(turn), turn * np.sin(turn))
        yield ns, bytes(body)


if __name__ == "__main__":
    main()
