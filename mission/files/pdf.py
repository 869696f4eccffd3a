"""Sheets drawn in the words of `stopgo.mission.files.svg` -> one PDF, in lines and true to scale.

Only those words are understood, not SVG at large. What several sheets show is put into the file once.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
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
_WRITTEN = re.compile("[ -~¡-ÿ…]+")
"""Words that are written here; reportlab writes any others."""
_ESCAPES = {ord(letter): f"\\{letter}" for letter in "\\()"} | {
    ord(bytes([code]).decode("cp1252")): f"\\{code:03o}" for code in (0x85, *range(0xA1, 0x100))
}
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
    canvas = Canvas(file, invariant=1, pageCompression=1, pdfVersion=(1, 4))
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
        self._fonts: dict[tuple[str, float], str] = {}

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

    def _write(self, *operators: str) -> None:
        """Write operators; reportlab would take several times as long to check and format their numbers."""
        if written := "\n".join(filter(None, operators)):
            self._canvas.addLiteral(written)

    def _path(self, element: ET.Element, style: Style) -> None:
        ink = _ink_of(style)
        paint = ink.paint(even_odd=style.get("fill-rule") == "evenodd")
        self._write(ink.operators, _operators(style.get("d", "")), paint)

    def _line(self, element: ET.Element, style: Style) -> None:
        x1, y1, x2, y2 = (_word(style[key]) for key in ("x1", "y1", "x2", "y2"))
        self._write(_ink_of(style).operators, f"n {x1} {y1} m {x2} {y2} l S")

    def _rect(self, element: ET.Element, style: Style) -> None:
        ink, box = _ink_of(style), " ".join(_word(style[key]) for key in ("x", "y", "width", "height"))
        self._write(ink.operators, f"n {box} re {ink.paint(even_odd=True)}")

    def _circle(self, element: ET.Element, style: Style) -> None:
        ink = _ink_of(style)
        self._write(ink.operators)
        place = (float(style[key]) for key in ("cx", "cy", "r"))
        self._canvas.circle(*place, stroke=int(ink.stroke), fill=int(ink.fill))

    def _text(self, element: ET.Element, style: Style) -> None:
        font, content = _font(element.text or "", bold=style.get("font-weight") == "bold")
        size, ink = float(style["font-size"]), _ink_of(style)
        shift = {"middle": 0.5, "end": 1.0}.get(style.get("text-anchor", "start"), 0.0)
        begin = -shift * self._canvas.stringWidth(content, font, size) if shift else 0.0
        place = f"q\n{_turn_of(style)} {_word(style['x'])} {_word(style['y'])} cm"
        if font in FONTS.values() and _WRITTEN.fullmatch(content):
            at, shown = f"BT 1 0 0 1 {_numbers(begin)} 0 Tm", f"({content.translate(_ESCAPES)}) Tj T*"
            halo = f"{at} 1 Tr {shown} 0 Tr ET" if ink.stroke else ""
            self._write(place, self._font_words(font, size), ink.operators, halo, f"{at} {shown} ET\nQ")
            return
        self._write(place)
        self._canvas.setFont(font, size)
        self._write(ink.operators)
        for mode in (1, 0) if ink.stroke else (0,):  # a halo: the letters are painted over it
            self._canvas.drawString(begin, 0, content, mode=mode)
        self._write("Q")

    def _font_words(self, font: str, size: float) -> str:
        """The operators that choose a font."""
        if (font, size) not in self._fonts:
            chosen = self._canvas.beginText()
            chosen.setFont(font, size)
            self._fonts[font, size] = "BT " + chosen.getCode().partition(" Tm ")[2]
        return self._fonts[font, size]


_DRAWING = {
    "path": _Pen._path, "line": _Pen._line, "rect": _Pen._rect, "circle": _Pen._circle, "text": _Pen._text,
    "use": _Pen._use,
}  # fmt: skip


@dataclass(frozen=True)
class _Ink:
    """Colours and line of a shape, as operators, and whether it is stroked and filled."""

    operators: str
    stroke: bool
    fill: bool

    def paint(self, *, even_odd: bool) -> str:
        """The operator that paints a path."""
        letters = ("nS", "fB")[self.fill]
        return letters[self.stroke] + ("*" if self.fill and even_odd else "")


def _ink_of(style: Style) -> _Ink:
    return _ink(
        style.get("fill", "#000000"),
        style.get("stroke", "none"),
        style.get("stroke-width", "1"),
        style.get("stroke-dasharray", ""),
        style.get("stroke-linejoin", ""),
    )


@cache
def _ink(fill: str, stroke: str, width: str, dashes: str, join: str) -> _Ink:
    drawn = [f"{_colour(fill)} rg"] if fill != "none" else []
    if stroke != "none":
        drawn += [
            f"{_colour(stroke)} RG",
            f"{_numbers(float(width))} w",
            f"[{_numbers(*map(float, dashes.split()))}] 0 d",
            f"{int(join == 'round')} j",
        ]
    return _Ink("\n".join(drawn), stroke != "none", fill != "none")


def _numbers(*values: float) -> str:
    from reportlab.lib.rl_accel import fp_str

    return str(fp_str(*values)) if values else ""


def _word(value: str) -> str:
    """A number of an attribute as reportlab writes it: without the 0 before a point."""
    return value[1:] if value.startswith("0.") else value


def _turn_of(style: Style) -> str:
    """The turn of a text about its own place, in the numbers of PDF; y is up again."""
    turn = _TURN.fullmatch(style.get("transform", ""))
    if turn is None:
        return "1 0 0 -1"
    cos, sin = math.cos(math.radians(float(turn[1]))), math.sin(math.radians(float(turn[1])))
    return _numbers(cos, sin, sin, -cos)


def _operators(data: str) -> str:
    """Path data in the words of PDF."""
    return " ".join(map(_part_of_path, data.split("M")[1:]))


def _part_of_path(data: str) -> str:
    """The part after an M; points after `l` are steps, those after `L` positions."""
    first, *steps = data.removesuffix("Z").split("l")
    for step in steps:
        by, *others = step.split("L", 1)
        first = "L".join((first, _moved(first.rpartition("L")[2], by), *others))
    begin, *points = first.split("L", 1)
    ends = [" h"] if data.endswith("Z") else []
    return "".join((begin, " m", *(f" {point.replace('L', ' l ')} l" for point in points), *ends))


def _moved(point: str, step: str) -> str:
    return " ".join(
        svg_number(float(at) + float(by)) for at, by in zip(point.split(), step.split(), strict=True)
    )


@cache
def _colour(name: str) -> str:
    from reportlab.lib.colors import HexColor

    long = "#" + "".join(2 * letter for letter in name[1:]) if len(name) == 4 else name
    return _numbers(*HexColor(long).rgb())


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
