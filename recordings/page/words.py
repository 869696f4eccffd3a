"""HTML as strings: every text from outside goes through `shown`, every number through one of these."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from stopgo.mission.console.table import printable
from stopgo.mission.files.svg import clean


def shown(content: object) -> str:
    """Text as HTML and XML may hold it, in an element or between double quotes."""
    return clean(printable(str(content)))


def tag(name: str, *content: str, **attributes: Any) -> str:
    """An element around HTML; `class_` stands for class."""
    told = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{shown(value)}"' for key, value in attributes.items()
    )
    return f"<{name}{told}>{''.join(content)}</{name}>"


def row(cells: Iterable[str], *, cell: str = "td", **attributes: Any) -> str:
    """A row of HTML cells; those that read as numbers are set to the right."""
    return tag("tr", *(_cell(content, cell) for content in cells), **attributes)


def _cell(content: str, cell: str) -> str:
    return tag(cell, content, **({"class_": "number"} if _NUMBER.fullmatch(content) else {}))


_NUMBER = re.compile(r"[+−]?[\d.:]+( %| mm)?( / \d+)?")


def grid(header: Sequence[str], rows: Iterable[str], **attributes: Any) -> str:
    """A table of rows that are HTML already."""
    return tag("table", tag("thead", row(header, cell="th")), tag("tbody", *rows), **attributes)


def number(value: float | None, scale: float = 1.0, *, digits: int = 1, sign: bool = False) -> str:
    """A number, empty where there is none, with a true minus sign."""
    if value is None:
        return ""
    rounded = round(value * scale, digits) + 0.0
    return f"{rounded:{'+' if sign else ''}.{digits}f}".replace("-", "−")


def section(title: str, *content: str, **attributes: Any) -> str:
    """A headed part of the page; nothing where there is nothing to head."""
    inside = "".join(content)
    return tag("section", tag("h2", shown(title)), inside, **attributes) if inside else ""


def tile(name: str, value: str, note: str = "") -> str:
    """One number of a page, with its name and a note."""
    return tag("div", shown(name), tag("b", shown(value)), tag("small", shown(note)), class_="tile")
