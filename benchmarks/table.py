"""Markdown tables, and their markers in README.md and SURVEYS.md."""

from __future__ import annotations

import io
import platform
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from benchmarks.ages import README, stamp

SURVEYS = Path(__file__).with_name("SURVEYS.md")


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table; floats are rounded to three significant figures."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(_cell(cell) for cell in line) + " |" for line in lines)


def _cell(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def versions(*names: str) -> str:
    """`python 3.11, numpy 2.4.6, …`; what is not installed says so."""
    told = [f"python {platform.python_version()}"]
    for name in names:
        try:
            told.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            told.append(f"{name} not installed")
    return ", ".join(told)


def median_seconds(action: Callable[[], object], *, runs: int = 5) -> float:
    """Median time of an action after one run that is not counted."""
    action()
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        action()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def put(section: str, text: str) -> None:
    """Replace what stands between the section's markers on its page, and stamp it with the code measured."""
    begin, end = f"<!-- {section}: begin -->", f"<!-- {section}: end -->"
    page = next(page for page in (README, SURVEYS) if begin in page.read_text(encoding="utf-8"))
    before, _, rest = page.read_text(encoding="utf-8").partition(begin)
    page.write_text(
        f"{before}{begin}\n{text}\n\n{stamp(section)}\n{end}{rest.partition(end)[2]}", encoding="utf-8"
    )


@contextmanager
def lines_put(section: str) -> Iterator[None]:
    """Print as before, and put the lines that are printed meanwhile into a section, as a list."""
    printed = io.StringIO()
    with redirect_stdout(printed):
        yield
    print(printed.getvalue(), end="")
    put(section, "".join(f"- {line}\n" for line in printed.getvalue().splitlines()).rstrip())
