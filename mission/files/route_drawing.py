"""The route and its numbered stops: the upper layers of plan.svg."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from stopgo.mission.document import Mission, Point, Stop
from stopgo.mission.files.sheet import PaperSheet
from stopgo.mission.files.svg import (
    SMALLEST_TEXT,
    circle,
    group,
    line,
    line_data,
    path,
    polygon,
    rect,
    ring_data,
    text,
    text_width,
)
from stopgo.mission.geometry import FloatArray
from stopgo.mission.stages.network import error_factor, magnified_errors, network_of

WAY: dict[str, object] = {"stroke": "#5a2ca0", "stroke_width": 0.35}
"""Line of the leg to each stop."""
BACK: dict[str, object] = {"stroke": "#5a2ca0", "stroke_width": 0.3, "stroke_dasharray": "2 1"}
PAIR: dict[str, object] = {"stroke": "#1f8a70", "stroke_width": 0.25, "stroke_dasharray": "0.6 0.9"}
"""Two stops whose scans register with one another."""
BRIDGE: dict[str, object] = {"stroke": "#c2410c", "stroke_width": 0.5, "stroke_dasharray": "0.6 0.9"}
"""Line of a pair without which the scans are not connected."""
ERROR: dict[str, object] = {"stroke": "#0b6e99", "stroke_width": 0.3, "fill": "none"}
"""Outline of a scan's predicted error."""
LARGEST_ERROR = 14.0
"""Millimetres of the largest half axis of a drawn error ellipse."""
THIN: dict[str, object] = {"stroke": "#c2410c", "stroke_width": 0.2}
STOP = 2.6
"""Radius in millimetres of a stop's disc."""
INK = "#2a0f5c"
_ARROW_EVERY = 45.0
"""Millimetres between direction arrows on a long leg."""
_ARROW_LEAST = 8.0
"""Shorter legs have no room for an arrow between their stops."""


def rings(mission: Mission, sheet: PaperSheet) -> str:
    """Draw the scanner's range at each stop, faintly."""
    reach = sheet.length(mission.scanner.range)
    circles = [circle(x, y, reach) for x, y in _stops_on_paper(mission, sheet).tolist()]
    return group("range", circles, fill="none", stroke="#b9a6dd", stroke_width=0.12, stroke_dasharray="1 1.5")


def route(
    mission: Mission,
    sheet: PaperSheet,
    *,
    way: dict[str, object] = WAY,
    back_way: dict[str, object] = BACK,
    after: str = "",
) -> Iterator[str]:
    """Draw legs with direction arrows; the return leg dashed. `after` is appended to the layers' names."""
    legs = [_on_paper(stop.approach, sheet) for stop in mission.stops]
    back = _on_paper(mission.return_ or (), sheet)
    join: dict[str, object] = {"fill": "none", "stroke_linejoin": "round"}
    yield group(f"return{after}", [path([line_data(back)] if len(back) > 1 else [])], **join, **back_way)
    yield group(f"route{after}", [path(line_data(leg) for leg in legs if len(leg) > 1)], **join, **way)
    arrows = [polygon(head) for leg in (*legs, back) for head in _arrows(leg)]
    yield group(f"directions{after}", arrows, fill=way["stroke"])


def network(mission: Mission, sheet: PaperSheet) -> Iterator[str]:
    """Draw the pairs of stops whose scans register: bridges stronger, the weakest pair with its error."""
    found = network_of(mission)
    if found is None:
        return
    at = dict(zip(found.stops, _stops_on_paper(mission, sheet).tolist(), strict=True))
    bridges = set(found.bridges)
    plain = [line(*at[item.a], *at[item.b]) for item in found.overlaps if item not in bridges]
    yield group("pairs", plain, **PAIR)
    yield group("bridges", [line(*at[item.a], *at[item.b]) for item in found.bridges], **BRIDGE)
    if (weakest := found.weakest) is not None:
        x, y = np.mean([at[weakest.a], at[weakest.b]], axis=0).tolist()
        error = found.error_in_words(weakest)
        held = text(x, y + 0.9, error, size=SMALLEST_TEXT, fill=BRIDGE["stroke"], text_anchor="middle")
        wide = text_width(error, SMALLEST_TEXT) + 1.0
        yield group("weakest", [rect(x - wide / 2, y - 1.6, wide, 3.2, fill="#ffffff", **THIN), held])


def error_factor_on(sheet: PaperSheet, mission: Mission) -> float | None:
    """Return by how much predicted errors are magnified on this sheet; None if there are none."""
    return error_factor(mission, most_m=LARGEST_ERROR / sheet.length(1.0))


def errors(mission: Mission, sheet: PaperSheet) -> str:
    """Draw the predicted error of each scan as an ellipse."""
    found = magnified_errors(mission, most_m=LARGEST_ERROR / sheet.length(1.0))
    outlines = [] if found is None else [sheet.on_paper(line) for line in found.outlines.values()]
    return group("errors", [path([ring_data(line)]) for line in outlines], **ERROR)


def stops(mission: Mission, sheet: PaperSheet, *, letter: str = "") -> Iterator[str]:
    """The start, then each stop's disc with its number, behind a letter, and a tick where it faces."""
    yield start_mark(sheet.on_paper(np.array([mission.start.x, mission.start.y])))
    places = _stops_on_paper(mission, sheet)
    marks = [
        stop_mark(place, f"{letter}{number}", heading=stop.heading, doorway=stop.doorway)
        for number, (stop, place) in enumerate(zip(mission.stops, places, strict=True), 1)
    ]
    yield group(f"stops{letter and f'-{letter}'}", marks, font_weight="bold", text_anchor="middle", fill=INK)


def start_mark(at: FloatArray) -> str:
    """A black disc, larger than a stop's: it shows as a thick ring where the route starts at a stop."""
    x, y = at.tolist()
    letter = text(x, y + 0.95, "S", size=2.6, fill="#ffffff", text_anchor="middle", font_weight="bold")
    return group("start", [circle(x, y, STOP + 0.8, fill="#111111"), letter])


def stop_mark(at: FloatArray, number: str, *, heading: float, doorway: bool) -> str:
    """A disc with a number; a doorway stop has a second ring."""
    x, y = at.tolist()
    look: dict[str, object] = {"fill": "#ffffff", "stroke": INK, "stroke_width": 0.3}
    tick = np.array([math.cos(heading), -math.sin(heading)])
    (x1, y1), (x2, y2) = (at + STOP * tick).tolist(), (at + (STOP + 1.3) * tick).tolist()
    return "".join((
        line(x1, y1, x2, y2, stroke=INK, stroke_width=0.6),
        circle(x, y, STOP + 0.55, fill="#ffffff", stroke=INK, stroke_width=0.2) if doorway else "",
        circle(x, y, STOP, **look),
        text(x, y + 0.9, number, size=2.5),
    ))  # fmt: skip


def _stops_on_paper(mission: Mission, sheet: PaperSheet) -> FloatArray:
    return sheet.on_paper(_xy(mission.stops))


def _xy(stops: Sequence[Stop]) -> FloatArray:
    return np.array([[stop.x, stop.y] for stop in stops], dtype=np.float64).reshape(-1, 2)


def _on_paper(leg: Sequence[Point], sheet: PaperSheet) -> FloatArray:
    return sheet.on_paper(np.array(leg, dtype=np.float64).reshape(-1, 2))


def _arrows(leg: FloatArray) -> Iterator[FloatArray]:
    """Arrowheads at even distances along a leg, at least one where there is room."""
    steps = np.diff(leg, axis=0)
    lengths = np.hypot(*steps.T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    if len(lengths) == 0 or along[-1] < _ARROW_LEAST:
        return
    count = max(1, int(along[-1] // _ARROW_EVERY))
    for distance in (np.arange(count) + 0.5) * along[-1] / count:
        piece = int(np.searchsorted(along, distance, side="right")) - 1
        ahead = steps[piece] / lengths[piece]
        yield arrowhead(leg[piece] + (distance - along[piece]) * ahead, ahead)


def arrowhead(at: FloatArray, ahead: FloatArray) -> FloatArray:
    """Corners of an arrowhead about `at`, pointing along the unit vector `ahead`."""
    side = np.array([-ahead[1], ahead[0]])
    return np.stack([at + 1.1 * ahead, at - 1.0 * ahead + 0.8 * side, at - 1.0 * ahead - 0.8 * side])
