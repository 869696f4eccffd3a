"""plan.svg: a mission on its floor, to scale in millimetres, as a surveyor prints it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.files import plan_panel as panel
from stopgo.mission.files.floor_drawing import building, targets
from stopgo.mission.files.room_labels import STOPS, WALLS, WAY, Busy, KnownLabels, points_along, room_labels
from stopgo.mission.files.route_drawing import STOP, errors, network, rings, route, stops
from stopgo.mission.files.shared_drawing import shared_routes, shared_stops
from stopgo.mission.files.sheet import PaperBox, PaperMap, PaperSheet, SheetContents, fit, sheet_with
from stopgo.mission.files.stop_list import stop_list
from stopgo.mission.files.svg import FONT, attributes, clean, group, number, rect
from stopgo.mission.floor import Room
from stopgo.mission.geometry import FloatArray, bounds, closed
from stopgo.mission.stages import NavigableSpace, Route
from stopgo.mission.stages.figures import Figures

HANDY = 200
"""Scale 1:N up to which a long table may make the drawing smaller."""
PADDING = 8.0
"""Millimetres kept free round the floor, for coordinates and symbols on its edge."""


def plan_svg(
    made: Route,
    mission: Mission,
    figures: Figures | None = None,
    shared: Sequence[Mission] = (),
    *,
    date: str,
    with_range: bool = False,
    floors: FloorsOnPaper | None = None,
) -> bytes:
    """Return the plan as SVG, with a table of its figures if they are given.

    If several `shared` missions divide its stops, they are drawn instead of it.

    `date` is printed in the title block as given, so equal inputs give equal bytes.

    `with_range` adds a faint ring of the scanner's range about each stop. What other drawings have in common
    with it is kept in `floors`.
    """
    content, sheet = overview(made, mission, figures, shared, date=date, with_range=with_range, floors=floors)
    return _document(sheet, mission, content)


def overview(
    made: Route,
    mission: Mission,
    figures: Figures | None = None,
    shared: Sequence[Mission] = (),
    *,
    date: str,
    with_range: bool = False,
    with_table: bool = True,
    floors: FloorsOnPaper | None = None,
) -> tuple[str, PaperSheet]:
    """Return the blocks of the one sheet that shows everything, and the sheet."""
    facts = panel.facts_of(made, mission, shared, date=date)
    entries = panel.legend_entries(made, mission, shared)
    contents = _contents(made, shared or (mission,), facts, entries)
    rows = _table_rows(contents, mission, figures, shared) if with_table else []
    sheet = fit(replace(contents, rows=len(rows)))
    inside = "\n".join(drawing_of(made, mission, sheet, shared, with_range=with_range, floors=floors))
    drawn = (
        group("drawing", [inside], clip_path="url(#frame)"),
        _outline(sheet.drawing),
        panel.coordinate_ticks(sheet),
        panel.title_block(mission, [*facts, ("Scale", _scale(sheet))], sheet.title),
        panel.legend(entries, mission, sheet),
        panel.table(rows, sheet.table),
    )
    return "\n".join(item for item in drawn if item), sheet


def _table_rows(
    contents: SheetContents, mission: Mission, figures: Figures | None, shared: Sequence[Mission]
) -> list[panel.Row]:
    """Rows of the table: fewer of each list on a floor whose drawing would else be smaller."""
    stops = [stop_list(item) for item in shared or (mission,)]
    scale = max(HANDY, fit(contents).scale)
    rows: list[panel.Row] = []
    for most in panel.MOST_ROWS:
        rows = panel.shared_rows(shared, stops, most) if shared else panel.stop_rows(stops[0], most)
        rows += panel.figure_rows(figures, most) if figures else []
        sheet = sheet_with(replace(contents, rows=len(rows)))
        if sheet is not None and sheet.scale <= scale:
            break
    return rows


def whole_sheet(made: Route, mission: Mission) -> PaperSheet:
    """Return the sheet that shows everything, without a table."""
    facts = panel.facts_of(made, mission, date="")
    return fit(_contents(made, [mission], facts, panel.legend_entries(made, mission)))


def _contents(
    made: Route, missions: Sequence[Mission], facts: list[tuple[str, str]], entries: list[tuple[str, str]]
) -> SheetContents:
    """Contents of the one sheet, without a table."""
    blocks = (panel.legend_height(entries), panel.title_height([*facts, ("Scale", "")]), 0)
    return SheetContents(extent_of(made, *missions), PADDING, *blocks)


@dataclass(frozen=True, eq=False)
class FloorOnPaper:
    """A floor on a sheet, whatever mission is drawn over it."""

    space: NavigableSpace
    sheet: PaperSheet
    drawn: dict[tuple[object, ...], tuple[str, ...]] = field(default_factory=dict)
    """Whole drawings on it, by what they show."""

    @cached_property
    def building(self) -> tuple[str, ...]:
        """Floor, rooms, elements and openings."""
        return tuple(building(self.space, self.sheet))

    @cached_property
    def walls(self) -> Busy:
        """Points of the elements, which room names avoid."""
        elements = self.space.floor.elements
        solids = [closed(solid.exterior) for item in elements for solid in item.solids]
        lines = [
            self.sheet.on_paper(line) for line in (*solids, *(one for item in elements for one in item.lines))
        ]
        return Busy.of((WALLS, [points_along(lines, spacing=1.5)]))

    @cached_property
    def labels(self) -> KnownLabels:
        """Names of all rooms, off the elements."""
        return KnownLabels.of(self.space.floor.rooms, self.sheet, self.walls)


class FloorsOnPaper:
    """Drawings of one floor that are made once for each map to paper.

    Of several missions it is the floor and its names; of one mission it is the whole drawing.
    """

    def __init__(self, *, several: bool) -> None:
        self.several = several
        self._floors: dict[PaperMap, FloorOnPaper] = {}

    def on(self, space: NavigableSpace, sheet: PaperSheet) -> FloorOnPaper:
        """Return the drawing of the space on a sheet."""
        return self._floors.setdefault(sheet.map, FloorOnPaper(space, sheet))


def drawing_of(
    made: Route,
    mission: Mission,
    sheet: PaperSheet,
    shared: Sequence[Mission] = (),
    *,
    with_range: bool,
    rooms: Sequence[Room] | None = None,
    floors: FloorsOnPaper | None = None,
) -> tuple[str, ...]:
    """Return everything to scale, from the floor up to the numbers; the names of `rooms`, else of all.

    What other drawings have in common with it is in `floors`, if it is given.
    """
    floor = FloorOnPaper(made.space, sheet) if floors is None else floors.on(made.space, sheet)
    if floors is None or floors.several or rooms is not None:
        known = floor.labels if floors and floors.several else None
        return _drawn(made, mission, floor, shared, with_range=with_range, rooms=rooms, known=known)
    shows = (with_range, *(item.digest for item in shared or (mission,)))
    if shows not in floor.drawn:
        floor.drawn[shows] = _drawn(made, mission, floor, shared, with_range=with_range)
    return floor.drawn[shows]


def _drawn(
    made: Route,
    mission: Mission,
    floor: FloorOnPaper,
    shared: Sequence[Mission],
    *,
    with_range: bool,
    rooms: Sequence[Room] | None = None,
    known: KnownLabels | None = None,
) -> tuple[str, ...]:
    missions, sheet = shared or (mission,), floor.sheet
    named, avoid = made.floor.rooms if rooms is None else rooms, _busy(missions, sheet, floor.walls)
    parts = chain(
        floor.building,
        targets(made.selection, sheet),
        [rings(item, sheet) for item in missions] if with_range else [],
        shared_routes(shared, sheet) if shared else route(mission, sheet),
        network(mission, sheet),
        [room_labels(named, sheet, avoid=avoid, known=known)],
        [errors(mission, sheet)],
        shared_stops(shared, sheet) if shared else stops(mission, sheet),
    )
    return tuple(part for part in parts if part)


def _busy(missions: Sequence[Mission], sheet: PaperSheet, walls: Busy) -> Busy:
    """Return the points that room names avoid: stops above all, then the route, then elements."""
    turns = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    disc = (STOP + 0.5) * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    centres = [
        place
        for item in missions
        for place in ((item.start.x, item.start.y), *((stop.x, stop.y) for stop in item.stops))
    ]
    discs = [place + disc for place in sheet.on_paper(np.array(centres))]
    way = points_along([sheet.on_paper(leg) for leg in _legs(missions)], spacing=1.0)
    return Busy.of((STOPS, discs), (WAY, [way]), below=walls)


def _legs(missions: Sequence[Mission]) -> list[FloatArray]:
    return [leg for item in missions for leg in legs_of(item)]


def legs_of(mission: Mission) -> list[FloatArray]:
    """Polylines (n, 2) of a mission's legs, in metres."""
    legs = (*(stop.approach for stop in mission.stops), mission.return_ or ())
    return [np.array(leg, dtype=np.float64).reshape(-1, 2) for leg in legs]


def extent_of(made: Route, *missions: Mission) -> tuple[float, float, float, float]:
    """Bounds in metres of everything that is drawn to scale."""
    floor = made.floor
    solids = [solid.exterior for item in floor.elements for solid in item.solids]
    lines = [line for item in floor.elements for line in item.lines]
    rooms = [part.exterior for room in floor.rooms for part in room.polygons]
    openings = [opening.line for opening in floor.openings]
    starts = [np.array([[item.start.x, item.start.y]]) for item in missions]
    outline = [part.exterior for part in floor.outline]
    return bounds([*outline, *rooms, *solids, *lines, *openings, *_legs(missions), *starts])


def _scale(sheet: PaperSheet) -> str:
    lying = "landscape" if sheet.width > sheet.height else "portrait"
    return f"1:{sheet.scale} on {sheet.paper} {lying}"


def _outline(box: PaperBox) -> str:
    return rect(box.x, box.y, box.width, box.height, fill="none", stroke="#000", stroke_width=0.35)


def _document(sheet: PaperSheet, mission: Mission, content: str) -> bytes:
    size = {
        "width": f"{number(sheet.width)}mm",
        "height": f"{number(sheet.height)}mm",
        "viewBox": f"0 0 {number(sheet.width)} {number(sheet.height)}",
        "font_family": FONT,
    }
    box = sheet.drawing
    frame = rect(box.x, box.y, box.width, box.height)
    lines = (
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg"{attributes(size)}>',
        f"<title>{clean(mission.name)}: scan plan {clean(mission.id)}</title>",
        f'<defs><clipPath id="frame">{frame}</clipPath></defs>',
        rect(0.0, 0.0, sheet.width, sheet.height, fill="#ffffff"),
        content,
        "</svg>\n",
    )
    return "\n".join(lines).encode("utf-8")
