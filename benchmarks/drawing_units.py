"""Table of drawings whose unit is read right, asked for, or wrong: layered and synthetic ones in every unit.

python -m benchmarks.drawing_units [FOLDER of drawings in metres] [DRAWING:UNIT …]
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from stopgo.planner.floors.units.unit_lengths import CODES as NAMED
from tests.planner.floors.unit_drawings import CODES, EVIDENCE, house, rescaled, verdict


def main() -> None:
    """Print how many drawings of each kind are right, asked and wrong."""
    totals: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drawing.dxf"
        for name, counts in (*_synthetic(path), *_layered(path), *_others(path)):
            _print(name, counts)
            totals += counts
    _print("all", totals)


def _synthetic(path: Path) -> Iterator[tuple[str, Counter[str]]]:
    for kind in EVIDENCE:
        counts = Counter(verdict(house(seed, code, kind), code, path) for seed in range(6) for code in CODES)
        yield f"synthetic, {kind}", counts


def _layered(path: Path) -> Iterator[tuple[str, Counter[str]]]:
    folders = [name for name in sys.argv[1:] if Path(name).is_dir()]
    for real in sorted(item for folder in folders for item in Path(folder).glob("*.dxf")):
        for kind in ("header", "bare", "no doors"):
            yield (
                f"{real.stem}, {kind}",
                Counter(verdict(rescaled(real, code, kind), code, path) for code in CODES),
            )


def _others(path: Path) -> Iterator[tuple[str, Counter[str]]]:
    """Drawings of which a person knows the unit, in every unit: all of them by kind."""
    given = [name.rpartition(":") for name in sys.argv[1:] if not Path(name).is_dir()]
    for kind in ("header", "bare", "no doors", "no dimensions", "wrong header"):
        yield (
            f"{len(given)} real drawings, {kind}",
            Counter(
                verdict(rescaled(Path(name), code, kind, own=NAMED[unit]), code, path)
                for name, _, unit in given
                for code in CODES
            ),
        )


def _print(name: str, counts: Counter[str]) -> None:
    print(f"{name:36} " + "  ".join(f"{kind} {counts[kind]:4}" for kind in ("right", "asked", "wrong")))


if __name__ == "__main__":
    main()
