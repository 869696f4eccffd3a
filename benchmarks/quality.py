"""Cost of limits on views: without flat rays, wide spacing and single views."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.shares import FLOORS
from benchmarks.table import put, table, versions
from stopgo.mission.files.plan_toml import read_settings
from stopgo.mission.stages import Selection, Visibility
from stopgo.mission.stages.figures import percent
from stopgo.planner import plan
from stopgo.planner.floors import options_of, read_floor

SCANNER: dict[str, Any] = {"scanner": "rtc360-medium"}
ASKED: dict[str, dict[str, Any]] = {
    "as the scanner sees": SCANNER,
    "≤ 70°": {**SCANNER, "max_incidence": 70.0},
    "≤ 5 mm": {**SCANNER, "density": 5.0},
    "≤ 70°, ≤ 5 mm": {**SCANNER, "max_incidence": 70.0, "density": 5.0},
    "≤ 70°, ≤ 5 mm, 2 stops": {**SCANNER, "max_incidence": 70.0, "density": 5.0, "views": 2},
}


def main() -> None:
    """Plan every floor at hand with each of these and put the table into the README."""
    at_hand = {name: value for name, value in FLOORS.items() if value[0].exists()}
    rows = [row for name, (path, more) in at_hand.items() for row in rows_of(name, path, more)]
    text = "\n\n".join(
        (
            versions("numpy", "scipy", "shapely", "highspy"),
            table(["floor", "asked", "stops / bound", "possible", "seen of all", "choice s"], rows),
            "Scanner rtc360-medium (6 mm at 10 m, range 130 m, blind up to 0.75 m), 0.9 of the whole. *possible*: "
            "of what is in sight of any candidate, what can be seen so, from as many candidates as stops are "
            "asked for. *seen of all*: of that same, what the stops see so. *choice s*: seconds of processor time of the selection, "
            "places beside the stops included.",
        )
    )
    put("quality", text)


def rows_of(name: str, path: Path, more: dict[str, Any]) -> Iterator[list[object]]:
    """One row for each set of limits."""
    for words, asked in ASKED.items():
        settings = read_settings(None, {**more, **asked})
        watch = _Watch()
        made = plan(read_floor(path, options_of(settings)), settings, observe=watch.observe).first
        figures, quality = made.figures, made.figures.quality
        assert quality is not None
        yield [
            *(name, words, f"{len(made.selection.chosen)} / {made.selection.bound}"),
            percent(quality.possible / quality.in_sight),
            percent(figures.whole.seen / quality.in_sight),
            watch.seconds,
        ]


class _Watch:
    """Seconds between visibility and selection."""

    seconds = 0.0

    def observe(self, noun: object) -> None:
        """Start and stop the clock at the stage results."""
        if isinstance(noun, Visibility):
            self._begin = time.process_time()
        if isinstance(noun, Selection):
            self.seconds = time.process_time() - self._begin


if __name__ == "__main__":
    main()
