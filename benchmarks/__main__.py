"""Every table of benchmarks/README.md, one after the other: `python -m benchmarks [NAME…] [--minutes 30]`.

Each benchmark is a process of its own. One that does not end in the time that is left is ended; its table stays
as it is, and is marked as older than its code. Exit code 1: a benchmark failed, was ended, or had no time left.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.table import table

ROOT = Path(__file__).parents[1]
ALL: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(
        (
            "whole_plans",
            "selections",
            "growth",
            "paper",
            "tours",
            "visibility",
            "models",
            "shares",
            "quality",
        ),
        (),
    ),
    **dict.fromkeys(("least_time", "sharing", "overlap", "all_places", "drawings", "recordings"), ()),
    **dict.fromkeys(("logs", "proofs", "campus", "bridge", "fleet"), ()),
    "verdicts": ("--every", "2"),
}
"""Options of each benchmark, those of the planner first."""


def main() -> None:
    """Run the benchmarks, mark what is older than its code, and print how long each took."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(ALL)}; else all")
    options.add_argument("--minutes", type=float, default=30.0, help="time for all of them")
    given = options.parse_args()
    unknown = sorted(set(given.names) - set(ALL))
    if unknown:
        options.error(f"no benchmark {', '.join(unknown)}; there are {', '.join(ALL)}")
    end, rows = time.monotonic() + 60 * given.minutes, []
    for name in given.names or ALL:
        begin = time.monotonic()
        rows.append([name, outcome(name, end - begin), time.monotonic() - begin])
        print(*rows[-1], flush=True)
    subprocess.run([sys.executable, "-m", "benchmarks.ages"], cwd=ROOT, check=False)
    print(table(["benchmark", "outcome", "s"], rows))
    sys.exit(0 if all(row[1] == "done" for row in rows) else 1)


def outcome(name: str, seconds: float) -> str:
    """Outcome of one benchmark: done, failed, or out of time."""
    if seconds <= 0:
        return "no time left"
    command = [sys.executable, "-m", f"benchmarks.{name}", *ALL[name]]
    process = subprocess.Popen(command, cwd=ROOT, start_new_session=True)
    try:
        code = process.wait(seconds)
    except BaseException as error:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # with the processes that it has started
        process.wait()
        if not isinstance(error, subprocess.TimeoutExpired):
            raise
        return "ended: no time left"
    return "done" if code == 0 else f"failed ({code})"


if __name__ == "__main__":
    main()
