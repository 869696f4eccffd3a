"""Scale, sheet and layout of a plan: positions of the drawing, the table and the title block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray

PAPERS = {"A4": (297, 210), "A3": (420, 297), "A2": (594, 420), "A1": (841, 594), "A0": (1189, 841)}
"""Long and short side in millimetres."""
MARGIN = 10.0
"""Most printers leave a few millimetres; 10 also leaves room for a hole punch."""
COLUMN = 100.0
"""Width of a column of table, legend or title block."""
GAP = 3.0
ROW = 4.0
"""Height of a table row."""
HEADER = 5.0


@dataclass(frozen=True)
class PaperMap:
    """Map from site metres, y up, to paper, y down."""

    point: tuple[float, float]
    """A point of the site …"""
    position: tuple[float, float]
    """… and its position on paper."""
    per_metre: float = 1.0
    """Paper's units per metre."""

    def on_paper(self, xy: FloatArray) -> FloatArray:
        """Return points of the site (…, 2) on paper."""
        moved = (np.asarray(xy, dtype=np.float64) - self.point) * self.per_metre
        return np.asarray(moved * (1.0, -1.0) + self.position)


@dataclass(frozen=True)
class PaperBox:
    """A rectangle on paper, in millimetres from the sheet's upper left corner."""

    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class Chunk:
    """A part of the table: `count` rows from row `first` on."""

    box: PaperBox
    first: int
    count: int


@dataclass(frozen=True)
class PaperSheet:
    """A sheet of paper, its layout, and its scale."""

    paper: str
    width: float
    height: float
    scale: int
    """N of 1:N."""
    drawing: PaperBox
    legend: PaperBox
    title: PaperBox
    table: tuple[Chunk, ...]
    centre: tuple[float, float]
    """The point of the site, in metres, at the centre of the drawing."""

    @property
    def map(self) -> PaperMap:
        """Map to the sheet's millimetres."""
        middle = (self.drawing.x + self.drawing.width / 2, self.drawing.y + self.drawing.height / 2)
        return PaperMap(self.centre, middle, 1000 / self.scale)

    def on_paper(self, xy: FloatArray) -> FloatArray:
        """Site metres (…, 2), y up, as millimetres on the sheet, y down."""
        return self.map.on_paper(xy)

    def length(self, metres: float) -> float:
        """Metres as millimetres on paper."""
        return metres * 1000 / self.scale


@dataclass(frozen=True)
class SheetContents:
    """Contents of a sheet: the site's bounds in metres, and heights of the blocks in mm."""

    bounds: tuple[float, float, float, float]
    padding: float
    legend: float
    title: float
    rows: int

    @property
    def centre(self) -> tuple[float, float]:
        x0, y0, x1, y1 = self.bounds
        return ((x0 + x1) / 2, (y0 + y1) / 2)

    def size(self, scale: int) -> tuple[float, float]:
        """Width and height of the drawing in millimetres."""
        x0, y0, x1, y1 = self.bounds
        return ((x1 - x0) * 1000 / scale + 2 * self.padding, (y1 - y0) * 1000 / scale + 2 * self.padding)


def fit(contents: SheetContents) -> PaperSheet:
    """The sheet for a plan: the largest scale that is still handy, on the smallest paper that holds it."""
    sheet = sheet_with(contents)
    if sheet is None:
        raise InputError(f"the floor reaches over {contents.bounds} m; no sheet holds that, check its unit")
    return sheet


def sheet_with(contents: SheetContents) -> PaperSheet | None:
    """The same; None if no sheet holds the contents."""
    for scale, papers in _scales():
        for paper in papers:
            long, short = PAPERS[paper]
            for width, height in ((long, short), (short, long)):
                for layout in (_beside, _below):
                    sheet = layout(contents, paper, float(width), float(height), scale)
                    if sheet is not None:
                        return sheet
    return None


def _scales() -> Iterator[tuple[int, tuple[str, ...]]]:
    """1:50 while an office printer has the paper, then what can be folded, then whatever holds it."""
    papers = tuple(PAPERS)
    yield 50, papers[:2]
    yield 100, papers[:3]
    yield 200, papers
    for power in range(2, 8):
        for step in (5, 10, 20):
            yield step * 10**power, papers


def _beside(
    contents: SheetContents, paper: str, width: float, height: float, scale: int
) -> PaperSheet | None:
    """Columns to the right of the drawing."""
    tall = height - 2 * MARGIN
    wide, high = contents.size(scale)
    for columns in range(1, int((width - 2 * MARGIN) // COLUMN) + 1):
        left = width - MARGIN - columns * (COLUMN + GAP)
        packed = _packed(contents, columns, x=left + GAP, y=MARGIN, height=tall)
        if packed is not None:
            drawing = PaperBox(MARGIN, MARGIN, left - MARGIN, tall)
            fits = wide <= drawing.width and high <= drawing.height
            return (
                PaperSheet(paper, width, height, scale, drawing, *packed, contents.centre) if fits else None
            )
    return None


def _below(contents: SheetContents, paper: str, width: float, height: float, scale: int) -> PaperSheet | None:
    """Columns in a strip under the drawing, as low as it can be."""
    columns = int((width - 2 * MARGIN + GAP) // (COLUMN + GAP))
    left = width - MARGIN - columns * (COLUMN + GAP) + GAP
    wide, high = contents.size(scale)
    most = height - 2 * MARGIN - GAP - high
    if wide > width - 2 * MARGIN:
        return None
    for strip in np.arange(max(contents.legend, contents.title), most, ROW).tolist():
        packed = _packed(contents, columns, x=left, y=height - MARGIN - strip, height=strip)
        if packed is not None:
            drawing = PaperBox(MARGIN, MARGIN, width - 2 * MARGIN, height - 2 * MARGIN - GAP - strip)
            return PaperSheet(paper, width, height, scale, drawing, *packed, contents.centre)
    return None


def _packed(
    contents: SheetContents, columns: int, *, x: float, y: float, height: float
) -> tuple[PaperBox, PaperBox, tuple[Chunk, ...]] | None:
    """Title block at the lower right, the legend above or left of it, the table in what is left."""
    lefts = [x + number * (COLUMN + GAP) for number in range(columns)]
    together = contents.legend + GAP + contents.title <= height
    beside = 0 if together else 1
    if beside >= columns or max(contents.legend, contents.title) > height:
        return None
    legend = PaperBox(lefts[-1 - beside], y, COLUMN, contents.legend)
    title = PaperBox(lefts[-1], y + height - contents.title, COLUMN, contents.title)
    spans = [PaperBox(left, y, COLUMN, height) for left in lefts[: columns - 1 - beside]]
    below_legend = legend.y + legend.height + GAP
    if together:
        spans.append(PaperBox(legend.x, below_legend, COLUMN, title.y - GAP - below_legend))
    else:
        spans.append(PaperBox(legend.x, below_legend, COLUMN, y + height - below_legend))
        spans.append(PaperBox(title.x, y, COLUMN, title.y - GAP - y))
    table = _chunks(spans, contents.rows)
    return None if table is None else (legend, title, table)


def _chunks(spans: list[PaperBox], rows: int) -> tuple[Chunk, ...] | None:
    """The table's rows over the spans from left to right, or None if they do not fit."""
    if sum(max(int((span.height - HEADER) // ROW), 0) for span in spans) < rows:
        return None
    chunks: list[Chunk] = []
    first = 0
    for span in spans:
        count = min(int((span.height - HEADER) // ROW), rows - first)
        if count > 0:
            box = PaperBox(span.x, span.y, span.width, HEADER + count * ROW)
            chunks.append(Chunk(box, first, count))
            first += count
    return tuple(chunks)
