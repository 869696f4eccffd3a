"""Small plots of a run: cross-track error, delay at the stops, and growth of coverage."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.console.table import duration
from stopgo.mission.geometry import FloatArray
from stopgo.mission.run.events import Scanned
from stopgo.mission.run.pose_gaps import gaps_after
from stopgo.recordings.page.style import BLUE, GREY, PURPLE, VERMILION
from stopgo.recordings.page.words import shown, tag

WIDTH, HEIGHT = 360, 150
LEFT, BOTTOM, TOP, RIGHT = 44, 20, 8, 8
MOST_POINTS = 1500
"""Limit of points; of a longer curve, the least and the greatest value of each interval are drawn."""


@dataclass(frozen=True, eq=False)
class PlotLine:
    """Line through (x, y), or marks at these points."""

    x: FloatArray
    y: FloatArray
    colour: str
    dash: str = ""
    steps: bool = False


def plots(comparison: Comparison) -> str:
    """Return every plot for which the run has data, side by side."""
    return tag("div", *_plots(comparison), class_="plots")


def _plots(comparison: Comparison) -> Iterator[str]:
    log, cross_track = comparison.log, comparison.cross_track
    finite = np.isfinite(cross_track.metres)
    if finite.any():
        seconds = log.seconds(cross_track.ns)[finite]
        tolerance = 1000 * max((stop.tolerance_m for stop in comparison.mission.stops), default=0.0)
        limits = [
            PlotLine(seconds[[0, -1]], np.full(2, side), VERMILION, "4 3") for side in (tolerance, -tolerance)
        ]
        cuts = np.flatnonzero(gaps_after(cross_track.ns[finite], log.poses.restarts_ns)) + 1
        pieces = zip(np.split(seconds, cuts), np.split(1000 * cross_track.metres[finite], cuts), strict=True)
        curves = [PlotLine(*_decimated(x, y), PURPLE) for x, y in pieces]
        yield _plot("cross-track error, mm, left positive; dashed: tolerance", [*limits, *curves])
    delays = [(item.arrived_s, item.late_s) for item in comparison.stops if item.late_s is not None]
    if delays:
        times, values = np.array(delays, dtype=np.float64).T
        yield _plot("delay at each stop, s", [PlotLine(times, values, BLUE)])
    yield from _growth(comparison)


def _growth(comparison: Comparison) -> Iterator[str]:
    """Plot coverage after each scan, and the required coverage."""
    acquired = comparison.acquired
    if acquired is None:
        return
    totals, views = acquired.sight.totals, np.zeros(len(acquired.seen), dtype=np.int64)
    visible = totals.amount(totals.visible)
    times, percentages = [0.0], [0.0]
    for event in comparison.log.events:
        if isinstance(event, Scanned) and visible:
            views = views + acquired.sight.views_from([event.stop])
            seen = totals.enough(views) & acquired.seen
            times.append(event.mission_time_s)
            percentages.append(100 * totals.amount(seen & totals.visible) / visible)
    if len(times) > 1:
        ends = np.array([0.0, times[-1]])
        least = () if totals.required is None else (100 * totals.required,)
        required = [PlotLine(ends, np.full(2, value), VERMILION, "4 3") for value in least]
        acquired_line = PlotLine(np.array(times), np.array(percentages), BLUE, steps=True)
        title = "coverage acquired, %" + ("; dashed: required" if required else "")
        yield _plot(title, [*required, acquired_line])


def _decimated(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a curve of at most MOST_POINTS that keeps every least and greatest value."""
    if len(x) <= MOST_POINTS:
        return x, y
    size = -(-2 * len(x) // MOST_POINTS)
    indices = []
    for begin in range(0, len(x), size):
        part = y[begin : begin + size]
        indices += sorted({begin + int(part.argmin()), begin + int(part.argmax())})
    return x[indices], y[indices]


def _plot(title: str, curves: Sequence[PlotLine]) -> str:
    x = np.concatenate([curve.x for curve in curves])
    y = np.concatenate([curve.y for curve in curves])
    low, high = min(0.0, float(y.min())), max(0.0, float(y.max()))
    scale = _Scale(
        float(x.min()), max(float(x.max()), float(x.min()) + 1e-9), low, high if high > low else low + 1.0
    )
    lines = [*_axes(scale), *(_curve(curve, scale) for curve in curves)]
    picture = tag("svg", *lines, width=WIDTH, height=HEIGHT, viewBox=f"0 0 {WIDTH} {HEIGHT}")
    return tag("figure", picture, tag("figcaption", shown(title)))


@dataclass(frozen=True)
class _Scale:
    """Range of a plot."""

    left: float
    right: float
    low: float
    high: float

    def x(self, value: FloatArray) -> FloatArray:
        return LEFT + (value - self.left) / (self.right - self.left) * (WIDTH - LEFT - RIGHT)

    def y(self, value: FloatArray) -> FloatArray:
        return HEIGHT - BOTTOM - (value - self.low) / (self.high - self.low) * (HEIGHT - BOTTOM - TOP)


def _axes(scale: _Scale) -> Iterator[str]:
    for value in (scale.low, 0.0, scale.high):
        y = float(scale.y(np.array(value)))
        yield tag("path", d=f"M{LEFT} {y:.1f}H{WIDTH - RIGHT}", stroke="#c9ccd2", stroke_width=1)
    for value in {scale.low, scale.high}:
        y = float(scale.y(np.array(value)))
        yield tag("text", f"{value:.4g}".replace("-", "−"), x=LEFT - 4, y=f"{y + 4:.1f}", text_anchor="end",
                  font_size=11, fill="#333")  # fmt: skip
    for value, anchor in ((scale.left, "start"), (scale.right, "end")):
        x = float(scale.x(np.array(value)))
        yield tag(
            "text", duration(value), x=f"{x:.1f}", y=HEIGHT - 5, text_anchor=anchor, font_size=11, fill="#333"
        )
    yield tag("path", d=f"M{LEFT} {TOP}V{HEIGHT - BOTTOM}", stroke=GREY, stroke_width=1)


def _curve(curve: PlotLine, scale: _Scale) -> str:
    points = list(zip(scale.x(curve.x).tolist(), scale.y(curve.y).tolist(), strict=True))
    d = f"M{points[0][0]:.1f} {points[0][1]:.1f}"
    for x, y in points[1:]:
        d += f"H{x:.1f}V{y:.1f}" if curve.steps else f"L{x:.1f} {y:.1f}"
    dash = {"stroke_dasharray": curve.dash} if curve.dash else {}
    return tag("path", d=d, fill="none", stroke=curve.colour, stroke_width=1.5, **dash)
