"""Elements of SVG as strings, in millimetres on paper, y down."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from html import escape
from itertools import accumulate, takewhile

import numpy as np

from stopgo.mission.geometry import FloatArray

FONT = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif"
SMALLEST_TEXT = 2.5
"""Millimetres; smaller print is not read on a building site."""

_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def group(name: str, content: Iterable[str], **style: object) -> str:
    """A named layer; empty layers are left out."""
    inside = "\n".join(item for item in content if item)
    return f'<g id="{name}"{attributes(style)}>\n{inside}\n</g>' if inside else ""


def attributes(values: Mapping[str, object]) -> str:
    """` stroke-width="0.25"` from `stroke_width=0.25`."""
    return "".join(f' {key.replace("_", "-")}="{_value(value)}"' for key, value in values.items())


def text(x: float, y: float, content: str, *, size: float, **style: object) -> str:
    """A line of text whose baseline begins (or is anchored) at x, y."""
    place = {"x": x, "y": y, "font_size": max(size, SMALLEST_TEXT)}
    return f"<text{attributes({**place, **style})}>{clean(content)}</text>"


def clean(content: str) -> str:
    """Return text as XML may hold it: escaped, with characters that XML 1.0 forbids replaced."""
    return escape(_NOT_XML.sub("\ufffd", content))


def text_width(content: str, size: float) -> float:
    """About the width of a line of text, as in the widest of the fonts asked for."""
    return size * sum(map(_letter_width, content)) / 100


@cache
def _letter_width(letter: str) -> int:
    """Hundredths of the text's size."""
    if letter in " .,:;'|ijlI-()[]/":
        return 36
    if letter.isupper() or letter in "mw%@":
        return 72
    # East Asian letters are square.
    return 62 if letter < "\u2e80" else 100


def shortened(content: str, *, size: float, width: float) -> str:
    """The text, cut with an ellipsis where it would be wider than `width`."""
    if text_width(content, size) <= width:
        return content
    widths = accumulate(map(_letter_width, content), initial=_letter_width("…"))
    fits = sum(1 for _ in takewhile(lambda hundredths: size * hundredths / 100 <= width, widths)) - 1
    return content[: max(1, fits)].rstrip() + "…"


def line(x1: float, y1: float, x2: float, y2: float, **style: object) -> str:
    return f"<line{attributes({'x1': x1, 'y1': y1, 'x2': x2, 'y2': y2, **style})}/>"


def rect(x: float, y: float, width: float, height: float, **style: object) -> str:
    return f"<rect{attributes({'x': x, 'y': y, 'width': width, 'height': height, **style})}/>"


def use(name: str, x: float, y: float) -> str:
    """A shared drawing, moved by x, y."""
    return f'<use href="#{name}" x="{x}" y="{y}"/>'


def circle(x: float, y: float, radius: float, **style: object) -> str:
    return f"<circle{attributes({'cx': x, 'cy': y, 'r': radius, **style})}/>"


def polygon(points: FloatArray, **style: object) -> str:
    return path([ring_data(points)], **style)


def path(data: Iterable[str], **style: object) -> str:
    """Return one path of many parts; nothing when there are none."""
    joined = "".join(data)
    return f'<path d="{joined}"{attributes(style)}/>' if joined else ""


def ring_data(points: FloatArray) -> str:
    """Path data of a closed ring (n, 2)."""
    return lines_data(points, [len(points)], end="Z") if len(points) else ""


def line_data(points: FloatArray) -> str:
    """Path data of a polyline (n, 2)."""
    return lines_data(points, [len(points)])


def lines_data(points: FloatArray, lengths: Iterable[int], *, end: str = "") -> str:
    """Path data of polylines of these lengths, whose points (n, 2) follow one another."""
    words = "".join("M" + "L".join(["%.2f %.2f"] * length) + end for length in lengths)
    data = words % tuple(np.asarray(points, dtype=np.float64).ravel().tolist())
    for digits, short in _SHORTER.items():
        data = data.replace(digits, short)
    return data


_SHORTER = {"-0.00": "0", ".00": "", **{f".{digit}0": f".{digit}" for digit in range(1, 10)}}
"""Two digits after a point without the zeros that end them."""


def number(value: float) -> str:
    """A hundredth of a millimetre is finer than any printer."""
    shown = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if shown == "-0" else shown


def _value(value: object) -> str:
    return number(value) if isinstance(value, float) else escape(str(value))
