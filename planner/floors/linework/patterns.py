"""Lines of a drawing -> refusal of those that are a pattern, by counts: to find areas in them takes minutes.

Patterns are hatches of single lines, symbols, meshes and contours on a layer of walls or of areas. All
limits are far above those of buildings: architects' drawings have up to 4 m of wall lines on a m².
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.legible_text import legible
from stopgo.planner.floors.lines_and_texts import Stroke

MOST_MEETING = 300
"""Lines of walls that may end within a millimetre of one another."""
MOST_CROSSING = 300_000
"""Crossings of lines of one kind, each of two lines counted once."""
MOST_VERTICES = 20_000
"""Vertices of one line."""
MOST_M_PER_M2 = 25.0
"""Metres of wall lines on a m², in each square of CELL_M."""
CELL_M, STEP_M = 10.0, 5.0
"""Edge of such a square, and length of the pieces of lines that are counted where their middles are."""
MOST_PIECES = 500_000
"""Pieces that are counted; they are longer where the lines are longer than any building's."""
MOST_SWINGS = 10_000
"""Arcs of the leaves of doors: the largest storeys have some thousands of doors."""
SWINGING, LEAST_LEAF_M = ("doors", "openings"), 0.4
"""Roles of lines among which these arcs are, and their least extent; handles and hinges are less wide."""
AREAS = ("walls", "floor", "rooms", "columns")
"""Roles of lines that bound areas."""
SOME = 100
"""Lines of which crossings are counted first."""


def pattern_in(strokes: Sequence[Stroke]) -> str:
    """Return the fault of lines that are a pattern, and the remedy; empty if they may be a building's."""
    return next(_faults(strokes), "") or _many_doors(strokes)


def door_arcs(strokes: Sequence[Stroke]) -> int:
    """Number of arcs as wide as leaves on layers of doors, if they are more than any storey has; else 0."""
    arcs = [stroke for stroke in strokes if stroke.role in SWINGING and stroke.curved]
    if len(arcs) <= MOST_SWINGS:
        return 0
    wide = sum(bool(np.ptp(stroke.points, axis=0).max() >= LEAST_LEAF_M) for stroke in arcs)
    return wide if wide > MOST_SWINGS else 0


def _many_doors(strokes: Sequence[Stroke]) -> str:
    """Return the fault of more arcs of doors than any storey has."""
    wide = door_arcs(strokes)
    if not wide:
        return ""
    layer = legible(next(item.layer for item in strokes if item.role in SWINGING and item.curved))
    return (
        f"{wide} arcs of doors on {layer}, more than {MOST_SWINGS}, as no storey has; choose a part with "
        "--region, or export one storey"
    )


def _faults(strokes: Sequence[Stroke]) -> Iterator[str]:
    for role in AREAS:
        lines = [stroke.points for stroke in strokes if stroke.role == role and len(stroke.points) > 1]
        if not lines:
            continue
        what = f"that is a pattern, no {role}; put the {role} on a layer of their own"
        if (longest := max(map(len, lines))) > MOST_VERTICES:
            yield f"a line of {role} has {longest} vertices, more than {MOST_VERTICES}; simplify it"
        if role == "walls":
            yield from _meeting(lines)
            yield from _crowded(lines, what)
        pieces = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines])
        if cross_often(pieces):
            yield f"lines of {role} cross more than {MOST_CROSSING} times: {what}"


def _meeting(lines: Sequence[FloatArray]) -> Iterator[str]:
    """Yield the fault of very many lines that end at one place."""
    ends = np.round(np.concatenate([line[[0, -1]] for line in lines]), 3)
    places, many = np.unique(ends, axis=0, return_counts=True)
    if many.max() > MOST_MEETING:
        x, y = places[np.argmax(many)].tolist()
        yield (
            f"{many.max()} lines of walls end at ({x:.2f}, {y:.2f}), more than {MOST_MEETING}: that is a "
            "symbol, no walls; put the walls on a layer of their own"
        )


def _crowded(lines: Sequence[FloatArray], what: str) -> Iterator[str]:
    """Yield the fault of lines with very great length in a square."""
    begin = np.concatenate([line[:-1] for line in lines])
    along = np.concatenate([np.diff(line, axis=0) for line in lines])
    length = np.hypot(*along.T)
    if not (total := float(length.sum())) > MOST_M_PER_M2 * CELL_M**2:
        return
    many = np.ceil(length / max(STEP_M, total / MOST_PIECES)).astype(np.int64)
    of = np.repeat(np.arange(len(length)), many)
    place = (np.arange(len(of)) - (np.cumsum(many) - many)[of] + 0.5) / many[of]
    cells = np.floor((begin[of] + place[:, None] * along[of]) / CELL_M)
    squares, square = np.unique(cells, axis=0, return_inverse=True)
    metres = np.bincount(square.ravel(), (length / np.maximum(many, 1))[of])
    if metres.max() > MOST_M_PER_M2 * CELL_M**2:
        x, y = ((squares[np.argmax(metres)] + 0.5) * CELL_M).tolist()
        yield f"{metres.max():.0f} m of lines of walls within {CELL_M:g} m around ({x:g}, {y:g}): {what}"


def cross_often(pieces: FloatArray) -> bool:
    """True if segments (n, 2, 2) cross one another very often; counted if some of them do."""
    if len(pieces) ** 2 < 2 * MOST_CROSSING:
        return False
    segments = shapely.linestrings(pieces)
    tree, some = shapely.STRtree(segments), segments[:: max(1, len(segments) // SOME)]
    if _crossings(tree, some) * (len(segments) / len(some)) < MOST_CROSSING:
        return False
    met = 0
    for begin in range(0, len(segments), SOME):
        met += _crossings(tree, segments[begin : begin + SOME])
        if met > 2 * MOST_CROSSING:
            return True
    return False


def _crossings(tree: shapely.STRtree, segments: FloatArray) -> int:
    return int(tree.query(segments, predicate="crosses").shape[1])
