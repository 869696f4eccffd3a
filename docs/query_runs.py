"""Example: query the recordings of many runs with Rerun's dataframe API (`pip install 'rerun-sdk[catalog]'`).

Run it as `python docs/query_runs.py FOLDER`, where FOLDER holds field recordings. It prints two tables: the
runs, and for each stop its mean and greatest position error over all runs.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from rerun.server import Server

STOPS = "/run/stops"
"""Entity with one row for each stop of a run; docs/reference/recordings.md lists its columns."""


def main(folder: Path) -> None:
    """Print the tables of a folder of recordings."""
    paths = sorted(map(str, folder.glob("*.rrd")))
    with Server(host="127.0.0.1", datasets={"runs": paths}) as server:
        dataset = server.client().get_dataset("runs")
        runs = dataset.segment_table().to_pandas()
        stops = stops_of(dataset)
    names = ["rerun_segment_id", *(name for name in runs.columns if name.startswith("property:run:"))]
    sys.stdout.write(f"{runs[names].to_string(index=False)}\n{errors_of(stops).to_string()}\n")


def stops_of(dataset: Any) -> Any:
    """Return the stops of all runs as one table."""
    table = dataset.filter_contents(STOPS).reader(index="stop").to_pandas()
    columns = {name: name.rpartition(":")[2] for name in table.columns if name.startswith(f"{STOPS}:")}
    named = table[list(columns)].rename(columns=columns)
    return named.map(lambda cell: cell[0] if cell is not None and len(cell) == 1 else cell)


def errors_of(stops: Any) -> Any:
    """Return the number of scans, and the mean and greatest position error in metres, of each stop."""
    scanned = stops[stops["outcome"] == "scanned"]
    return scanned.groupby("stop")["deviation_m"].agg(["count", "mean", "max"])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
