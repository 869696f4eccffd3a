"""HTML as strings: every text from outside goes through `shown`, every number through a function below."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from stopgo.mission.console.table import printable
from stopgo.mission.files.svg import clean


def shown(content: object) -> str:
    """Return text escaped for HTML and XML, in an element or between double quotes."""
    return clean(printable(str(content)))


def tag(name: str, *content: str, **attributes: Any) -> str:
    """Return an element around HTML; `class_` is the attribute class."""
    text = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{shown(value)}"' for key, value in attributes.items()
    )
    return f"<{name}{text}>{''.join(content)}</{name}>"


def row(cells: Iterable[str], *, cell: str = "td", **attributes: Any) -> str:
    """Return a row of HTML cells; cells with only a number, or its limit, are right-aligned."""
    return tag("tr", *(_cell(content, cell) for content in cells), **attributes)


def _cell(content: str, cell: str) -> str:
    return tag(cell, content, **({"class_": "number"} if _NUMBER.fullmatch(content) else {}))


_NUMBER = re.compile(r"(≤ )?[+−-]?[\d.:]+( %| mm)?( / \d+)?|-")


def grid(header: Sequence[str], rows: Iterable[str], **attributes: Any) -> str:
    """Return a table of rows that are HTML already."""
    return tag("table", tag("thead", row(header, cell="th")), tag("tbody", *rows), **attributes)


def number(value: float | None, scale: float = 1.0, *, digits: int = 1, sign: bool = False) -> str:
    """Return a number with a true minus sign; an empty string for None."""
    if value is None:
        return ""
    rounded = round(value * scale, digits) + 0.0
    return f"{rounded:{'+' if sign else ''}.{digits}f}".replace("-", "−")


def section(title: str, *content: str, **attributes: Any) -> str:
    """Return a part of the page with a heading; an empty string without content."""
    inside = "".join(content)
    return tag("section", tag("h2", shown(title)), inside, **attributes) if inside else ""


def tile(name: str, value: str, note: str = "") -> str:
    """Return one number of a page, with its name and a note."""
    return tag("div", shown(name), tag("b", shown(value)), tag("small", shown(note)), class_="tile")
