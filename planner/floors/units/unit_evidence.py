"""Evidence of the length of a drawing's unit: measures of drawn objects in drawing units.

Door leaves, thickness of walls, heights of texts, texts of dimensions, areas and sides written in rooms,
furniture, and stairs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import shapely
from ezdxf.document import Drawing
from ezdxf.entities import DXFEntity

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.drawing import BROKEN_INPUT
from stopgo.planner.floors.drawn_shapes import Shape
from stopgo.planner.floors.linework.patterns import MOST_SWINGS
from stopgo.planner.floors.linework.swings import swings_of
from stopgo.planner.floors.room_words import names_a_room
from stopgo.planner.floors.strokes import sketch, stretch_of, strokes_of, word_of
from stopgo.planner.floors.units.known_sizes import furniture_in, going_of
from stopgo.planner.floors.units.room_texts import RoomSides, areas_in, sides_of
from stopgo.planner.floors.written_measures import length_in
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.geometry.side_work import SideWork

_HOUSE = 30.0
"""Curves are cut as if the drawing had this size in metres."""
_MOST = 3000
"""Walls' lines that are compared with one another: the longest."""
_BLOCK = 16
"""Lines that are compared with all others at a time."""
_SLIM = 25.0
"""Walls' faces are nearer to each other than this fraction of the drawing; lines of rooms are not."""
_NAMES = 3
"""Fewer names of rooms tell no usual distance."""
_LARGE = 5000
"""Shapes from which walls are compared in a process of their own."""
_ARCS = ("ARC", "ELLIPSE", "SPLINE")
_SOME_ARCS = 1000
"""Of so many arcs of doors the radii are measured, if there are more than any storey has."""
_LINEAR = (0, 1, 6)
"""Types of dimensions that measure a length: linear, aligned, ordinate."""


@dataclass(frozen=True)
class Dimension:
    """A dimension: the number it shows, in which unit if it says so, and the length it measures."""

    shown: float
    unit: str | None
    decimals: int
    measured: float
    """In drawing units."""


@dataclass(frozen=True)
class UnitEvidence:
    """Measures in drawing units."""

    size: tuple[float, float] = (0.0, 0.0)
    """Width and height of the floor, or of the walls."""
    bulk: float = 0.0
    """The longer side of what nearly all of their points lie in."""
    leaves: tuple[float, ...] = ()
    """Widths of door leaves."""
    across: tuple[float, ...] = ()
    """Lengths of lines across doors."""
    thickness: float | None = None
    """Usual distance between the faces of a wall."""
    text_height: float | None = None
    dimensions: tuple[Dimension, ...] = ()
    names_apart: float | None = None
    """Usual distance from the name of a dwelling's room to the next such name."""
    areas: tuple[tuple[float, float], ...] = ()
    """Areas written in rooms in m², and the rooms' areas in square drawing units."""
    sides: tuple[RoomSides, ...] = ()
    furniture: tuple[float, ...] = ()
    """Drawing units per metre by each thing of known size."""
    going: float | None = None
    """Distance between the treads of stairs."""


def evidence_in(drawing: Drawing, shapes: Sequence[Shape], *, outlined: bool) -> UnitEvidence:
    """Measures of all shapes, and of what is written on ignored layers.

    Parameters
    ----------
    outlined
        True if a layer FLOOR shows the floor.
    """
    written = [*(shape for shape in shapes if shape.is_text or shape.is_note), *_left_out(drawing, shapes)]
    extent = extent_of(shapes, "floor" if outlined else "walls")
    size = np.ptp(extent, axis=0) if len(extent) else np.zeros(2)
    walls = partial(_thickness, shapes, _bulk(extent))
    with SideWork(walls, forked=len(shapes) >= _LARGE) as thickness:
        return UnitEvidence(
            size=(float(size[0]), float(size[1])),
            bulk=_bulk(extent),
            leaves=tuple(_leaves(drawing, shapes)),
            across=tuple(_across(shapes)) if outlined else (),
            text_height=_text_height(written),
            dimensions=tuple(_dimensions(written)),
            names_apart=_names_apart(written),
            areas=tuple(areas_in(shapes, written)),
            sides=tuple(sides_of(shapes, written)),
            furniture=tuple(furniture_in(drawing)),
            going=going_of(sketch(shape for shape in shapes if shape.role == "stairs" and not shape.is_text)),
            thickness=thickness.result(),
        )


def _left_out(drawing: Drawing, shapes: Sequence[Shape]) -> Iterator[Shape]:
    """Texts and dimensions of the model space on layers that show nothing of the floor."""
    known = {id(shape.entity) for shape in shapes}
    for entity in drawing.modelspace():
        shape = Shape(entity, "0", "ignore")
        if id(entity) not in known and (shape.is_text or shape.is_note):
            yield shape


def _bulk(points: FloatArray) -> float:
    """A single stray line does not count."""
    if not len(points):
        return 0.0
    low, high = np.percentile(points, [5, 95], axis=0)
    return float((high - low).max()) or float(np.ptp(points, axis=0).max())


def extent_of(shapes: Sequence[Shape], role: str) -> FloatArray:
    """Points (n, 2) of the shapes of a role; of all where the role is walls and none is known."""
    drawn = [shape for shape in shapes if not (shape.is_text or shape.is_note)]
    sketched = sketch(shape for shape in drawn if shape.role == role)
    if not sketched and role == "walls":
        sketched = sketch(drawn)
    return np.vstack(sketched) if sketched else np.empty((0, 2))


def _across(shapes: Sequence[Shape]) -> Iterator[float]:
    lines = sketch(shape for shape in shapes if shape.role == "doors" and shape.entity.dxftype() == "LINE")
    for line in lines:
        width = float(np.hypot(*(line[-1] - line[0])))
        if width > 0:
            yield width


def _leaves(drawing: Drawing, shapes: Sequence[Shape]) -> list[float]:
    """Radii of swings on layers of doors; elsewhere, of those whose leaf is drawn."""
    known = _leaves_found(drawing)
    for roles, drawn_leaf in ((("doors", "openings"), False), (("windows", "walls", "other"), True)):
        own = [shape for shape in shapes if shape.role in roles and not (shape.is_text or shape.is_note)]
        key = (drawn_leaf, *(id(shape.memo) for shape in own))
        if key not in known:
            known[key] = _leaf_radii(own, drawn_leaf=drawn_leaf)
        if known[key]:
            return known[key]
    return []


@instance_cached
def _leaves_found(drawing: Drawing) -> dict[tuple[int, ...], list[float]]:
    """Radii by the shapes that were searched: trials of layers search the same ones."""
    return {}


def _leaf_radii(own: Sequence[Shape], *, drawn_leaf: bool) -> list[float]:
    sketched = sketch(own)
    size = _bulk(np.vstack(sketched)) if sketched else 0.0
    if not size:
        return []
    scale = _HOUSE / size
    strokes, _, _ = strokes_of(_some_arcs(own), scale=scale, chord=1e9)
    found = swings_of([stroke.points for stroke in strokes], width=(0.0, np.inf), drawn_leaf=drawn_leaf)
    return [swing.radius / scale for swing in found]


def _some_arcs(shapes: Sequence[Shape]) -> Sequence[Shape]:
    """All shapes, or of more arcs than any storey has some, evenly, with the other shapes."""
    arcs = [k for k, shape in enumerate(shapes) if shape.entity.dxftype() in _ARCS]
    if len(arcs) <= MOST_SWINGS:
        return shapes
    left_out = set(arcs).difference(arcs[:: len(arcs) // _SOME_ARCS])
    return [shape for k, shape in enumerate(shapes) if k not in left_out]


def _thickness(shapes: Sequence[Shape], size: float) -> float | None:
    """The median, by length, of distances between walls' lines and the next parallel ones."""
    lines = sketch(
        shape for shape in shapes if shape.role == "walls" and not (shape.is_text or shape.is_note)
    )
    pieces = [np.stack([line[:-1], line[1:]], axis=1) for line in lines if 1 < len(line) < 200]
    if not pieces or not size:
        return None
    segments = np.concatenate(pieces)
    lengths = np.hypot(*(segments[:, 1] - segments[:, 0]).T)
    order = np.argsort(-lengths, kind="stable")[:_MOST]
    order = order[lengths[order] > size / 200]
    blocks = np.array_split(segments[order], -(-len(order) // _BLOCK)) if len(order) else []
    apart = np.concatenate([np.empty(0), *(_next_parallel(block, segments[order]) for block in blocks)])
    slim = apart < size / _SLIM
    if np.count_nonzero(slim) < 4 or lengths[order][slim].sum() < 0.5 * lengths[order].sum():
        return None
    found, weight = apart[slim], lengths[order][slim]
    rank = np.argsort(found, kind="stable")
    return float(found[rank][np.searchsorted(np.cumsum(weight[rank]), weight.sum() / 2)])


def _next_parallel(segments: FloatArray, others: FloatArray) -> FloatArray:
    """Distance from each segment (n, 2, 2) to the next line that runs along at least half of it.

    Infinite where there is none.
    """
    along = segments[:, 1] - segments[:, 0]
    length = np.hypot(*along.T)[:, None]
    along = along / length
    out = np.column_stack([-along[:, 1], along[:, 0]])
    ends = [others[:, k][None] - segments[:, None, 0] for k in (0, 1)]
    t, u = (np.einsum("nmd,nd->nm", end, along) for end in ends)
    off, gap = (np.einsum("nmd,nd->nm", end, out) for end in ends)
    beside = np.minimum(np.maximum(t, u), length) - np.maximum(np.minimum(t, u), 0.0) >= length / 2
    parallel = np.abs(off - gap) <= 0.02 * length
    away = np.abs(off + gap) / 2
    found: FloatArray = np.where(beside & parallel & (away > 1e-4 * length), away, np.inf).min(axis=1)
    return found


def _text_height(shapes: Sequence[Shape]) -> float | None:
    heights = [height for shape in shapes if shape.is_text for height in _heights(shape)]
    return float(np.median(heights)) if heights else None


def _heights(shape: Shape) -> Iterator[float]:
    name = "char_height" if shape.kind == "MTEXT" else "height"
    try:
        height = float(shape.entity.dxf.get(name, 0.0)) * stretch_of(shape.matrix)
    except BROKEN_INPUT:
        return
    if np.isfinite(height) and height > 0:
        yield height


def _names_apart(shapes: Iterable[Shape]) -> float | None:
    """The median distance between names of dwellings' rooms; None for fewer than three."""
    places = []
    for shape in shapes:
        if shape.is_text:
            try:
                word = word_of(shape, scale=1.0)
            except BROKEN_INPUT:
                continue
            if word.at and names_a_room(word.text, at_home=True):
                places.append(word.at[0])
    xy = np.unique(np.array(places).reshape(-1, 2), axis=0)
    if len(xy) < _NAMES:
        return None
    points = shapely.points(xy)
    _, away = shapely.STRtree(points).query_nearest(
        points, exclusive=True, return_distance=True, all_matches=False
    )
    return float(np.median(away))


def _dimensions(shapes: Iterable[Shape]) -> Iterator[Dimension]:
    for shape in shapes:
        if shape.kind != "DIMENSION":
            continue
        try:
            found = _dimension(shape.entity, stretch_of(shape.matrix))
        except BROKEN_INPUT:
            continue
        if found is not None:
            yield found


def _dimension(entity: DXFEntity, stretch: float) -> Dimension | None:
    if (int(entity.dxf.get("dimtype", 0)) & 7) not in _LINEAR:
        return None
    measured = float(entity.get_measurement()) * stretch  # type: ignore[attr-defined]
    text = str(entity.dxf.get("text", "") or "")
    if text in ("", "<>"):
        text = _rendered(entity)
    found = length_in(text)
    if found is None or not (np.isfinite(measured) and measured > 0 and found[0] > 0):
        return None
    return Dimension(*found, measured)


def _rendered(entity: DXFEntity) -> str:
    """The text of a dimension's own block: what a person reads."""
    block = entity.get_geometry_block()  # type: ignore[attr-defined]
    texts = [item for item in block or () if item.dxftype() in ("MTEXT", "TEXT")]
    if len(texts) != 1:
        return ""
    item = texts[0]
    return str(item.plain_text() if hasattr(item, "plain_text") else item.dxf.text)
