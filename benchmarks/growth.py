"""Growth of a plan's cost with the floor's area: `python -m benchmarks.growth`.

Synthetic offices by seed, each planned in a process of its own, so that memory is counted apart.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from benchmarks.table import put, table, versions

ROOT = Path(__file__).parents[1]
SIZES = (
    (25.0, 20.0),
    (40.0, 25.0),
    (60.0, 40.0),
    (100.0, 50.0),
    (120.0, 85.0),
    (200.0, 150.0),
)
PLOT = ROOT / "docs" / "images" / "growth.svg"
FROM = 2
"""First of the sizes between which exponents are given: below, fixed costs hide them."""
STAGES = ("navigable", "candidates", "visibility", "selection", "route")

ONE = """
import json, resource, sys, time
from benchmarks.floors import office
from stopgo.mission.settings import Settings
from stopgo.planner import plan
width, height = float(sys.argv[1]), float(sys.argv[2])
floor, laps, last = office(width, height, seed=1), {}, [time.perf_counter()]
def observe(noun):
    now = time.perf_counter()
    name = type(noun).__name__
    laps[name] = laps.get(name, 0.0) + now - last[0]  # a large selection comes again with its bound
    last[0] = now
mission = plan(floor, Settings(), observe=observe).mission
print(json.dumps({"laps": laps, "stops": len(mission.stops), "rooms": len(floor.rooms),
    "mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3}))
"""


def measured(width: float, height: float) -> list[object]:
    """One row: area, rooms, stops, seconds per stage and in all, memory."""
    done = subprocess.run(
        [sys.executable, "-c", ONE, str(width), str(height)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    told = json.loads(done.stdout)
    laps = told["laps"]
    spent = [laps[n] for n in ("NavigableSpace", "Candidates", "Visibility", "Selection", "Route")]
    return [round(width * height), told["rooms"], told["stops"], *spent, sum(spent), round(told["mb"])]


def exponents(rows: list[list[object]]) -> str:
    """Exponents of the area in each stage's time, between two sizes, in one line."""
    from math import log

    small, large = rows[FROM], rows[-1]
    grown = log(large[0] / small[0])
    each = [
        f"{name} {log(large[3 + k] / small[3 + k]) / grown:.2f}" for k, name in enumerate((*STAGES, "total"))
    ]
    return f"Exponents of the area from {small[0]} to {large[0]} m²: {', '.join(each)}."


def plot(rows: list[list[object]]) -> str:
    """Seconds over m², both logarithmic, as an SVG."""
    from math import log10

    def x(area: float) -> float:
        return 60 + 420 * (log10(area) - log10(400)) / (log10(150_000) - log10(400))

    def y(seconds: float) -> float:
        return 300 - 260 * (log10(max(seconds, 0.03)) - log10(0.03)) / (log10(1000) - log10(0.03))

    points = [(x(float(row[0])), y(float(row[8]))) for row in rows]
    lines = [
        f'<polyline fill="none" stroke="#1a6" stroke-width="2" points="{" ".join(f"{a:.1f},{b:.1f}" for a, b in points)}"/>'
    ]
    lines += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3" fill="#1a6"/>' for a, b in points]
    for area in (500, 1000, 10_000, 100_000):
        lines.append(f'<line x1="{x(area):.1f}" x2="{x(area):.1f}" y1="40" y2="300" stroke="#ddd"/>')
        lines.append(f'<text x="{x(area):.1f}" y="318" text-anchor="middle">{area:,} m²</text>')
    for seconds in (0.1, 1, 10, 100, 1000):
        lines.append(f'<line x1="60" x2="480" y1="{y(seconds):.1f}" y2="{y(seconds):.1f}" stroke="#ddd"/>')
        lines.append(f'<text x="54" y="{y(seconds) + 4:.1f}" text-anchor="end">{seconds:g} s</text>')
    body = "\n".join(lines)
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 520 340" font-family="sans-serif" font-size="11">\n'
        f'<rect width="520" height="340" fill="white"/>\n{body}\n'
        '<text x="60" y="24" font-size="13">Seconds to plan a floor, by its area</text>\n</svg>\n'
    )


def main() -> None:
    """Measure, print, and write the table and the plot into their files."""
    rows = [measured(*size) for size in SIZES]
    parts = [
        "Synthetic offices (seed 1), default settings, one process each, seconds. "
        + versions("numpy", "scipy", "shapely"),
        table(["m²", "rooms", "stops", *STAGES, "total", "peak MB"], rows),
        exponents(rows),
        "![Seconds to plan a floor, by its area](../docs/images/growth.svg)",
    ]
    text = "\n\n".join(parts)
    print(text)
    PLOT.write_text(plot(rows), encoding="utf-8")
    put("growth", text)


if __name__ == "__main__":
    main()
