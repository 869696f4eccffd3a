"""Lines and texts of a drawing, in metres: what floors are made of, from whatever file."""

from __future__ import annotations

from dataclasses import dataclass

from stopgo.mission.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class Stroke:
    """A polyline (n, 2) in metres on a layer; a `closed` one need not repeat its first point."""

    points: FloatArray
    layer: str
    role: str
    closed: bool = False
    curved: bool = False
    """Drawn as one arc."""
    fill: bool = False
    """One boundary of a hatch: counter-clockwise around what is filled, clockwise around a hole."""
    global_id: str | None = None


@dataclass(frozen=True, eq=False)
class Word:
    """A text, and its possible positions: the insertion point and the alignment point.

    A dimension or another note is a word without text.
    """

    text: str
    layer: str
    role: str
    at: tuple[tuple[float, float], ...] = ()
