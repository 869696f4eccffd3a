"""Table of drawings whose unit is read right, asked for, or wrong: layered and synthetic ones in every unit.

python -m benchmarks.drawing_units [FOLDER of drawings in metres]
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.planner.floors.unit_drawings import CODES, EVIDENCE, house, rescaled, verdict


def main() -> None:
    """Print how many drawings of each kind are right, asked and wrong."""
    totals: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drawing.dxf"
        for kind in EVIDENCE:
            counts = Counter(
                verdict(house(seed, code, kind), code, path) for seed in range(6) for code in CODES
            )
            _print(f"synthetic, {kind}", counts)
            totals += counts
        for real in sorted(Path(sys.argv[1]).glob("*.dxf")) if len(sys.argv) > 1 else ():
            for kind in ("header", "bare", "no doors"):
                counts = Counter(verdict(rescaled(real, code, kind), code, path) for code in CODES)
                _print(f"{real.stem}, {kind}", counts)
                totals += counts
    _print("all", totals)


def _print(name: str, counts: Counter[str]) -> None:
    print(f"{name:36} " + "  ".join(f"{kind} {counts[kind]:4}" for kind in ("right", "asked", "wrong")))


if __name__ == "__main__":
    main()
