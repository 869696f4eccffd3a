"""Lengths and areas that texts of a drawing give, such as `2.50 m`, `12'6"`, `30 m²` and `3.2m x 4m`."""

from __future__ import annotations

import re

FOOT = 0.3048
LENGTHS = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254, "ft": FOOT}
_SUFFIX = {"MM": "mm", "CM": "cm", "M": "m", "IN": "in", '"': "in", "FT": "ft", "'": "ft"}
_NUMBER = r"(\d+(?:[.,]\d+)?)"
_PLAIN = re.compile(rf"^\s*{_NUMBER}\s*(MM|CM|M|IN|FT|\"|')?\s*$", re.IGNORECASE)
_FEET = re.compile(rf"^\s*(\d+)'\s*-?\s*(?:{_NUMBER}(?:\s+(\d+)/(\d+))?\s*\")?\s*$")
_AREA = re.compile(
    rf"{_NUMBER}\s*(m2|m²|m\^2|qm|sqm|sq\.?\s?m|sq\.?\s?ft|sf|ft2|ft²)(?![a-z0-9])", re.IGNORECASE
)

_SIDE = r"""\d+(?:[.,]\d+)?\s*(?:mm|cm|m|ft|in|'|")(?:\s*-?\s*\d+(?:[.,]\d+)?\s*")?"""
_SIDES = re.compile(rf"(?<![\w.,])({_SIDE})\s*[x×*]\s*({_SIDE})(?![\w])", re.IGNORECASE)
_LEAST_SIDE, _LEAST_AREA = 1.0, 4.0
"""Written sides of less than these, in m and m², are those of doors, windows and furniture."""
_LETTERS = re.compile(r"[^\W\d_]{2}")


def length_in(text: str) -> tuple[float, str | None, int] | None:
    """The number in a dimension's text, its unit if the text names one, and its decimals."""
    feet = _FEET.match(text)
    if feet and feet.group(2):
        whole, inches, over, under = feet.groups()
        part = int(over) / int(under) if over and int(under) else 0.0
        return int(whole) * 12 + float(inches.replace(",", ".")) + part, "in", 0
    plain = _PLAIN.match(text)
    if plain is None:
        return None
    number, suffix = plain.groups()
    decimals = len(re.split("[.,]", number)[1]) if re.search("[.,]", number) else 0
    return float(number.replace(",", ".")), _SUFFIX.get((suffix or "").upper()), decimals


def area_in(text: str) -> float | None:
    """The area in m² that a text names, such as `30 m²` or `12'6" x 10'`; None if it names none."""
    found = _AREA.search(text)
    if found is None:
        return _area_of_sides(text)
    value = float(found.group(1).replace(",", "."))
    return value * FOOT**2 if "f" in found.group(2).lower() else value


def _area_of_sides(text: str) -> float | None:
    sides = sides_in(text)
    return sides[0] * sides[1] if sides is not None else None


def sides_in(text: str) -> tuple[float, float] | None:
    """The sides in metres that a text gives for a room, each with its unit, such as `12'6" x 10'`."""
    found = _SIDES.search(text.replace("''", '"').replace("’", "'").replace("”", '"'))
    sides = [length_in(side.strip()) for side in found.groups()] if found else []
    metres = [LENGTHS[side[1]] * side[0] for side in sides if side is not None and side[1]]
    if len(metres) < 2 or min(metres) < _LEAST_SIDE or metres[0] * metres[1] < _LEAST_AREA:
        return None
    return metres[0], metres[1]


def is_only_area(text: str) -> bool:
    """Return True if a text names an area and nothing else: it is next to a room's name, or alone."""
    return area_in(text) is not None and not _LETTERS.search(_SIDES.sub("", _AREA.sub("", text)))
