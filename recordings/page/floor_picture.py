"""Plan as SVG inside the page: floor, covered and lost targets, paths, and the outcome of each stop."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.console.table import duration
from stopgo.mission.document import Mission, Stop
from stopgo.mission.files.sheet import PaperMap
from stopgo.mission.files.svg import text_width
from stopgo.mission.geometry import BoolArray, FloatArray, bounds, is_closed
from stopgo.mission.run.events import Held, LinkLost, Paused
from stopgo.mission.run.route_position import legs_of
from stopgo.mission.settings.element_kinds import kind_of
from stopgo.mission.stages import Targets
from stopgo.mission.stages.covered_intervals import lines_along
from stopgo.mission.stages.network import MagnifiedErrors, magnified_errors
from stopgo.recordings.page.style import BLUE, ERROR, GREY, INK, PURPLE, VERMILION, YELLOW
from stopgo.recordings.page.subject import ReportSubject
from stopgo.recordings.page.words import shown, tag

MOST_LABELS = 300
"""Number of stops above which only stops that need attention are named."""
FOOT = 0.035
"""Height of the strip with scale bar and north arrow, as a fraction of the floor's size."""
LEAST_PX, LEAST_MM = 11.0, 2.5
"""Smallest text on a screen, where a narrow one scrolls, and on paper."""
PAPER_MM = 170.0
"""Greatest width and height of the plan on paper, as in the page's style."""
BARS_M = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Lengths of the scale bar."""
SLACK_M = 0.5
"""Largest distance in metres of a name outside its room's bounds."""
STANDSTILL_EVENTS = (Held, Paused, LinkLost)
"""Events whose position is marked."""


LowerLayer = Callable[["PictureFrame"], Iterable[str]]


def plan_picture(
    subject: ReportSubject, comparison: Comparison | None, *, beneath: LowerLayer = lambda frame: ()
) -> str:
    """Return the plan, and one of its runs if given; `beneath` draws above the floor, below the stops."""
    mission = subject.mission if comparison is None else comparison.mission
    frame = PictureFrame.of(subject, mission)
    layers = [
        *_floor(subject, frame),
        *_coverage(subject, comparison, frame),
        *_paths(mission, comparison, frame),
        *beneath(frame),
        *_errors(mission, frame),
        *_marks(mission, comparison, frame),
        *_scale_bar(frame),
        *_north(mission, frame),
    ]
    picture = tag(
        "svg", *layers, class_="plan", viewBox=frame.view, role="img", aria_label="plan of the floor",
        style=f"min-width:{LEAST_PX * frame.width / frame.least:.0f}px",
    )  # fmt: skip
    return tag("div", picture, class_="scroll")


@dataclass(frozen=True)
class PictureFrame:
    """Transform from drawing metres to the picture, whose y axis points down."""

    paper: PaperMap
    width: float
    height: float
    mark: float
    """Radius of a stop, metres."""

    @classmethod
    def of(cls, subject: ReportSubject, mission: Mission) -> PictureFrame:
        lines = [] if subject.floor is None else list(subject.floor.outline)
        paths = [np.array(leg, dtype=np.float64).reshape(-1, 2) for leg in legs_of(mission)]
        start = np.array([(mission.start.x, mission.start.y)])
        left, low, right, high = bounds([*lines, *paths, start])
        size = max(right - left, high - low, 1.0)
        margin = 0.02 * size
        paper = PaperMap((left - margin, high + margin), (0.0, 0.0))
        return cls(
            paper, right - left + 2 * margin, high - low + 2 * margin + FOOT * size,
            min(0.013 * size, 0.35 * _spacing(mission)),
        )  # fmt: skip

    @property
    def least(self) -> float:
        """Smallest readable text size, metres; a name that would be smaller is left out."""
        return LEAST_MM / PAPER_MM * max(self.width, self.height)

    @property
    def view(self) -> str:
        return f"0 0 {self.width:.3f} {self.height:.3f}"

    def to_picture(self, x: float, y: float) -> tuple[float, float]:
        x, y = self.paper.on_paper(np.array((x, y))).tolist()
        return x, y

    def path(self, lines: Iterable[FloatArray], *, close: bool = False) -> str:
        """Return the `d` of a path; lines that end at their first point are closed."""
        return "".join(self._line(line, close) for line in lines if len(line) > 1)

    def along(self, targets: Targets, units: BoolArray) -> str:
        """Return the path of the units in a mask (n,)."""
        return self.path(lines_along(targets, units))

    def _line(self, line: FloatArray, close: bool) -> str:
        closed = close and is_closed(line)
        points = self.paper.on_paper(line)
        points = points[:-1] if closed else points
        return "M" + "L".join(f"{x:.3f} {y:.3f}" for x, y in points.tolist()) + ("Z" if closed else "")


def _scale_bar(frame: PictureFrame) -> Iterator[str]:
    """Yield a bar of a round length, below the floor."""
    length = max((m for m in BARS_M if m <= frame.width / 3), default=BARS_M[0])
    size, x, y = frame.least, 0.02 * frame.width, frame.height - 0.01 * frame.width
    yield stroke(f"M{x:.3f} {y - size / 2:.3f}V{y:.3f}H{x + length:.3f}V{y - size / 2:.3f}", INK, 1.5)
    yield tag(
        "text", f"{length:g} m", x=f"{x + length + size / 2:.3f}", y=f"{y:.3f}", font_size=f"{size:.3f}"
    )


def _north(mission: Mission, frame: PictureFrame) -> Iterator[str]:
    """Yield an arrow to true north, if the mission's georeference gives it."""
    if mission.georeference is None:
        return
    bearing = np.radians(mission.georeference.heading_deg)  # of +y, clockwise from north
    size = 2.5 * frame.least
    x, y = frame.width - 2 * size, frame.height - 1.2 * size
    dx, dy = -np.sin(bearing) * size, -np.cos(bearing) * size
    head = f"M{x + dx:.3f} {y + dy:.3f}L{x - dy / 3:.3f} {y + dx / 3:.3f}L{x + dy / 3:.3f} {y - dx / 3:.3f}Z"
    yield tag("path", tag("title", "true north"), d=head, fill=INK)
    yield tag("text", "N", x=f"{x + size / 2:.3f}", y=f"{y + size / 2:.3f}", font_size=f"{size:.3f}")


def _spacing(mission: Mission) -> float:
    """Return the usual distance of stops: the median distance from each to the nearest other."""
    xy = np.array([(stop.x, stop.y) for stop in mission.stops]).reshape(-1, 2)
    if len(xy) < 2:
        return 10.0
    apart = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    return float(max(np.median(apart.min(axis=1)), 0.5))


def stroke(d: str, colour: str, width: float, **style: Any) -> str:
    """Return a path as a line with a fixed width in points; an empty string for no path."""
    if not d:
        return ""
    look = {"fill": "none", "stroke": colour, "stroke_width": width, "vector_effect": "non-scaling-stroke"}
    return tag("path", d=d, **{**look, **style})


def _floor(subject: ReportSubject, frame: PictureFrame) -> Iterator[str]:
    floor = subject.floor
    if floor is None:
        return
    yield stroke(frame.path(floor.outline, close=True), GREY, 1)
    for kind, lines in floor.kinds.items():
        look = kind_of(kind)
        areas = frame.path((line for line in lines if is_closed(line)), close=True)
        yield stroke(areas, look.colour, 0.6, fill=look.fill, fill_rule="evenodd")
        yield stroke(frame.path(line for line in lines if not is_closed(line)), look.colour, 0.6)
    for name, x, y in floor.names:
        px, py = frame.to_picture(x, y)
        fitting = _room_width(floor.rooms, x, y) / max(text_width(name, 1.0), 1.0)
        size = min(frame.least, fitting)
        if size < frame.least:
            continue
        at = {"x": f"{px:.3f}", "y": f"{py + 1.6 * size:.3f}", "font_size": f"{size:.3f}"}
        yield tag("text", shown(name), fill="#5a5e66", text_anchor="middle", **at)


def _room_width(rooms: Sequence[FloatArray], x: float, y: float) -> float:
    """Return the width of the smallest room around a point; infinity if there is none."""
    boxes = [(*ring.min(axis=0).tolist(), *ring.max(axis=0).tolist()) for ring in rooms if len(ring)]
    about = [
        box for box in boxes if box[0] <= x <= box[2] and box[1] - SLACK_M <= y <= box[3] + SLACK_M
    ]  # fmt: skip
    return min((box[2] - box[0] for box in about), default=np.inf)


def _coverage(subject: ReportSubject, comparison: Comparison | None, frame: PictureFrame) -> Iterator[str]:
    """Draw unplanned targets dashed, covered ones, and thick those planned but not covered."""
    acquired = None if comparison is None else comparison.acquired
    sight = subject.sight if acquired is None else acquired.sight
    if sight is None:
        return
    planned = sight.all_seen if acquired is None else acquired.planned_seen
    seen = planned if acquired is None else acquired.seen

    targets = sight.targets
    yield stroke(frame.along(targets, ~planned & ~seen), GREY, 1.2, stroke_dasharray="4 3")
    yield stroke(frame.along(targets, planned & ~seen), VERMILION, 5)
    yield stroke(frame.along(targets, seen), BLUE, 2.4)


def _paths(mission: Mission, comparison: Comparison | None, frame: PictureFrame) -> Iterator[str]:
    legs = [np.array(leg, dtype=np.float64).reshape(-1, 2) for leg in legs_of(mission)]
    yield stroke(frame.path(legs), "#444", 1.1, stroke_dasharray="6 4")
    if comparison is not None and len(comparison.log.poses):
        least = max(frame.width, frame.height) / 1500
        driven = [_thinned(path, least) for path in comparison.log.poses.paths]
        yield stroke(frame.path(driven), PURPLE, 2, stroke_linejoin="round", stroke_opacity=0.9)
        yield from _gaps(comparison, frame)


def _gaps(comparison: Comparison, frame: PictureFrame) -> Iterator[str]:
    """Draw gaps in the poses dashed between their ends, the longest with their duration."""
    named = {gap for gap in comparison.sighted.longest if gap.metres > 2 * frame.mark}
    for gap in comparison.sighted.gaps:
        if gap.begin is None or gap.end is None:
            continue
        line = frame.path([np.array([gap.begin, gap.end])])
        yield tag("g", tag("title", shown(gap.words)), stroke(line, PURPLE, 1.8, stroke_dasharray="3 4"))
        if gap in named:
            x, y = np.mean([frame.to_picture(*gap.begin), frame.to_picture(*gap.end)], axis=0).tolist()
            label = f"{duration(gap.seconds)}, {gap.metres:.1f} m unseen"
            size = {
                "font_size": f"{max(1.1 * frame.mark, frame.least):.3f}",
                "text_anchor": "middle",
                "fill": "#6b2a55",
            }
            halo = {"stroke": "#fff", "stroke_width": f"{0.25 * frame.mark:.3f}", "paint_order": "stroke"}
            yield tag("text", shown(label), x=f"{x:.3f}", y=f"{y:.3f}", **size, **halo)


def _thinned(xy: FloatArray, least: float) -> FloatArray:
    """Return points of a line (n, 2) that are at least `least` metres of driving apart."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    indices = np.unique(np.concatenate([[0], np.flatnonzero(np.diff(along // least) > 0) + 1, [len(xy) - 1]]))
    return xy[indices]


def _marks(mission: Mission, comparison: Comparison | None, frame: PictureFrame) -> Iterator[str]:
    missing = {} if comparison is None else {item.stop: item for item in comparison.missing}
    named = len(mission.stops) <= MOST_LABELS
    over = comparison is not None and comparison.log.ended
    for stop in mission.stops:
        if stop.id not in missing:
            yield _stop(stop, stop.id.lstrip("sS") if named else "", frame)
    if comparison is not None:
        yield from _standstills(comparison, frame)
    for stop in mission.stops:
        item = missing.get(stop.id)
        if item is not None:
            yield _cross(
                stop,
                f"{item.stop} {item.outcome}",
                frame,
                over=over,
            )


def _errors(mission: Mission, frame: PictureFrame) -> Iterator[str]:
    """Yield the predicted error of each scan as an ellipse, magnified."""
    found = errors_in_picture(mission)
    if found is None:
        return
    for stop, line in found.outlines.items():
        ellipse = stroke(frame.path([line], close=True), ERROR, 1.4)
        yield tag("g", tag("title", shown(found.words[stop])), ellipse)


def errors_in_picture(mission: Mission) -> MagnifiedErrors | None:
    """Return the error ellipses as the picture draws them."""
    return magnified_errors(mission, most_m=0.6 * _spacing(mission))


OUTLINE: dict[str, Any] = {"stroke": INK, "stroke_width": 1.5, "vector_effect": "non-scaling-stroke"}


def _stop(stop: Stop, label: str, frame: PictureFrame) -> str:
    x, y = frame.to_picture(stop.x, stop.y)
    at = {"cx": f"{x:.3f}", "cy": f"{y:.3f}", "r": f"{frame.mark:.3f}", "fill": "#fff"}
    circle = tag("circle", tag("title", shown(stop.id)), **at, **OUTLINE)
    return circle + (_letter(x, y, label, frame) if label else "")


def _cross(stop: Stop, label: str, frame: PictureFrame, *, over: bool) -> str:
    """Draw a stop that was not scanned: a square with a cross, hollow while the run may still reach it."""
    x, y = frame.to_picture(stop.x, stop.y)
    r = frame.mark * 1.1
    k = 0.6 * r
    at = {"x": f"{x - r:.3f}", "y": f"{y - r:.3f}", "width": f"{2 * r:.3f}", "height": f"{2 * r:.3f}"}
    square = tag("rect", tag("title", shown(label)), fill=VERMILION if over else "#fff", **at, **OUTLINE)
    strokes = (f"M{x - k:.3f} {y + side * k:.3f}L{x + k:.3f} {y - side * k:.3f}" for side in (1, -1))
    label_position = {
        "x": f"{x + 1.5 * r:.3f}",
        "y": f"{y + 0.4 * r:.3f}",
        "font_size": f"{max(1.3 * r, frame.least):.3f}",
    }
    halo = {"stroke": "#fff", "stroke_width": f"{0.25 * r:.3f}", "paint_order": "stroke"}
    text = tag("text", shown(label), font_weight="bold", fill="#8a3000", **label_position, **halo)
    return square + stroke("".join(strokes), "#fff" if over else INK, 2) + text


def _letter(x: float, y: float, content: str, frame: PictureFrame) -> str:
    size = max(frame.mark * (1.15 if len(content) < 3 else 0.85), frame.least)
    if text_width(content, size) > 2.6 * frame.mark:  # stops are too close together for readable numbers
        return ""
    return tag("text", shown(content), x=f"{x:.3f}", y=f"{y + 0.36 * size:.3f}", font_size=f"{size:.3f}",
               font_weight="bold", text_anchor="middle")  # fmt: skip


def _standstills(comparison: Comparison, frame: PictureFrame) -> Iterator[str]:
    """Draw a diamond where the run was paused or held, or lost its link."""
    poses = comparison.log.poses
    for event in comparison.log.events:
        index = poses.last_until(event.robot_ns) if isinstance(event, STANDSTILL_EVENTS) else None
        if index is not None:
            x, y = frame.to_picture(*poses.xy[index].tolist())
            r = frame.mark
            d = f"M{x:.3f} {y - r:.3f}L{x + r:.3f} {y:.3f}L{x:.3f} {y + r:.3f}L{x - r:.3f} {y:.3f}Z"
            why = f"{type(event).__name__}: {getattr(event, 'reason', '')}"
            yield tag(
                "g", tag("title", shown(why)), stroke(d, INK, 1.2, fill=YELLOW), _letter(x, y, "!", frame)
            )


def legend(items: Sequence[tuple[str, str]]) -> str:
    """Return what lines and marks mean: (SVG of 26 × 12, words)."""
    return tag("div", *(_sample(mark) + shown(words) for mark, words in items), class_="legend")


def _sample(mark: str) -> str:
    return tag("svg", mark, width=26, height=12, viewBox="0 0 26 12")


def line_sample(colour: str, width: float, dash: str = "") -> str:
    style = {"stroke_dasharray": dash} if dash else {}
    return stroke("M0 6L26 6", colour, width, **style)
