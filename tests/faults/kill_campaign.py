"""Many kill trials of `test_kill`, several at a time, and their counts.

Run: python -m tests.faults.kill_campaign --trials 300 [--first 50000] [--at-once 4]. Seeded. Of ten trials,
five kill a robot without keys, four one with keys, each some six times; in one a revision waits. A
violation is printed with its seed, and the exit code is then 1.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import tempfile
import traceback
from collections import Counter
from pathlib import Path

from tests.faults.test_kill import HARSH, OPEN, Outcome, guarded, trial, trial_of_a_revision
from tests.workers import NUMBER

KINDS = ("without keys",) * 5 + ("with keys",) * 4 + ("revision",)
TOLD_EVERY = 20


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trials", type=int, default=300)
    options.add_argument("--first", type=int, default=50_000)
    options.add_argument("--at-once", type=int, default=4)
    given = options.parse_args()
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    violations = 0
    seeds = range(given.first, given.first + given.trials)
    with multiprocessing.get_context("spawn").Pool(given.at_once) as pool:
        for done, (kind, outcome, violation) in enumerate(pool.imap_unordered(counted, seeds), start=1):
            counts[kind].update(
                trials=1, kills=outcome.kills, commands=outcome.orders, unanswered=outcome.unknown
            )
            violations += bool(violation)
            if violation:
                print(violation, flush=True)
            if done % TOLD_EVERY == 0 or done == given.trials:
                kills = sum(count["kills"] for count in counts.values())
                print(f"{done} trials, {kills} kills, {violations} violations:",
                      *(f"{kind} {dict(count)};" for kind, count in counts.items()), flush=True)  # fmt: skip
    return 1 if violations else 0


def counted(seed: int) -> tuple[str, Outcome, str]:
    """Carry out the trial of a seed: its kind, its counts, and the violation that it found; empty if none."""
    # Each process has ports of its own (`tests.ports`).
    os.environ[NUMBER] = str(multiprocessing.current_process()._identity[0])
    kind = KINDS[seed % len(KINDS)]
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        try:
            if kind == "revision":
                return kind, trial_of_a_revision(seed, folder / "state"), ""
            site = OPEN if kind == "without keys" else guarded(folder / "keys")
            return kind, trial(seed, folder / "state", site, HARSH), ""
        except Exception:  # noqa: BLE001 (the end of a process)
            return kind, Outcome(), f"VIOLATION: {kind}, seed {seed}\n{traceback.format_exc()}"


if __name__ == "__main__":
    sys.exit(main())
