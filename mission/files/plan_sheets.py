"""A plan as a set of sheets for the building site: overview, sheets at a readable scale, lists to tick.

Every sheet shows its number, the number of all, and its position on the floor. Parts to scale are drawn
once and shown through the window of each sheet.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stopgo.mission.console.freed_memory import give_back
from stopgo.mission.document import Mission
from stopgo.mission.files import plan_panel as panel
from stopgo.mission.files.floor_drawing import outline
from stopgo.mission.files.pdf import PdfPage, pdf_of
from stopgo.mission.files.plan_svg import (
    FloorsOnPaper,
    drawing_of,
    extent_of,
    legs_of,
    overview,
    whole_sheet,
)
from stopgo.mission.files.room_labels import inside, points_along
from stopgo.mission.files.sheet import COLUMN, GAP, MARGIN, PAPERS, PaperBox, PaperSheet
from stopgo.mission.files.stop_list import stop_list
from stopgo.mission.files.svg import group, line, rect, shortened, text, use
from stopgo.mission.floor import FloorPlan, Room
from stopgo.mission.geometry import FloatArray, bounds
from stopgo.mission.stages import Route
from stopgo.mission.stages.figures import Figures

READABLE = 100
"""Scale 1:N at which stops and walls are distinct; a floor on one such sheet needs no further ones."""
TILE_PAPER = "A3"
OVERLAP = 20.0
"""Overlap of neighbouring sheets in millimetres."""
KEY_HEIGHT = 60.0
"""Of the small plan that shows where a sheet lies."""
LIST_ROW, LIST_SIZE = 5.5, 2.6
BOX = 3.2
"""Side of a box to tick, millimetres."""
NAMED_TILES = 40
"""Sheets up to which each has its name on the small plan."""
COLUMNS = (
    ("", 0.0), ("no", 7.0), ("stop", 17.0), ("room", 37.0), ("x m", 87.0), ("y m", 107.0),
    ("heading °", 122.0), ("at", 143.0), ("sheet", 157.0), ("note", 170.0),
)  # fmt: skip
"""Of the list of stops: where each begins, millimetres from the margin."""


@dataclass(frozen=True)
class Tile:
    """A window on the drawing: its name, and its lower left corner and upper right one, metres."""

    name: str
    low: tuple[float, float]
    high: tuple[float, float]

    def holds(self, x: float, y: float) -> bool:
        return self.low[0] <= x <= self.high[0] and self.low[1] <= y <= self.high[1]

    def shows(self, box: tuple[float, float, float, float]) -> bool:
        """True if a part of what lies within these bounds may be in this window."""
        x0, y0, x1, y1 = box
        return x0 <= self.high[0] and self.low[0] <= x1 and y0 <= self.high[1] and self.low[1] <= y1


def needs_sheets(made: Route, mission: Mission) -> bool:
    """Return True if one sheet shows the floor too small to read."""
    return whole_sheet(made, mission).scale > READABLE


def plan_pdf(
    made: Route,
    mission: Mission,
    figures: Figures,
    *,
    date: str,
    with_range: bool = False,
    floors: FloorsOnPaper | None = None,
) -> bytes:
    """The whole set; equal inputs give equal bytes.

    `with_range` adds a ring of the scanner's range about each stop. What the sets of several missions have in
    common is kept in `floors`.
    """
    pages, shared = sheets_of(made, mission, figures, date=date, with_range=with_range, floors=floors)
    return pdf_of(pages, title=f"{mission.name}: scan plan {mission.id[:12]}", shared=shared)


def sheets_of(
    made: Route,
    mission: Mission,
    figures: Figures,
    *,
    date: str,
    with_range: bool = False,
    floors: FloorsOnPaper | None = None,
) -> tuple[list[PdfPage], dict[str, str]]:
    """The sheets, and the drawings that several of them show."""
    floor = made.floor
    content, whole = overview(
        made, mission, date=date, with_range=with_range, with_table=False, floors=floors
    )
    pages = [PdfPage(whole.width, whole.height, content, "Overview", whole.drawing)]
    give_back()  # a drawing is made from many short words
    every = tiles_of(made, mission) if whole.scale > READABLE else []
    tiles = _driven(every, mission) if mission.share else every
    shared: dict[str, str] = {}
    if tiles:
        site = _site_sheet(whole.centre)
        rooms = _rooms_shown(floor.rooms, tiles)
        drawn = drawing_of(made, mission, site, with_range=with_range, rooms=rooms, floors=floors)
        shared["site"] = "\n".join(drawn)
        give_back()
        shared["key"] = _key(every, floor)
        shared["legend"] = _tile_legend(made, mission, tiles[0])
        pages += [_tile_page(tile, every, site, mission, date) for tile in tiles]
    pages += _lists(mission, floor, figures, tiles, date)
    return [_numbered(page, number, len(pages)) for number, page in enumerate(pages, 1)], shared


def _numbered(page: PdfPage, number: int, total: int) -> PdfPage:
    words = f"sheet {number} of {total}"
    last = text(page.width - MARGIN, page.height - 4.0, words, size=LIST_SIZE, text_anchor="end")
    return replace(page, content=page.content + last)


# Sheets at a readable scale


def _window() -> tuple[float, float]:
    """Width and height of a tile's drawing, millimetres."""
    long, short = PAPERS[TILE_PAPER]
    return long - 2 * MARGIN - GAP - COLUMN, short - 2 * MARGIN


def tiles_of(made: Route, mission: Mission) -> list[Tile]:
    """Windows over the floor in rows from the upper left, those without anything of the plan left out."""
    x0, y0, x1, y1 = extent_of(made, mission)
    width, height = (side * READABLE / 1000 for side in _window())
    step_x, step_y = (side - OVERLAP * READABLE / 1000 for side in (width, height))
    columns, rows = (max(1, math.ceil((span - (side - step)) / step)) for span, side, step in
                     ((x1 - x0, width, step_x), (y1 - y0, height, step_y)))  # fmt: skip
    left = (x0 + x1 - (columns - 1) * step_x - width) / 2
    top = (y0 + y1 + (rows - 1) * step_y + height) / 2
    busy = _places(made, mission)
    found = []
    for row in range(rows):
        y = top - row * step_y - height
        there = np.sort(busy[(busy[:, 1] >= y) & (busy[:, 1] <= y + height), 0])
        for column in range(columns):
            x = left + column * step_x
            if np.searchsorted(there, x) < np.searchsorted(there, x + width, side="right"):
                found.append(Tile(f"{_letters(row)}{column + 1}", (x, y), (x + width, y + height)))
    return found


def _driven(tiles: Sequence[Tile], mission: Mission) -> list[Tile]:
    """The windows through which a mission's route leads: other places belong to other missions."""
    way = points_along(legs_of(mission), spacing=1.0).tolist()
    return [tile for tile in tiles if any(tile.holds(x, y) for x, y in way)]


def _rooms_shown(rooms: Sequence[Room], tiles: Sequence[Tile]) -> list[Room]:
    """The rooms of which a part may be on one of the sheets."""
    boxes = [(room, bounds(part.exterior for part in room.polygons)) for room in rooms if room.polygons]
    return [room for room, box in boxes if any(tile.shows(box) for tile in tiles)]


def _letters(row: int) -> str:
    return (_letters(row // 26 - 1) if row >= 26 else "") + chr(ord("A") + row % 26)


def _places(made: Route, mission: Mission) -> FloatArray:
    """Return the points (n, 2) that the sheets must show: targets, stops and the route."""
    start = [(mission.start.x, mission.start.y)]
    return np.concatenate([made.visibility.targets.unit_xy, *legs_of(mission), start])


def _site_sheet(centre: tuple[float, float]) -> PaperSheet:
    """A sheet without end at the readable scale, with the site's middle at its corner."""
    nowhere = PaperBox(0.0, 0.0, 0.0, 0.0)
    return PaperSheet("", 0.0, 0.0, READABLE, nowhere, nowhere, nowhere, (), centre)


def _tile_sheet(tile: Tile) -> PaperSheet:
    """The paper of a tile, without the blocks next to its drawing."""
    long, short = (float(side) for side in PAPERS[TILE_PAPER])
    nowhere, box = PaperBox(0.0, 0.0, 0.0, 0.0), PaperBox(MARGIN, MARGIN, *_window())
    middle = ((tile.low[0] + tile.high[0]) / 2, (tile.low[1] + tile.high[1]) / 2)
    return PaperSheet(TILE_PAPER, long, short, READABLE, box, nowhere, nowhere, (), middle)


def _right_of_drawing(sheet: PaperSheet) -> float:
    """Millimetres from the left at which the blocks next to a tile's drawing begin."""
    return sheet.width - MARGIN - COLUMN


def _tile_legend(made: Route, mission: Mission, tile: Tile) -> str:
    """The legend, which is the same on every tile."""
    entries, sheet = panel.legend_entries(made, mission), _tile_sheet(tile)
    box = PaperBox(_right_of_drawing(sheet), MARGIN, COLUMN, panel.legend_height(entries))
    return panel.legend(entries, mission, replace(sheet, legend=box))


def _tile_page(tile: Tile, tiles: Sequence[Tile], site: PaperSheet, mission: Mission, date: str) -> PdfPage:
    facts = [
        *(("Sheet", tile.name), ("Scale", f"1:{READABLE} on {TILE_PAPER} landscape")),
        ("Mission", f"{mission.id[:12]}, revision {mission.revision}"),
        *(("Digest", mission.digest[:12]), ("Floor", mission.origin.floor), ("Date", date)),
    ]
    sheet, height = _tile_sheet(tile), panel.title_height(facts)
    box, left, title_y = sheet.drawing, _right_of_drawing(sheet), sheet.height - MARGIN - height
    content = (
        group(
            "drawing", [use("site", *sheet.on_paper(np.array(site.centre)).tolist())], clip_path="url(#frame)"
        ),
        rect(box.x, box.y, box.width, box.height, fill="none", stroke="#000", stroke_width=0.35),
        panel.coordinate_ticks(sheet),
        use("legend", 0.0, 0.0),
        panel.title_block(mission, facts, PaperBox(left, title_y, COLUMN, height)),
        _key_window(tile, tiles, PaperBox(left, title_y - GAP - KEY_HEIGHT, COLUMN, KEY_HEIGHT)),
    )
    return PdfPage(sheet.width, sheet.height, "\n".join(content), f"Sheet {tile.name}", box)


def _key_sheet(tiles: Sequence[Tile]) -> PaperSheet:
    """The small plan's scale: all the sheets fit into its box."""
    (x0, y0), (x1, y1) = (
        np.min([tile.low for tile in tiles], axis=0),
        np.max([tile.high for tile in tiles], axis=0),
    )
    scale = math.ceil(1000 * max((x1 - x0) / (COLUMN - 6), (y1 - y0) / (KEY_HEIGHT - 6)))
    nowhere = PaperBox(0.0, 0.0, 0.0, 0.0)
    return PaperSheet("", 0.0, 0.0, scale, nowhere, nowhere, nowhere, (), ((x0 + x1) / 2, (y0 + y1) / 2))


def _key(tiles: Sequence[Tile], floor: FloorPlan) -> str:
    """The small plan of all sheets, about its middle."""
    small = _key_sheet(tiles)
    marks = (
        _mark(tile, small, "#999999", 0.15, named="#777777" if len(tiles) <= NAMED_TILES else "")
        for tile in tiles
    )
    return outline(floor, small) + "".join(marks)


def _mark(tile: Tile, small: PaperSheet, stroke: str, width: float, *, named: str) -> str:
    """A sheet on the small plan, with its name in the colour `named`, if there is one."""
    (x0, y1), (x1, y0) = small.on_paper(np.array([tile.low, tile.high])).tolist()
    frame = rect(x0, y0, x1 - x0, y1 - y0, fill="none", stroke=stroke, stroke_width=width)
    if not named:
        return frame
    x, y = (x0 + x1) / 2, (y0 + y1) / 2 + 0.9
    return frame + text(x, y, tile.name, size=2.5, fill=named, text_anchor="middle")


def _key_window(tile: Tile, tiles: Sequence[Tile], box: PaperBox) -> str:
    """The small plan, with this sheet marked."""
    small = replace(_key_sheet(tiles), drawing=box)
    frame = rect(box.x, box.y, box.width, box.height, fill="#fff", stroke="#000", stroke_width=0.25)
    here = _mark(tile, small, "#b00000", 0.6, named="#b00000")
    return frame + use("key", box.x + box.width / 2, box.y + box.height / 2) + here


# Lists


def _lists(
    mission: Mission, floor: FloorPlan, figures: Figures, tiles: Sequence[Tile], date: str
) -> list[PdfPage]:
    """Stops to tick, then rooms, what is left out and what is doubtful; as many pages as they need."""
    pages = _paged("Stops", _stop_lines(mission, floor, tiles), mission, date, head=COLUMNS)
    return pages + _paged("Rooms and findings", _figure_lines(figures), mission, date, head=FIGURE_COLUMNS)


ListLine = tuple[tuple[float, str, bool], ...]
"""Where a cell begins, its words, and whether they are bold."""


def _stop_lines(mission: Mission, floor: FloorPlan, tiles: Sequence[Tile]) -> Iterator[ListLine]:
    for listed, room in zip(stop_list(mission), rooms_of(mission, floor), strict=True):
        stop, row = listed.stop, listed.cells
        cells = {
            **row,
            "": "☐",
            "stop": shortened(stop.id, size=LIST_SIZE, width=18),
            "room": shortened(room, size=LIST_SIZE, width=48),
            "at": row["arrives"],
            "sheet": next((tile.name for tile in tiles if tile.holds(stop.x, stop.y)), "1"),
            "note": "doorway" if stop.doorway else "",
        }
        yield tuple((begin, cells[name], False) for name, begin in COLUMNS)


def rooms_of(mission: Mission, floor: FloorPlan) -> list[str]:
    """Return the name of each stop's room; empty between rooms."""
    rooms = [(room.label, [ring for part in room.polygons for ring in part.rings]) for room in floor.rooms]
    rooms = [(label, rings) for label, rings in rooms if rings]
    x0, y0, x1, y1 = np.reshape([bounds(rings) for _, rings in rooms], (-1, 4)).T
    names = []
    for stop in mission.stops:
        near = np.flatnonzero((x0 <= stop.x) & (stop.x <= x1) & (y0 <= stop.y) & (stop.y <= y1)).tolist()
        x, y = np.array([stop.x]), np.array([stop.y])
        names.append(next((rooms[k][0] for k in near if inside(x, y, rooms[k][1])[0, 0]), ""))
    return names


FIGURE_COLUMNS = (("", 0.0), ("all", 90.0), ("visible", 112.0), ("covered", 134.0), ("covered %", 156.0))


def _figure_lines(figures: Figures) -> Iterator[ListLine]:
    begins = [begin for _, begin in FIGURE_COLUMNS]
    for item in (figures.whole, *figures.kinds, *figures.rooms):
        cells = (shortened(item.name, size=LIST_SIZE, width=86), *item.cells)
        yield tuple((begin, cell, item is figures.whole) for begin, cell in zip(begins, cells, strict=True))
    parts = (
        ("Rooms left out", [item.text for item in figures.unreached]),
        ("To be checked before driving", [item.message for item in figures.grave]),
        ("Notes", [item.message for item in figures.findings if item not in figures.grave]),
    )
    for title, lines in parts:
        if lines:
            yield ()
            yield ((0.0, title, True),)
        for words in lines:
            yield ((0.0, shortened(words, size=LIST_SIZE, width=185), False),)


def _paged(
    title: str, lines: Iterator[ListLine], mission: Mission, date: str, *, head: Sequence[tuple[str, float]]
) -> list[PdfPage]:
    """Lines over pages of A4, each with a heading of its own."""
    height, width = (float(side) for side in PAPERS["A4"])
    every = list(lines)
    fits = int((height - 2 * MARGIN - 20.0) // LIST_ROW)
    pages = []
    for first in range(0, len(every), fits):
        shown = every[first : first + fits]
        content = [
            text(
                MARGIN,
                MARGIN + 5,
                f"{title}: {shortened(mission.name, size=5.0, width=130)}",
                size=5.0,
                font_weight="bold",
            ),
            text(
                MARGIN,
                MARGIN + 10,
                f"mission {mission.id[:12]}, revision {mission.revision}, {mission.origin.floor}, {date}",
                size=2.6,
                fill="#555555",
            ),
            *(
                text(MARGIN + begin, MARGIN + 17, words, size=2.6, font_weight="bold")
                for words, begin in head
                if words
            ),
        ]
        for number, cells in enumerate(shown):
            y = MARGIN + 20 + LIST_ROW * number
            content.append(line(MARGIN, y, width - MARGIN, y, stroke="#bbbbbb", stroke_width=0.15))
            content += [_cell(MARGIN + begin, y, words, bold=bold) for begin, words, bold in cells if words]
        name = title if len(every) <= fits else f"{title} {first // fits + 1}"
        pages.append(PdfPage(width, height, "\n".join(content), name))
    return pages


def _cell(x: float, y: float, words: str, *, bold: bool) -> str:
    if words == "☐":
        return rect(x + 1, y + (LIST_ROW - BOX) / 2, BOX, BOX, fill="none", stroke="#000", stroke_width=0.25)
    weight: dict[str, object] = {"font_weight": "bold"} if bold else {}
    return text(x, y + LIST_ROW - 1.7, words, size=LIST_SIZE, **weight)
