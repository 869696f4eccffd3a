"""Sheets drawn in the words of `stopgo.mission.files.svg` -> one PDF, in lines and true to scale.

Only those words are understood, not SVG at large. What several sheets show is put into the file once.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

from stopgo.mission.files.sheet import PaperBox
from stopgo.mission.files.svg import number as svg_number

MM = 72 / 25.4
"""Points in a millimetre."""
FONTS = {False: "Helvetica", True: "Helvetica-Bold"}
"""By whether it is bold; every reader has them."""
WIDER = (
    "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
    "/usr/share/fonts/TTF/DejaVuSans.ttf",
    "/System/Library/Fonts/Supplemental/Arial Unicode.ttf",
    "C:/Windows/Fonts/arial.ttf",
)
"""Fonts with more letters than Helvetica's, for names that need them; the first that is there is embedded."""
_LETTER = re.compile(r"([MLlZ])")
_TURN = re.compile(r"rotate\((\S+) (\S+) (\S+)\)")

Style = Mapping[str, str]


@dataclass(frozen=True)
class PdfPage:
    """A sheet in millimetres, y down."""

    width: float
    height: float
    content: str
    """Elements; `<use href="#NAME" x="…" y="…"/>` stands for a shared drawing moved there."""
    name: str = ""
    """In the reader's table of contents."""
    frame: PaperBox | None = None
    """Window at which `clip-path` cuts drawings off."""


def pdf_of(pages: Sequence[PdfPage], *, title: str, shared: Mapping[str, str] | None = None) -> bytes:
    """The PDF; the same pages give the same bytes.

    Parameters
    ----------
    shared
        Drawings by name, elements in millimetres, y down.
    """
    from reportlab import rl_config
    from reportlab.pdfgen.canvas import Canvas

    file = BytesIO()
    rl_config.useA85 = 0  # streams of bytes, a fifth shorter than the letters of them
    canvas = Canvas(file, invariant=1, pageCompression=1)
    canvas.setTitle(title)
    canvas.setCreator("stopgo")
    for name, content in (shared or {}).items():
        canvas.beginForm(name, lowerx=-1e6, lowery=-1e6, upperx=1e6, uppery=1e6)
        _Pen(canvas).draw(_parsed(content), {})
        canvas.endForm()
    for number, page in enumerate(pages):
        canvas.setPageSize((page.width * MM, page.height * MM))
        if page.name:
            canvas.bookmarkPage(str(number))
            canvas.addOutlineEntry(page.name, str(number))
        canvas.transform(MM, 0, 0, -MM, 0, page.height * MM)
        _Pen(canvas, page.frame).draw(_parsed(page.content), {})
        canvas.showPage()
    canvas.save()
    return file.getvalue()


def _parsed(content: str) -> ET.Element:
    return ET.fromstring(f"<g>{content}</g>")


class _Pen:
    """Draws elements with what they inherit from those round them."""

    def __init__(self, canvas: Any, frame: PaperBox | None = None) -> None:
        self._canvas = canvas
        self._frame = frame

    def draw(self, element: ET.Element, inherited: Style) -> None:
        style = {**inherited, **element.attrib}
        drawing = _DRAWING.get(element.tag)
        if drawing is not None:
            drawing(self, element, style)
        elif element.tag in ("g", "svg"):
            self._group(element, style)

    def _group(self, element: ET.Element, style: dict[str, str]) -> None:
        clips = style.pop("clip-path", None) is not None and self._frame is not None
        if clips and self._frame is not None:
            box = self._frame
            self._canvas.saveState()
            path = self._canvas.beginPath()
            path.rect(box.x, box.y, box.width, box.height)
            self._canvas.clipPath(path, stroke=0, fill=0)
        for inner in element:
            self.draw(inner, style)
        if clips:
            self._canvas.restoreState()

    def _use(self, element: ET.Element, style: Style) -> None:
        self._canvas.saveState()
        self._canvas.translate(float(style["x"]), float(style["y"]))
        self._canvas.doForm(style["href"].removeprefix("#"))
        self._canvas.restoreState()

    def _inked(self, style: Style) -> tuple[int, int]:
        """Set colours and line; whether to stroke and whether to fill."""
        fill, stroke = style.get("fill", "#000000"), style.get("stroke", "none")
        if fill != "none":
            self._canvas.setFillColor(_colour(fill))
        if stroke != "none":
            self._canvas.setStrokeColor(_colour(stroke))
            self._canvas.setLineWidth(float(style.get("stroke-width", 1)))
            self._canvas.setDash([float(x) for x in style.get("stroke-dasharray", "").split()])
            self._canvas.setLineJoin(1 if style.get("stroke-linejoin") == "round" else 0)
        return int(stroke != "none"), int(fill != "none")

    def _path(self, element: ET.Element, style: Style) -> None:
        stroke, fill = self._inked(style)
        mode = 0 if style.get("fill-rule") == "evenodd" else 1
        path = _WrittenPath(" ".join(_operators(style.get("d", ""))))
        self._canvas.drawPath(path, stroke=stroke, fill=fill, fillMode=mode)

    def _line(self, element: ET.Element, style: Style) -> None:
        self._inked(style)
        self._canvas.line(*(float(style[key]) for key in ("x1", "y1", "x2", "y2")))

    def _rect(self, element: ET.Element, style: Style) -> None:
        stroke, fill = self._inked(style)
        box = (float(style[key]) for key in ("x", "y", "width", "height"))
        self._canvas.rect(*box, stroke=stroke, fill=fill)

    def _circle(self, element: ET.Element, style: Style) -> None:
        stroke, fill = self._inked(style)
        self._canvas.circle(*(float(style[key]) for key in ("cx", "cy", "r")), stroke=stroke, fill=fill)

    def _text(self, element: ET.Element, style: Style) -> None:
        content, size = element.text or "", float(style["font-size"])
        font, content = _font(content, bold=style.get("font-weight") == "bold")
        canvas = self._canvas
        shift = {"middle": 0.5, "end": 1.0}.get(style.get("text-anchor", "start"), 0.0)
        begin = -shift * canvas.stringWidth(content, font, size)
        canvas.saveState()
        turn = _TURN.fullmatch(style.get("transform", ""))
        angle = math.radians(float(turn[1])) if turn is not None else 0.0  # about its own place
        cos, sin = math.cos(angle), math.sin(angle)
        canvas.transform(cos, sin, sin, -cos, float(style["x"]), float(style["y"]))
        canvas.setFont(font, size)
        stroke, _ = self._inked(style)
        if stroke:  # a halo: the letters are painted over it
            canvas.drawString(begin, 0, content, mode=1)
        canvas.drawString(begin, 0, content, mode=0)
        canvas.restoreState()


_DRAWING = {
    "path": _Pen._path, "line": _Pen._line, "rect": _Pen._rect, "circle": _Pen._circle, "text": _Pen._text,
    "use": _Pen._use,
}  # fmt: skip


@dataclass(frozen=True)
class _WrittenPath:
    """A path that is written in the words of PDF already."""

    operators: str

    def getCode(self) -> str:
        """The operators, as a canvas asks a path for them."""
        return self.operators


def _operators(data: str) -> Iterator[str]:
    """Path data in the words of PDF; the points after `l` are steps, those after `M` and `L` positions."""
    last = ("0", "0")
    letters = _LETTER.split(data)[1:]
    for letter, numbers in zip(letters[::2], letters[1::2], strict=True):
        if letter == "Z":
            yield "h"
        words = iter(numbers.split())
        for count, xy in enumerate(zip(words, words, strict=True)):
            last = _moved(last, xy) if letter == "l" else xy
            yield f"{last[0]} {last[1]} {'m' if letter == 'M' and not count else 'l'}"


def _moved(point: tuple[str, str], step: tuple[str, str]) -> tuple[str, str]:
    x, y = (svg_number(float(at) + float(by)) for at, by in zip(point, step, strict=True))
    return x, y


@cache
def _colour(name: str) -> Any:
    from reportlab.lib.colors import HexColor

    return HexColor("#" + "".join(2 * letter for letter in name[1:]) if len(name) == 4 else name)


def _font(content: str, *, bold: bool) -> tuple[str, str]:
    """The font, and the text as it can be written with it."""
    if content.isascii() or _is_western(content):
        return FONTS[bold], content
    wider = _wider()
    return (wider, content) if wider else (FONTS[bold], content.encode("cp1252", "replace").decode("cp1252"))


def _is_western(content: str) -> bool:
    try:
        content.encode("cp1252")
    except UnicodeEncodeError:
        return False
    return True


@cache
def _wider() -> str:
    """A font of this machine's with more letters; empty if it has none of WIDER."""
    from reportlab.pdfbase.pdfmetrics import registerFont
    from reportlab.pdfbase.ttfonts import TTFError, TTFont

    for path in filter(lambda path: Path(path).exists(), WIDER):
        try:
            registerFont(TTFont("wider", path))
        except (TTFError, OSError):
            continue
        return "wider"
    return ""
