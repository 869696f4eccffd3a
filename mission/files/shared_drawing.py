"""Routes of several missions that share a floor: each with its letter, colour and kind of line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from stopgo.mission.document import Mission
from stopgo.mission.files import route_drawing
from stopgo.mission.files.route_drawing import stops
from stopgo.mission.files.sheet import PaperSheet

COLOURS = ("#5a2ca0", "#b34700", "#00695c", "#a3005c", "#1f5fa8", "#5d5000")
DASHES = ("", "4 1.2", "0.9 0.9", "5 1 0.9 1", "2.2 0.8", "5 1 0.9 1 0.9 1")


def letter(number: int) -> str:
    """A, B, … Z, AA, AB, … for 0, 1, …"""
    return (letter(number // 26 - 1) if number >= 26 else "") + chr(ord("A") + number % 26)


def line_of(number: int) -> dict[str, object]:
    """The line of the mission of this number."""
    dash = DASHES[number % len(DASHES)]
    line: dict[str, object] = {"stroke": COLOURS[number % len(COLOURS)], "stroke_width": 0.5}
    return line | ({"stroke_dasharray": dash} if dash else {})


def back(number: int) -> dict[str, object]:
    """Return the line of its return leg: the same, and thinner."""
    return line_of(number) | {"stroke_width": 0.22}


def shared_routes(missions: Sequence[Mission], sheet: PaperSheet) -> Iterator[str]:
    """Draw the legs of every mission; return legs are thin."""
    for k, mission in enumerate(missions):
        yield from route_drawing.route(
            mission, sheet, way=line_of(k), back_way=back(k), after=f"-{letter(k)}"
        )


def shared_stops(missions: Sequence[Mission], sheet: PaperSheet) -> Iterator[str]:
    """Every start once, then the stops of every mission with its letter."""
    seen = set()
    for k, mission in enumerate(missions):
        start, *marks = stops(mission, sheet, letter=letter(k))
        if start not in seen:
            seen.add(start)
            yield start
        yield from marks
