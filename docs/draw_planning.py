"""Draws the pictures of planning.md from the sample office, one per stage.

    python -m docs.draw_planning [docs/images]

The same bytes come out every time, as long as the plan is the same.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from stopgo.mission.document import Stop
from stopgo.mission.files.floor_drawing import kinds_of, look_of
from stopgo.mission.files.svg import (
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
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, Polygon
from stopgo.mission.plan import PartPlan
from stopgo.mission.settings import Settings
from stopgo.mission.stages import (
    AT_EDGE,
    IN_HOLE,
    KEPT,
    OUTSIDE,
    SLIVER,
    TOO_CLOSE,
    TOO_SMALL,
    NavigableSpace,
    Visibility,
)
from stopgo.mission.stages.covered_intervals import runs_of, seen_units
from stopgo.planner import plan
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.visibility.bresenham import bresenham

OFFICE = Path("recordings/samples/office.dxf")
VIEW = (15.8, 6.5)
"""The candidate nearest this place shows what one candidate sees."""
ROW = 24.0
"""Height of a row of the legend."""
INK, WAY, SEEN, MISSED, HIDDEN = "#2a0f5c", "#5a2ca0", "#1a8f3c", "#d7191c", "#ee9a7b"
DRIVE, STAND, LIGHT = "#cfe3f7", "#8fbfe8", "#ffe9a8"
Mark = tuple[str, str]
"""A sign of the legend, drawn about 0, 0, and what it means."""


@dataclass(frozen=True)
class Window:
    """A piece of the floor, in metres, and how large it is drawn."""

    low: tuple[float, float] = (-0.4, -0.4)
    high: tuple[float, float] = (26.4, 13.4)
    scale: float = 30.0
    """Dots per metre."""

    @property
    def size(self) -> tuple[float, float]:
        width, height = (np.subtract(self.high, self.low) * self.scale).tolist()
        return width, height

    def __call__(self, xy: Any) -> FloatArray:
        """Places (n, 2) on the picture, y down."""
        points = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        return (points - [self.low[0], self.high[1]]) * [self.scale, -self.scale]

    def at(self, xy: Any) -> tuple[float, float]:
        """One place on the picture."""
        x, y = self(xy)[0].tolist()
        return x, y

    def region(self, polygons: Iterable[Polygon]) -> Iterator[str]:
        """Path data of polygons."""
        return (ring_data(self(ring)) for part in polygons for ring in part.rings)


def office(**changes: Any) -> PartPlan:
    """The sample office, planned."""
    settings = Settings(**changes)
    return plan(read_floor(OFFICE, FloorOptions(d_dis=settings.d_dis)), settings).first


def picture(window: Window, layers: Iterable[str], legend: Iterable[Mark]) -> str:
    """A whole SVG: the layers clipped to the window, the legend below it."""
    width, height = window.size
    signs, bottom = _legend(legend, width=width, top=height + 8)
    return "\n".join((
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {bottom:g}"'
        ' font-family="Helvetica, Arial, \'Liberation Sans\', sans-serif">',
        rect(0.0, 0.0, width, bottom, fill="#ffffff"),
        f'<clipPath id="window">{rect(0.0, 0.0, width, height)}</clipPath>',
        group("floor", layers, clip_path="url(#window)", stroke_linejoin="round"),
        group("legend", signs),
        "</svg>\n",
    ))  # fmt: skip


def _legend(marks: Iterable[Mark], *, width: float, top: float) -> tuple[list[str], float]:
    drawn, x, y = [], 12.0, top + ROW / 2
    for sign, words in marks:
        wide = 38.0 + text_width(words, 13.0)
        if x + wide > width:
            x, y = 12.0, y + ROW
        drawn.append(f'<g transform="translate({x + 8:.1f} {y:.1f})">{sign}</g>')
        drawn.append(text(x + 24, y + 4.5, words, size=13.0, fill="#222222"))
        x += wide
    return drawn, y + ROW / 2 + 4


def swatch(**style: object) -> str:
    return rect(-9.0, -6.0, 18.0, 12.0, **style)


def stroke(**style: object) -> str:
    return line(-10.0, 0.0, 10.0, 0.0, **style)


def building(floor: FloorPlan, window: Window, *, faint: bool = False) -> Iterator[str]:
    """Floor, rooms and elements."""
    even: dict[str, Any] = {"fill_rule": "evenodd"}
    yield path(window.region(floor.outline), fill="#f1f1ee", stroke="#555555", **even)
    yield path(
        window.region(p for room in floor.rooms for p in room.polygons), fill="#ffffff", stroke="#c8c8c8"
    )
    yield from elements_of(floor, window, faint=faint)


def elements_of(floor: FloorPlan, window: Window, *, faint: bool = False) -> Iterator[str]:
    """The elements by kind; `faint` leaves out what is overhead."""
    for kind in kinds_of(floor):
        if faint and kind == "beams":
            continue
        elements = [item for item in floor.elements if item.kind == kind]
        dash = {"stroke_dasharray": "7 4"} if kind == "beams" else {}
        look = {**look_of(kind), "stroke_width": 1, **dash}
        yield path(window.region(p for item in elements for p in item.solids), **look, fill_rule="evenodd")
        lines = (line_data(window(drawn)) for item in elements for drawn in item.lines)
        yield path(lines, **{**look, "fill": "none"})


def openings(space: NavigableSpace, window: Window) -> Iterator[str]:
    """Lines across openings: passable ones, and those that are closed to the robot."""
    for state in space.openings:
        colour = "#0b63b0" if state.passable else "#e07b00"
        dash = {"stroke_dasharray": "6 4"} if state.opening.kind == "passage" else {}
        data = [line_data(window(state.opening.line))]
        yield path(data, stroke=colour, stroke_width=3, fill="none", **dash)


def units(visibility: Visibility, mask: BoolArray, window: Window, **style: object) -> str:
    """The units of a mask as strokes along their segments."""
    targets = visibility.targets
    runs = runs_of(targets, mask)
    a, b = targets.a[runs.segment], targets.b[runs.segment]
    begin, end = a + runs.t0[:, None] * (b - a), a + runs.t1[:, None] * (b - a)
    pairs = zip(begin, end, strict=True)
    return path((line_data(window(np.stack(pair))) for pair in pairs), fill="none", **style)


def draw_floor(drawn: PartPlan) -> str:
    """Draw the elements that are read."""
    window = Window()
    names = []
    halo: dict[str, Any] = {"stroke": "#ffffff", "stroke_width": 4, "paint_order": "stroke"}
    for room in drawn.floor.rooms:
        ring = room.polygons[0].exterior
        x, y = window.at((ring.min(axis=0) + ring.max(axis=0)) / 2)
        names.append(text(x, y + 5, room.label, size=13, fill="#333333", text_anchor="middle", **halo))
    signs = {kind: {**look_of(kind), "stroke_width": 1} for kind in kinds_of(drawn.floor)}
    legend = [
        *((swatch(**look), kind) for kind, look in signs.items()),
        (stroke(stroke="#0b63b0", stroke_width=3), "door"),
        (stroke(stroke="#0b63b0", stroke_width=3, stroke_dasharray="6 4"), "passage"),
        (swatch(fill="#f1f1ee", stroke="#555555"), "floor outside rooms"),
    ]
    doors = [replace(state, passable=True) for state in drawn.space.openings]
    lines = openings(replace(drawn.space, openings=tuple(doors)), window)
    return picture(window, [*building(drawn.floor, window), *lines, *names], legend)


def draw_navigable(drawn: PartPlan) -> str:
    """Draw the space of the robot's centre, for driving and for stops."""
    window, space = Window(), drawn.space
    even: dict[str, Any] = {"fill_rule": "evenodd"}
    stand = (part for room in space.rooms for part in room.stop_area)
    layers = [
        *building(drawn.floor, window, faint=True),
        path(window.region(space.drive_area), fill=DRIVE, stroke="#5d93c4", stroke_width=0.8, **even),
        path(window.region(stand), fill=STAND, stroke="#2f6ea8", stroke_width=0.8, **even),
        *openings(space, window),
    ]
    legend = [
        (swatch(fill=DRIVE, stroke="#5d93c4"), "the robot's centre may drive here"),
        (swatch(fill=STAND, stroke="#2f6ea8"), "a stop may be here (d_sec)"),
        (stroke(stroke="#0b63b0", stroke_width=3), "opening driven through"),
        (stroke(stroke="#e07b00", stroke_width=3), "exterior door: not driven through"),
    ]
    return picture(window, layers, legend)


def draw_candidates(drawn: PartPlan) -> str:
    """Usable candidates, and why the others are not."""
    window, found = Window(), drawn.candidates
    looks = {
        KEPT: (SEEN, "usable"),
        TOO_CLOSE: (MISSED, "closer than d_sec to an element"),
        AT_EDGE: ("#e07b00", "too near a floor edge"),
        IN_HOLE: ("#111111", "in a hole"),
        OUTSIDE: ("#999999", "outside the room"),
        TOO_SMALL: ("#a8a8a8", "triangle below l_min"),
        SLIVER: ("#4e79a7", "sliver triangle"),
    }
    layers = [*building(drawn.floor, window, faint=True)]
    legend: list[Mark] = []
    inside = np.all((found.xy > window.low) & (found.xy < window.high), axis=1)
    for reason in (OUTSIDE, TOO_SMALL, SLIVER, IN_HOLE, AT_EDGE, TOO_CLOSE, KEPT):
        places = found.xy[(found.reason == reason) & inside]
        colour, words = looks[reason]
        mark = _dots if reason == KEPT else _crosses
        layers.append(mark(window(places), colour))
        if len(places):
            legend.insert(0, (mark(np.zeros((1, 2)), colour), words))
    return picture(window, layers, legend)


def _dots(places: FloatArray, colour: str) -> str:
    """One path of dots: a line without length has a round end."""
    data = (f"{line_data(place[None])}h0" for place in places)
    return path(data, stroke=colour, stroke_width=6.4, stroke_linecap="round")


def _crosses(places: FloatArray, colour: str) -> str:
    arms = (place + np.array(arm) for place in places for arm in CROSS)
    return path(map(line_data, arms), stroke=colour, stroke_width=1.1, fill="none")


CROSS = (((-2.2, -2.2), (2.2, 2.2)), ((-2.2, 2.2), (2.2, -2.2)))


def row_at(visibility: Visibility, place: tuple[float, float]) -> int:
    """The candidate's row nearest a place."""
    xy = visibility.candidates.xy[visibility.candidates.kept]
    return int(np.argmin(np.hypot(*(xy - place).T)))


def _mask(drawn: PartPlan, seen: IntArray) -> BoolArray:
    mask = np.zeros(drawn.visibility.targets.total, dtype=bool)
    mask[seen] = True
    return mask


def draw_visibility(drawn: PartPlan) -> str:
    """Draw the visibility of one candidate: wedges of light onto faces, and beams overhead."""
    window, seen = Window(), drawn.visibility
    targets, row = seen.targets, row_at(seen, VIEW)
    eye = seen.candidates.xy[seen.candidates.kept[row]]
    mask = _mask(drawn, seen.seen_by(row))
    runs = runs_of(targets, mask)
    face = targets.occluding[runs.segment]
    a, b = targets.a[runs.segment], targets.b[runs.segment]
    ends = np.stack([a + runs.t0[:, None] * (b - a), a + runs.t1[:, None] * (b - a)], axis=1)[face]
    wedges = (ring_data(window([eye, *pair])) for pair in ends)
    reach = drawn.space.settings.range * window.scale
    ring: dict[str, Any] = {"fill": "none", "stroke": WAY, "stroke_dasharray": "4 5"}
    layers = [
        *building(drawn.floor, window, faint=True),
        path(wedges, fill=LIGHT),
        circle(*window.at(eye), reach, **ring),
        units(seen, mask, window, stroke=SEEN, stroke_width=3),
        circle(*window.at(eye), 5.0, fill=INK),
    ]
    legend = [
        (circle(0.0, 0.0, 5.0, fill=INK), "a candidate"),
        (swatch(fill=LIGHT), "sight lines onto faces it sees"),
        (stroke(stroke=SEEN, stroke_width=3), "units it sees (beams too)"),
        (circle(0.0, 0.0, 8.0, **ring), "range"),
    ]
    return picture(window, layers, legend)


def draw_raster(drawn: PartPlan) -> str:
    """The same candidate over the paper's raster: what the raster hides."""
    window, seen = Window((10.2, 0.9), (21.4, 8.6), 70.0), drawn.visibility
    row = row_at(seen, VIEW)
    eye = seen.candidates.xy[seen.candidates.kept[row]]
    exact = _mask(drawn, seen.seen_by(row))
    raster = _mask(drawn, bresenham(drawn.candidates).seen_by(row))
    ring: dict[str, Any] = {"fill": "none", "stroke": WAY, "stroke_dasharray": "4 5"}
    looks = (
        (exact & raster, SEEN, "both see"),
        (exact & ~raster, MISSED, "only exact sees"),
        (raster & ~exact, "#0b63b0", "only the raster sees"),
    )
    layers = [
        *building(drawn.floor, window, faint=True),
        circle(*window.at(eye), drawn.space.settings.range * window.scale, **ring),
        *(units(seen, mask, window, stroke=colour, stroke_width=5) for mask, colour, _ in looks),
        circle(*window.at(eye), 6.0, fill=INK),
    ]
    legend: list[Mark] = [(circle(0.0, 0.0, 6.0, fill=INK), "the same candidate")]
    legend += [(stroke(stroke=colour, stroke_width=5), words) for mask, colour, words in looks if mask.any()]
    return picture(window, layers, legend)


def draw_selection(drawn: PartPlan) -> str:
    """The chosen stops in the order of choice, and what they leave unseen."""
    window, chosen = Window(), drawn.selection
    seen, visible = seen_units(chosen), drawn.visibility.visible
    looks = (
        (~visible, HIDDEN, "out of every candidate's sight"),
        (seen, SEEN, "seen from a stop"),
        (visible & ~seen, MISSED, "visible, left unseen"),
    )
    others = drawn.candidates.xy[drawn.candidates.kept]
    layers = [
        *building(drawn.floor, window, faint=True),
        _dots(window(others), "#cccccc"),
        *(units(drawn.visibility, mask, window, stroke=colour, stroke_width=3) for mask, colour, _ in looks),
        *(disc(*window.at(place), str(k)) for k, place in enumerate(chosen.xy, 1)),
    ]
    legend = [
        (disc(0.0, 0.0, "1"), "stop, numbered as chosen"),
        (_dots(np.zeros((1, 2)), "#cccccc"), "candidate"),
        *((stroke(stroke=colour, stroke_width=3), words) for _, colour, words in looks),
    ]
    return picture(window, layers, legend)


def disc(x: float, y: float, words: str) -> str:
    shown = text(x, y + 4.2, words, size=12, text_anchor="middle", font_weight="bold", fill=INK)
    return circle(x, y, 10.0, fill="#ffffff", stroke=INK, stroke_width=1.5) + shown


def draw_route(drawn: PartPlan) -> str:
    """The route over the stops, in the area the robot's centre may drive in."""
    window, driven = Window(), drawn.route
    legs = (line_data(window(leg)) for leg in driven.approaches if len(leg) > 1)
    x, y = window.at(driven.start[:2])
    layers = [
        *building(drawn.floor, window, faint=True),
        path(window.region(drawn.space.drive_area), fill=DRIVE, fill_rule="evenodd"),
        *openings(drawn.space, window),
        path(legs, fill="none", stroke=WAY, stroke_width=2.5),
        circle(x, y, 14.0, fill="#111111"),
        *(disc(*window.at(place), str(k)) for k, place in enumerate(driven.xy, 1)),
    ]
    legend = [
        (circle(0.0, 0.0, 9.0, fill="#111111") + circle(0.0, 0.0, 6.0, fill="#ffffff"), "start"),
        (disc(0.0, 0.0, "2"), "stop, in the order of driving"),
        (stroke(stroke=WAY, stroke_width=2.5), "route"),
        (swatch(fill=DRIVE), "where the robot's centre may drive"),
    ]
    return picture(window, layers, legend)


def draw_mission(drawn: PartPlan) -> str:
    """One stop as the robot gets it: approach, heading, and what is kept clear."""
    stop = max(drawn.mission.stops, key=lambda item: len(item.approach))
    x, y = stop.x, stop.y
    window = Window((x - 4.6, y - 3.6), (x + 4.6, y + 3.6), 75.0)
    settings = drawn.space.settings
    clear: dict[str, Any] = {"fill": "none", "stroke": MISSED, "stroke_dasharray": "6 4", "stroke_width": 1.5}
    body: dict[str, Any] = {"fill": "#b9a6dd", "fill_opacity": 0.6, "stroke": INK}
    way = [line_data(window(stop.approach))]
    corners = [circle(*window.at(point), 4.0, fill=WAY) for point in stop.approach]
    layers = [
        *building(drawn.floor, window, faint=True),
        *openings(drawn.space, window),
        path(
            way,
            fill="none",
            stroke="#e2d9f3",
            stroke_width=2 * settings.radius * window.scale,
            stroke_linecap="round",
        ),
        path(way, fill="none", stroke=WAY, stroke_width=3),
        *corners,
        circle(*window.at((x, y)), settings.d_sec * window.scale, **clear),
        circle(*window.at((x, y)), settings.radius * window.scale, **body),
        _heading(stop, window),
        circle(*window.at((x, y)), 5.0, fill=INK),
        text(window.at((x, y))[0] + 8, window.at((x, y))[1] + 17, stop.id, size=14, fill=INK),
    ]
    legend = [
        (stroke(stroke=WAY, stroke_width=3), "approach, bends as dots"),
        (swatch(fill="#e2d9f3"), "what the robot sweeps"),
        (circle(0.0, 0.0, 8.0, **body), "robot"),
        (circle(0.0, 0.0, 8.0, **clear), "d_sec"),
        (stroke(stroke=INK, stroke_width=4), "heading"),
    ]
    return picture(window, layers, legend)


def _heading(stop: Stop, window: Window, *, long: float = 0.75) -> str:
    ahead = np.array([math.cos(stop.heading), math.sin(stop.heading)])
    at = np.array([stop.x, stop.y])
    side = np.array([-ahead[1], ahead[0]])
    tip, back = at + long * ahead, at + (long - 0.2) * ahead
    head = polygon(window([tip, back + 0.1 * side, back - 0.1 * side]), fill=INK)
    return path([line_data(window([at, back]))], stroke=INK, stroke_width=4) + head


def draw_headings(drawn: PartPlan) -> str:
    """Stops of a scanner that does not look all round: each has a heading."""
    window, settings = Window(), drawn.space.settings
    half, reach = math.radians(settings.fov) / 2, settings.range
    layers = [*building(drawn.floor, window, faint=True)]
    for stop in drawn.mission.stops:
        turn = stop.heading + np.linspace(-half, half, 25)
        at = np.array([stop.x, stop.y])
        arc = at + reach * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        layers.append(
            polygon(window([at, *arc]), fill=LIGHT, fill_opacity=0.3, stroke="#d9b64c", stroke_width=0.6)
        )
    mask = seen_units(drawn.selection)
    layers += elements_of(drawn.floor, window, faint=True)
    layers.append(units(drawn.visibility, mask, window, stroke=SEEN, stroke_width=3))
    for stop in drawn.mission.stops:
        layers += [_heading(stop, window), circle(*window.at((stop.x, stop.y)), 4.5, fill=INK)]
    legend = [
        (circle(0.0, 0.0, 4.5, fill=INK), "stop; several may stand in one place"),
        (stroke(stroke=INK, stroke_width=4), "heading of the scan"),
        (swatch(fill=LIGHT, stroke="#d9b64c"), f"field of view, {settings.fov:g}°"),
        (stroke(stroke=SEEN, stroke_width=3), "seen"),
    ]
    return picture(window, layers, legend)


def draw_vertex(_: PartPlan) -> str:
    """The rule for sight lines through a vertex, as four sketches."""
    window = Window((0.0, 0.3), (15.6, 4.0), 52.0)
    cases: tuple[Any, ...] = (
        ("past a corner: seen", [[(1.4, 2), (2.2, 2), (2.2, 1.2), (1.4, 1.2)]], (0.4, 2), (3.5, 2), True),
        ("corners touch: not seen", [[(1, 2), (2, 2), (2, 1), (1, 1)], [(2, 2), (3, 2), (3, 3), (2, 3)]],
         (1.2, 2.8), (2.8, 1.2), False),
        ("face edge-on: not seen", [[(1.6, 2), (3.4, 2), (3.4, 1.2), (1.6, 1.2)]], (0.4, 2), (2.6, 2), False),
        ("wider than 0.2 mm: seen",
         [[(1, 2), (1.97, 2), (1.97, 1), (1, 1)], [(2.03, 2.06), (3, 2.06), (3, 3), (2.03, 3)]],
         (1.2, 2.86), (2.8, 1.2), True),
    )  # fmt: skip
    layers = []
    for k, (words, solids, eye, unit, seen) in enumerate(cases):
        shift = np.array([3.9 * k, 0.6])
        colour = SEEN if seen else MISSED
        dash = {} if seen else {"stroke_dasharray": "5 4"}
        layers += [
            polygon(window(np.array(solid) + shift), **{**look_of("walls"), "stroke_width": 1})
            for solid in solids
        ]
        ray = line_data(window(np.array([eye, unit]) + shift))
        layers.append(path([ray], stroke=colour, stroke_width=1.6, fill="none", **dash))
        layers.append(circle(*window.at(np.array(eye) + shift), 5.0, fill=INK))
        (x, y), size = window.at(np.array(unit) + shift), 5.0
        layers.append(rect(x - size, y - size, 2 * size, 2 * size, fill=colour))
        below = window.at(shift + np.array([1.95, 0.0]))
        layers.append(text(*below, words, size=14, text_anchor="middle", fill="#222222"))
    legend = [
        (circle(0.0, 0.0, 5.0, fill=INK), "candidate"),
        (rect(-5.0, -5.0, 10.0, 10.0, fill=SEEN), "unit's midpoint, seen"),
        (rect(-5.0, -5.0, 10.0, 10.0, fill=MISSED), "not seen"),
    ]
    return picture(window, layers, legend)


PICTURES: dict[str, Callable[[PartPlan], str]] = {
    "floor": draw_floor,
    "navigable": draw_navigable,
    "candidates": draw_candidates,
    "visibility": draw_visibility,
    "raster": draw_raster,
    "vertex": draw_vertex,
    "selection": draw_selection,
    "route": draw_route,
    "mission": draw_mission,
}
OTHERS: dict[str, tuple[Callable[[PartPlan], str], dict[str, Any]]] = {
    "triangulation": (draw_candidates, {"candidates": "triangulation"}),
    "headings": (draw_headings, {"fov": 120.0}),
}
"""Pictures of plans with other settings."""


def main(folder: Path) -> None:
    """Write every picture."""
    drawn = office()
    shown = {name: draw(drawn) for name, draw in PICTURES.items()}
    shown.update({name: draw(office(**changes)) for name, (draw, changes) in OTHERS.items()})
    for name, content in shown.items():
        (folder / f"planning-{name}.svg").write_text(content, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images"))
