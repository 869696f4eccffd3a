"""Columns next to a plan: title block, legend with scale bar and axes, table of stops."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from msgspec import UNSET

from stopgo.mission.console.table import counted, duration
from stopgo.mission.document import Mission
from stopgo.mission.document.limits import limits_in_words
from stopgo.mission.document.schedule import schedule
from stopgo.mission.files import floor_drawing as floor_look
from stopgo.mission.files import route_drawing as route_look
from stopgo.mission.files.shared_drawing import back, letter, line_of
from stopgo.mission.files.sheet import COLUMN, HEADER, ROW, Chunk, PaperBox, PaperSheet
from stopgo.mission.files.stop_list import ListedStop
from stopgo.mission.files.svg import circle, group, line, number, path, polygon, rect, shortened, text
from stopgo.mission.geometry import polyline_length
from stopgo.mission.stages import Route, Selection
from stopgo.mission.stages.figures import Figures, GroupCoverage
from stopgo.mission.stages.network import error_factor, network_of
from stopgo.mission.stages.plan_results import PlanResults

BODY = 2.5
ERROR = "predicted error"
"""Legend of the error ellipses; the sheet's magnification follows it."""
LINE = 4.2
"""Height of a line of the title block and of the legend."""
TITLE_HEAD = 15.0
SCALE_AND_AXES = 25.0
MOST_ROWS = (1500, 500, 200, 80, 30, 10)
"""Rows of each list in the table; beyond, it says how many more there are.

The lower ones are for floors whose drawing would else be smaller.
"""


def title_height(facts: list[tuple[str, str]]) -> float:
    return TITLE_HEAD + LINE * len(facts) + 2.0


def title_block(mission: Mission, facts: list[tuple[str, str]], box: PaperBox) -> str:
    """The plan's name, and what it is of, when, and for which machine."""
    name = shortened(mission.name, size=5.0, width=box.width - 6)
    lines = [
        *(text(box.x + 3, box.y + 7, name, size=5.0, font_weight="bold"),),
        text(box.x + 3, box.y + 11.5, "Scan plan: stops of a terrestrial laser scanner", size=BODY),
        line(box.x, box.y + 13.5, box.x + box.width, box.y + 13.5, stroke="#000", stroke_width=0.25),
    ]
    for index, (key, value) in enumerate(facts):
        y = box.y + TITLE_HEAD + LINE * index + 3.0
        shown = shortened(value, size=BODY, width=box.width - 30)
        lines.append(text(box.x + 3, y, key, size=BODY, fill="#555555"))
        lines.append(text(box.x + 27, y, shown, size=BODY))
    return group("title", (_frame(box), *lines))


def facts_of(
    route: Route, mission: Mission, shared: Sequence[Mission] = (), *, date: str
) -> list[tuple[str, str]]:
    """Lines of the title block; the sheet's own (scale, paper) are put in when it is chosen."""
    selection, robot = route.selection, mission.robot
    settings = selection.settings
    return [
        *_whose(mission, shared),
        ("Floor", mission.origin.floor),
        ("Floor digest", mission.origin.floor_digest[:12]),
        ("Date", date),
        ("Scanner", f"{mission.scanner.profile}, range {mission.scanner.range:g} m"),
        *(
            [("Limits", ", ".join(told.values()))]
            if (told := limits_in_words(mission.limits, brief=True))
            else []
        ),
        ("Stops", _stops(mission, selection)),
        ("Coverage", _coverage(mission, selection)),
        ("Clearances", f"stop {settings.d_sec:g} m, robot {robot.radius:g} m, edge {settings.edge:g} m"),
        ("Route", _way(route, shared) + f", {robot.speed:g} m/s"),
        ("Planned time", _times([schedule(item).total_s for item in shared or (mission,)])),
        *_least_time(route, shared),
        ("Made by", f"stopgo {mission.origin.stopgo}"),
    ]


def _time(seconds: float) -> str:
    return f"{duration(seconds)} ({'h:min:s' if seconds >= 3600 else 'min:s'})"


def _whose(mission: Mission, shared: Sequence[Mission]) -> list[tuple[str, str]]:
    """The mission, or those that its stops are divided among."""
    if shared:
        return [(letter(k), f"{allocation_in_words(item)}: {item.id[:12]}") for k, item in enumerate(shared)]
    own = [] if mission.share is UNSET else [("Share", allocation_in_words(mission))]
    return [
        *own,
        ("Mission", f"{mission.id[:12]}, revision {mission.revision}"),
        ("Digest", mission.digest[:12]),
    ]


def allocation_in_words(mission: Mission) -> str:
    """Return the number of this mission among those that cover a floor together."""
    allocation = mission.share
    return "" if allocation is UNSET else f"{allocation.kind} {allocation.number} of {allocation.of}"


def _stops(mission: Mission, selection: Selection) -> str:
    if mission.share is not UNSET:
        return f"{len(mission.stops)} of this {mission.share.kind}"
    return f"{len(mission.stops)}; {PlanResults.of({Selection: selection}).bound_text}"


def _coverage(mission: Mission, selection: Selection) -> str:
    seen = f"{100 * selection.coverage:.1f} % of what is visible"
    return f"{seen}, {_required(selection.required)}" if mission.share is UNSET else f"{seen}, by these alone"


def _way(route: Route, shared: Sequence[Mission]) -> str:
    if not shared:
        return f"{route.length:.1f} m, {route.tour} tour"
    legs = [leg for item in shared for leg in (*(stop.approach for stop in item.stops), item.return_ or ())]
    metres = sum(polyline_length(np.array(leg)) for leg in legs if len(leg) > 1)
    return f"{metres:.1f} m together"


def _times(seconds: list[float]) -> str:
    if len(seconds) == 1:
        return _time(seconds[0])
    return f"longest {_time(max(seconds))}, together {duration(sum(seconds))}"


def _least_time(route: Route, shared: Sequence[Mission]) -> list[tuple[str, str]]:
    """Return the time saved by choosing stops and tour together, and the lower bound."""
    time = route.time
    if time is None or shared:
        return []
    told = f"{duration(time.saved_s)} saved, none below {duration(math.floor(time.bound))}"
    return [("Least time", told)]


def _required(fraction: float) -> str:
    return f"required {100 * fraction:g} %"


def legend_height(entries: list[tuple[str, str]]) -> float:
    return 7.0 + LINE * math.ceil(len(entries) / 2) + SCALE_AND_AXES


def legend_entries(route: Route, mission: Mission, shared: Sequence[Mission] = ()) -> list[tuple[str, str]]:
    """(symbol, words) for everything that is on this plan, and nothing else."""
    space = route.space
    openings = {state.passable for state in space.openings}
    any_view = not limits_in_words(mission.limits)
    some: list[tuple[str, str, bool]] = [
        ("seen", "covered by the stops", True),
        ("unseen", "visible, not covered" if any_view else "within limits, not covered", True),
        ("hidden", "not visible" if any_view else "not within limits", True),
        ("passable", "opening, passable", True in openings),
        ("blocked", "opening, not passable", False in openings),
        ("stop", "stop, and its heading", bool(mission.stops)),
        ("doorway", "stop in a doorway", any(stop.doorway for stop in mission.stops)),
        ("start", "start", True),
        *((f"way {k}", f"{letter(k)}: {allocation_in_words(item)}", True) for k, item in enumerate(shared)),
        ("way", "route", bool(mission.stops) and not shared),
        ("back", _back_words(route), mission.return_ is not None and not shared),
        ("thin", "its path back", any(item.return_ is not None for item in shared)),
        *_network_entries(mission),
    ]
    kinds = [(kind, kind) for kind in floor_look.kinds_of(space.floor)]
    return kinds + [(symbol, words) for symbol, words, there in some if there]


def _network_entries(mission: Mission) -> list[tuple[str, str, bool]]:
    network = network_of(mission)
    if network is None:
        return []
    return [
        ("pair", "scans that register", len(network.overlaps) > len(network.bridges)),
        ("bridge", "their only connection", bool(network.bridges)),
        ("error", ERROR, error_factor(mission, most_m=1.0) is not None),
    ]


def _back_words(route: Route) -> str:
    return "back to the start" if route.tour == "closed" else "on to the end"


def legend(entries: list[tuple[str, str]], mission: Mission, sheet: PaperSheet) -> str:
    """Symbols in two columns; below them the scale bar, the axes and north."""
    box = sheet.legend
    rows = math.ceil(len(entries) / 2)
    items = [text(box.x + 3, box.y + 4.6, "Legend", size=2.6, font_weight="bold")]
    factor = route_look.error_factor_on(sheet, mission)
    for index, (symbol, name) in enumerate(entries):
        words = f"{name} × {factor:g}" if symbol == "error" and factor is not None else name
        x = box.x + 3 + (index // rows) * (COLUMN / 2)
        y = box.y + 8.5 + LINE * (index % rows)
        items += [_symbol(symbol, x, y), text(x + 9, y + 0.8, words, size=BODY)]
    foot = box.y + box.height - SCALE_AND_AXES
    items += [_scale_bar(sheet, x=box.x + 5, y=foot + 16), _axes(mission, x=box.x + 70, y=foot + 17)]
    return group("legend", (_frame(box), *items))


def _symbol(name: str, x: float, y: float) -> str:
    """A sample 7 mm wide with its middle at height y."""
    kind, _, which = name.partition(" ")
    strokes = {**_STROKES, **({name: line_of(int(which))} if which and kind == "way" else {})}
    if name in strokes:
        return line(x, y, x + 7, y, **strokes[name])
    place = np.array([x + 3.5, y])
    if name == "blocked":
        mark = path([floor_look.cross(place, size=1.1)], fill="none", **floor_look.BLOCKED)
        return line(x, y, x + 7, y, **floor_look.BLOCKED) + mark
    if name == "start":
        return circle(x + 3.5, y, 1.9, fill="#111111") + _centred("S", x + 3.5, y, fill="#ffffff")
    if name == "error":
        turn = np.linspace(0, 2 * np.pi, 25)
        return polygon(place + np.stack([3.2 * np.cos(turn), 1.3 * np.sin(turn)], axis=1), **route_look.ERROR)
    if name in ("stop", "doorway"):
        outer = circle(x + 3.5, y, 1.9, fill="#fff", stroke=route_look.INK, stroke_width=0.2)
        inner = circle(x + 3.5, y, 1.5, fill="#fff", stroke=route_look.INK, stroke_width=0.3)
        tick = line(x + 5, y, x + 6.2, y, stroke=route_look.INK, stroke_width=0.6)
        return tick + (outer if name == "doorway" else "") + inner + _centred("1", x + 3.5, y)
    return rect(x, y - 1.3, 7.0, 2.6, **floor_look.look_of(name))


def _centred(word: str, x: float, y: float, **style: object) -> str:
    return text(x, y + 0.9, word, size=2.5, text_anchor="middle", font_weight="bold", **style)


_STROKES: dict[str, dict[str, object]] = {
    "seen": floor_look.SEEN,
    "unseen": floor_look.UNSEEN,
    "hidden": floor_look.HIDDEN,
    "passable": floor_look.PASSABLE,
    "way": route_look.WAY,
    "back": route_look.BACK,
    "pair": route_look.PAIR,
    "bridge": route_look.BRIDGE,
    "thin": back(0),
}


def _scale_bar(sheet: PaperSheet, *, x: float, y: float) -> str:
    """Five alternating fields over a round number of metres, at most 50 mm long."""
    metres = max(step * 10.0**power for power in range(-1, 7) for step in (1, 2, 5)
                 if sheet.length(step * 10.0**power) <= 50.01)  # fmt: skip
    field = sheet.length(metres) / 5
    fields = [
        rect(x + index * field, y, field, 1.6, fill=fill, stroke="#000", stroke_width=0.15)
        for index, fill in enumerate(("#000", "#fff", "#000", "#fff", "#000"))
    ]
    ends = [
        text(x + part * 5 * field, y - 1.2, f"{metres * part:g}", size=BODY, text_anchor="middle")
        for part in (0, 0.2, 1)
    ]
    words = text(x, y - 5.5, f"Scale 1:{sheet.scale}", size=2.8, font_weight="bold")
    return "".join((*fields, *ends, words, text(x + 5 * field + 3, y - 1.2, "m", size=BODY)))


def _axes(mission: Mission, *, x: float, y: float) -> str:
    """The site's axes; north too where the mission says where on earth it is."""
    arms = [_arrow(x, y, angle, length=6.5, label=label) for angle, label in ((0.0, "x"), (math.pi / 2, "y"))]
    if mission.georeference is not None:
        # +y bears heading_deg clockwise from north, so north lies that much counter-clockwise of +y.
        north = math.pi / 2 + math.radians(mission.georeference.heading_deg)
        arms.append(_arrow(x, y, north, length=12.0, label="N", stroke="#b00000"))
    return group("axes", arms)


def _arrow(x: float, y: float, angle: float, *, length: float, label: str, stroke: str = "#000000") -> str:
    ahead = np.array([math.cos(angle), -math.sin(angle)])
    tip = np.array([x, y]) + length * ahead
    word = tip + 2.3 * ahead
    return (
        line(x, y, *tip.tolist(), stroke=stroke, stroke_width=0.3)
        + polygon(route_look.arrowhead(tip, ahead), fill=stroke)
        + text(word[0], word[1] + 0.8, label, size=BODY, text_anchor="middle", fill=stroke)
    )


@dataclass(frozen=True)
class Row:
    """A line of the table: cells, each set to the right against its edge, or to the left from the first."""

    cells: tuple[str, ...]
    edges: tuple[float, ...]
    bold: bool = False
    to_left: bool = False
    """True if the first cell begins at the left."""


STOP_EDGES = (8.0, 25.0, 42.0, 58.0, 70.0, 81.0, 98.0)
COVERAGE_EDGES = (2.0, 58.0, 71.0, 84.0, 98.0)
STOP_COLUMNS = ("x m", "y m", "heading °", "units", "new", "arrives")
STOP_HEAD = Row(("no", *STOP_COLUMNS[:-1], "time"), STOP_EDGES, bold=True)

COVERAGE_HEAD = Row(("coverage", "all", "visible", "covered", "%"), COVERAGE_EDGES, bold=True, to_left=True)


def shared_rows(missions: Sequence[Mission], stops: Sequence[Sequence[ListedStop]], most: int) -> list[Row]:
    """The stops of every mission, below a line that says whose they are."""
    rows: list[Row] = []
    for k, (mission, own) in enumerate(zip(missions, stops, strict=True)):
        taken = duration(schedule(mission).total_s)
        told = f"{letter(k)}: {allocation_in_words(mission)}, {counted(len(own), 'stop')}, {taken}"
        rows += [_words(told, bold=True), *stop_rows(own, most, before=letter(k))]
    return rows


def stop_rows(stops: Sequence[ListedStop], most: int, *, before: str = "") -> list[Row]:
    """A row per stop, `most` of them, as the robot meets them; a doorway stop has a `d` after its number."""
    cells: list[tuple[str, ...]] = [
        (f"{before}{row['no']}{row['doorway'] and 'd'}", *(row[name] for name in STOP_COLUMNS))
        for row in (stop.cells for stop in stops[:most])
    ]
    return [*(Row(row, STOP_EDGES) for row in cells), *_more(len(stops) - most)]


def figure_rows(figures: Figures, most: int) -> list[Row]:
    """Coverage of the whole, every kind and every room; unreached rooms; findings; `most` rows of each."""
    groups = [figures.whole, *figures.kinds, *figures.rooms]
    rows = [
        replace(COVERAGE_HEAD, cells=("coverage", f"all {figures.unit}", *COVERAGE_HEAD.cells[2:])),
        *(_coverage_row(group) for group in groups[:most]),
        *_more(len(groups) - most),
    ]
    lists = {
        "not reached": [item.text for item in figures.unreached],
        "to be checked before driving": [item.message for item in figures.grave],
    }
    for head, lines in lists.items():
        if lines:
            rows += [_words(head, bold=True), *(_words(line) for line in lines[:most])]
            rows += _more(len(lines) - most)
    return rows


def _more(many: int) -> list[Row]:
    """A row that says how many rows a list has beyond those shown; none if it is whole."""
    return [_words(f"and {many} more")] if many > 0 else []


def _coverage_row(group: GroupCoverage) -> Row:
    return Row((shortened(group.name, size=BODY, width=42), *group.cells), COVERAGE_EDGES, to_left=True)


def _words(content: str, *, bold: bool = False) -> Row:
    return Row((shortened(content, size=BODY, width=COLUMN - 5),), (2.0,), bold, to_left=True)


def table(rows: list[Row], chunks: tuple[Chunk, ...]) -> str:
    """The rows, over as many columns of the sheet as they need."""
    return group("table", (_chunk(rows, chunk) for chunk in chunks), text_anchor="end")


def _chunk(rows: list[Row], chunk: Chunk) -> str:
    box = chunk.box
    shown = rows[chunk.first : chunk.first + chunk.count]
    lines = [_frame(box)]
    first = shown[1] if len(shown) > 1 and shown[1].edges == STOP_EDGES else shown[0]
    heads: dict[tuple[float, ...], Row] = {STOP_EDGES: STOP_HEAD, COVERAGE_EDGES: COVERAGE_HEAD}
    head = heads.get(first.edges)
    if head is not None and not first.bold:
        lines.append(_row(head, box.x, box.y + HEADER - 1.5))
    for index, row in enumerate(shown):
        top = box.y + HEADER + ROW * index
        if index % 2 == 0:
            lines.append(rect(box.x + 0.2, top, box.width - 0.4, ROW, fill="#f1eef7"))
        lines.append(_row(row, box.x, top + 2.6))
    return "\n".join(lines)


def _row(row: Row, x: float, y: float) -> str:
    cells = enumerate(zip(row.edges, row.cells, strict=True))
    spans = "".join(
        text(x + edge, y, cell, size=BODY, **({"text_anchor": "start"} if row.to_left and k == 0 else {}))
        for k, (edge, cell) in cells
        if cell
    )
    return f'<g font-weight="bold">{spans}</g>' if row.bold else spans


def _frame(box: PaperBox) -> str:
    return rect(box.x, box.y, box.width, box.height, fill="#fff", stroke="#000", stroke_width=0.25)


def coordinate_ticks(sheet: PaperSheet) -> str:
    """Coordinates of the site along the drawing's lower and left edge, in round metres."""
    step = next(s * 10.0**p for p in range(-1, 9) for s in (1, 2, 5) if sheet.length(s * 10.0**p) >= 25)
    items = [*_ticks(sheet, step, axis=0), *_ticks(sheet, step, axis=1)]
    return group("coordinates", items, fill="#666666", text_anchor="middle")


_TICK: dict[str, object] = {"stroke": "#666666", "stroke_width": 0.15}
_HALO: dict[str, object] = {"paint_order": "stroke", "stroke": "#ffffff", "stroke_width": 0.8}
"""Width of the margin: drawings up to the edge would cross the numbers."""


def _ticks(sheet: PaperSheet, step: float, *, axis: int) -> Iterator[str]:
    box = sheet.drawing
    room = ((box.width, box.height)[axis] / 2 - 7.0) * sheet.scale / 1000
    first = math.ceil((sheet.centre[axis] - room) / step)
    last = math.floor((sheet.centre[axis] + room) / step)
    for index in range(first, last + 1):
        point = list(sheet.centre)
        point[axis] = index * step
        x, y = sheet.on_paper(np.array(point)).tolist()
        label = f"{index * step:.10g}"
        if axis == 0:
            bottom = box.y + box.height
            yield line(x, bottom, x, bottom - 1.5, **_TICK)
            yield text(x, bottom - 2.2, label, size=BODY, **_HALO)
        else:
            yield line(box.x, y, box.x + 1.5, y, **_TICK)
            turned = f"rotate(-90 {number(box.x + 4.2)} {number(y)})"
            yield text(box.x + 4.2, y, label, size=BODY, transform=turned, **_HALO)
