"""The truth bench: verdicts on logs and runs whose truth is known, by what happened and what was lost of it."""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.table import put, table, versions
from tests.recordings.truth.auto_logs import auto_answers
from tests.recordings.truth.bench import answered, cases
from tests.recordings.truth.cloud_cases import cloud_answers, small_floor
from tests.recordings.truth.own_runs import own_answers, recorded_answers

KINDS = ("right", "false yes", "false no", "untold", "open")
OWN_SEEDS = range(1, 4)


def main() -> None:
    """Judge the cases and put the tables into the README; with `--every N`, of logs every N-th."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--every", type=int, default=1)
    every = options.parse_args().every
    found = [*_logs(every), *_auto(), *_clouds(), *_own()]
    text = "\n\n".join(
        (
            versions("numpy", "rosbags", "pymavlink", "pyulog")
            + (f". Of logs one case in {every}." if every > 1 else ""),
            _table("source", ((source, kind) for source, _, kind in found)),
            _table("what was lost, or wrong", ((loss, kind) for _, loss, kind in found)),
            "*false yes*, *false no*: the answer contradicts the truth. *untold*: undecided or refused, although an oracle that "
            "knows the error of each pose could tell. *open*: undecided, and the oracle could not tell either.",
        )
    )
    put("verdicts", text)


def _logs(every: int) -> Iterator[tuple[str, str, str]]:
    """Yield source, loss and kind of answer of every so-manyth log of another maker."""
    for number, case in enumerate(islice(cases(), 0, None, every)):
        if number % 50 == 0:
            print(f"{number} logs judged", file=sys.stderr, flush=True)
        with TemporaryDirectory() as folder:
            answer = answered(case, Path(folder))
        if answer.kind not in ("right", "open"):
            print(f"{answer.kind}: {case.name}: {answer.text[:200]}", file=sys.stderr, flush=True)
        yield case.writer.__name__, case.sense.__name__, answer.kind


def _auto() -> Iterator[tuple[str, str, str]]:
    """Yield the same of logs of an autopilot that drove our mission by itself."""
    with TemporaryDirectory() as folder:
        for answer in auto_answers(Path(folder)):
            if answer.kind not in ("right", "open"):
                print(f"{answer.kind}: {answer.name}: {answer.text[:200]}", file=sys.stderr, flush=True)
            yield answer.source, answer.name.split(" / ")[1].split(" #")[0], answer.kind


def _clouds() -> Iterator[tuple[str, str, str]]:
    """Yield the same of clouds of the surveying scanner."""
    with TemporaryDirectory() as folder:
        for answer in cloud_answers(small_floor(Path(folder))):
            if answer.kind != "right":
                print(f"{answer.kind}: {answer.name}: {answer.text[:200]}", file=sys.stderr, flush=True)
            yield "clouds", f"clouds: {answer.name}", answer.kind


def _own() -> Iterator[tuple[str, str, str]]:
    """Yield the same of runs of our own robots."""
    for seed in OWN_SEEDS:
        for answer in own_answers(seed):
            yield "a station's reports", answer.name.split(" / ")[1].split(" #")[0], answer.kind
    with TemporaryDirectory() as folder:
        for answer in recorded_answers(Path(folder)):
            if answer.kind not in ("right", "open"):
                print(f"{answer.kind}: {answer.name}: {answer.text[:200]}", file=sys.stderr, flush=True)
            source = "rrd, " + answer.name.split(" / ")[-1].split(" #")[0]
            yield source, answer.name.split(" / ")[1], answer.kind


def _table(head: str, pairs: Iterable[tuple[str, str]]) -> str:
    counts: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for name, kind in pairs:
        counts[name.replace("_", " ")][kind] += 1
        counts["**all**"][kind] += 1
    names = [*sorted(name for name in counts if name != "**all**"), "**all**"]
    rows = [[name, counts[name].total(), *(counts[name][kind] for kind in KINDS)] for name in names]
    return table([head, "cases", *KINDS], rows)


if __name__ == "__main__":
    main()
