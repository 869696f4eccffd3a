"""Finds where walls are open: at door swings, at doors' symbols, between walls' ends that face each other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.floors.linework.groups import groups_of
from stopgo.planner.floors.linework.patterns import cross_often
from stopgo.planner.floors.linework.swings import Leaf, Swing, paired, swings_of, swings_with_lines
from stopgo.planner.floors.linework.walls import SolidWalls, caps_of
from stopgo.planner.floors.rings import Region
from stopgo.planner.geometry.shapes import noded_lines

PASSAGE = (0.6, 1.6)
"""Ends of walls that face each other this far apart (m) leave a passage."""
_ASIDE = 0.1
"""Ends that face each other lie this little, in metres, beside each other's line …"""
_FARTHEST = PASSAGE[1] + 2 * _ASIDE
"""… and so no farther apart than this."""
SYMBOL = (0.5, 6.0)
"""Length in metres of a door's symbol without a swing, such as a sliding door."""
_BROAD = 0.4
"""A shape broader than this (m), such as the area of an open garage door, is not a line across."""
_REACH = 0.3
"""Frames may keep a leaf this far (m) from its jamb."""
_DRAWN_OPEN = 0.6
"""Where a leaf is drawn speaks against its being shut there as much as a wall this far (m) away."""
_FLUSH = 0.08
_WHOLE = 0.8
_JAMB = (0.03, 0.08, 0.15, 0.3)
_DEEPEST = 0.8
"""A wall deeper than this (m) at a jamb runs along the opening's side."""
_TOUCH = 0.02


@dataclass(frozen=True, eq=False)
class WallGap:
    """A place where a wall is open: the line across it and how deep the wall is there, in metres."""

    kind: str
    """`door`, `passage`, or `opening` where only its position shows a door or a window."""
    line: FloatArray
    """From jamb to jamb in the middle of the wall (2, 2)."""
    depth: float
    held: bool
    """True if walls are at both its ends."""

    @property
    def opening(self) -> shapely.Polygon:
        """The place where no wall stands."""
        return shapely.LineString(self.line).buffer(self.depth / 2 + 1e-3, cap_style="flat")

    @property
    def place(self) -> shapely.Polygon:
        """The floor between the jambs, a little beyond them."""
        a, b = self.line
        along = 0.01 * (b - a) / np.hypot(*(b - a))
        return shapely.LineString([a - along, b + along]).buffer(self.depth / 2 + 1e-3, cap_style="flat")


def gaps_of(
    doors: Sequence[FloatArray],
    openings: Sequence[FloatArray],
    others: Sequence[FloatArray],
    walls: SolidWalls,
) -> list[WallGap]:
    """Gaps at swings and symbols.

    Parameters
    ----------
    doors, openings
        Polylines (n, 2) of layers of doors, and of layers that hold doors and windows alike.
    others
        Polylines among which only swings that close a gap of a wall count.
    """
    shape = walls.shape
    tree = _Near(shape)
    drawn = [*doors, *openings]
    swings = swings_of([*drawn, *_merged(drawn)])
    found = list(_at_swings(swings, drawn, tree))
    known = {tuple(np.round(swing.hinge, 2)) for swing in swings}
    foreign = [
        item for item in swings_of([*others, *_merged(others)]) if tuple(np.round(item.hinge, 2)) not in known
    ]
    found += [gap for gap in _at_swings(foreign, others, tree) if gap.held]
    taken = shapely.union_all([swing_area(swing) for swing in swings])
    found += _at_symbols(doors, taken, tree, kind="door")
    found += _at_symbols(openings, taken, tree, kind="opening")
    return _apart(found)


def without_doors(lines: Sequence[FloatArray]) -> tuple[list[FloatArray], list[FloatArray]]:
    """The lines of walls without door swings that were drawn among them, and these with their leaves."""
    swings = swings_with_lines(lines)
    if not swings:
        return list(lines), []
    drawn = {id(line) for line, _ in swings}
    ends = np.array([(swing.hinge, end) for _, swing in swings for end in swing.ends])
    leaves = [line for line in lines if len(line) == 2 and _is_leaf(line, ends)]
    apart = drawn | set(map(id, leaves))
    return [line for line in lines if id(line) not in apart], [line for line in lines if id(line) in apart]


def _is_leaf(line: FloatArray, leaves: FloatArray) -> bool:
    """True if a line goes along one of the leaves (n, 2, 2), or back, within 2 cm."""
    off = [np.abs(leaves - ends).max(axis=(1, 2)).min() for ends in (line, line[::-1])]
    return bool(min(off) <= _TOUCH)


class _Near:
    """Asks what of the walls is near a line."""

    def __init__(self, shape: Region) -> None:
        self._parts = shapely.get_parts(shape)
        self._tree = shapely.STRtree(self._parts)

    def around(self, shape: Region, reach: float) -> Region:
        """The walls within `reach` metres of a shape's bounds."""
        x0, y0, x1, y1 = shape.bounds
        box = shapely.box(x0 - reach, y0 - reach, x1 + reach, y1 + reach)
        near = self._parts[self._tree.query(box, predicate="intersects")]
        return shapely.union_all(shapely.intersection(near, box))


def swing_area(swing: Swing) -> Region:
    """All that a swinging leaf is drawn within."""
    return shapely.MultiPoint([swing.hinge, *swing.ends]).convex_hull.buffer(0.3 * swing.radius)


def _merged(lines: Iterable[FloatArray]) -> list[FloatArray]:
    """Chains of single segments as one polyline each: swings that somebody exploded; none in a pattern."""
    short = [line for line in lines if len(line) == 2 and not (line[0] == line[1]).all()]
    if len(short) < 3 or cross_often(np.array(short)):
        return []
    chains = shapely.get_parts(shapely.line_merge(noded_lines(shapely.linestrings(short), grid_size=1e-4)))
    return [xy for xy in map(shapely.get_coordinates, chains) if len(xy) > 3]


def _at_swings(swings: Sequence[Swing], drawn: Sequence[FloatArray], walls: _Near) -> Iterator[WallGap]:
    leaves = _Strokes(drawn)
    for door in paired([_leaf(swing, leaves, walls) for swing in swings]):
        line = np.array([door[0].hinge, door[1].hinge if len(door) > 1 else door[0].shut])
        yield _placed(line, "door", walls, reach=_REACH)


class _Strokes:
    """Asks whether a straight stroke is drawn from a hinge to the end of a swing."""

    def __init__(self, drawn: Sequence[FloatArray]) -> None:
        pieces = [np.stack([line[:-1], line[1:]], axis=1) for line in drawn if len(line) > 1]
        self._segments = np.concatenate(pieces) if pieces else np.empty((0, 2, 2))

    def along(self, a: FloatArray, b: FloatArray) -> bool:
        """True if one segment runs along most of the line from `a` to `b`, within 8 cm."""
        direction = b - a
        length = float(np.hypot(*direction))
        direction = direction / length
        out = np.array([-direction[1], direction[0]])
        t = (self._segments - a) @ direction
        off = np.abs((self._segments - a) @ out).max(axis=1)
        covered = np.minimum(t.max(axis=1), length) - np.maximum(t.min(axis=1), 0.0)
        return bool(((off <= 0.08) & (covered >= 0.8 * length)).any())


def _leaf(swing: Swing, leaves: _Strokes, walls: _Near) -> Leaf:
    """End of a swing at which the door is shut: walls go on beyond hinge and edge, and no leaf is drawn."""
    near = walls.around(shapely.MultiPoint([swing.hinge, *swing.ends]), 0.5)
    drawn = [leaves.along(swing.hinge, end) for end in swing.ends]
    away = [_to_walls(swing.hinge, end, near) for end in swing.ends]
    if drawn[0] != drawn[1]:
        away[drawn.index(True)] += _DRAWN_OPEN
    shut = 0 if away[0] <= away[1] else 1
    return Leaf(swing.hinge, swing.ends[shut], swing.ends[1 - shut])


def _to_walls(hinge: FloatArray, end: FloatArray, near: Region) -> float:
    """Distance of walls beyond both ends of a shut leaf, at most 0.5 m each; more if it runs in walls."""
    direction = (end - hinge) / np.hypot(*(end - hinge))
    beyond = [
        shapely.LineString([end - 0.02 * direction, end + 0.5 * direction]),
        shapely.LineString([hinge + 0.02 * direction, hinge - 0.5 * direction]),
    ]
    beside = near.buffer(_FLUSH)  # hinges may stand off the wall's face
    away = 0.0
    for ray in beyond:
        hit = ray.intersection(beside)
        away += 0.5 if hit.is_empty else float(hit.distance(shapely.Point(ray.coords[0])))
    inner = shapely.LineString([hinge + 0.1 * direction, end - 0.1 * direction])
    blocked = float(inner.intersection(near.buffer(-0.01)).length / inner.length)
    return away + (0.5 * blocked if blocked < _WHOLE else 0.1)  # or drawn over a wall that goes on


def _placed(line: FloatArray, kind: str, walls: _Near, *, reach: float) -> WallGap:
    """The gap that a line across a wall's opening stands for: moved into the wall, from jamb to jamb."""
    near = walls.around(shapely.LineString(line), 1.0)
    a, b = line
    direction = (b - a) / np.hypot(*(b - a))
    out = np.array([-direction[1], direction[0]])
    depths = [_depth(a, -direction, out, near), _depth(b, direction, out, near)]
    known = [depth for depth in depths if depth is not None]
    low, high = _common(known)
    middle = line + out * (low + high) / 2
    trimmed, held = _trimmed(middle, direction, near, reach)
    return WallGap(kind, trimmed, max(high - low, 0.05), held)


def _depth(
    end: FloatArray, direction: FloatArray, out: FloatArray, near: Region
) -> tuple[float, float] | None:
    """Extent of a wall across the line at a jamb, in metres to the line's left; None if there is no wall."""
    for step in _JAMB:
        at = end + step * direction
        probe = shapely.LineString([at - out * _DEEPEST, at + out * _DEEPEST])
        for part in shapely.get_parts(probe.intersection(near)):
            if part.is_empty:
                continue
            t = (shapely.get_coordinates(part) - at) @ out
            low, high = float(t.min()), float(t.max())
            if low <= 0.12 and high >= -0.12 and high - low < _DEEPEST:
                return low, high
    return None


def _common(depths: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Extent of the walls of both jambs; if they do not overlap, of the one nearest the line."""
    if not depths:
        return -0.05, 0.05
    low, high = max(d[0] for d in depths), min(d[1] for d in depths)
    return (low, high) if low < high else min(depths, key=lambda d: (abs(d[0] + d[1]), d))


def _trimmed(line: FloatArray, direction: FloatArray, near: Region, reach: float) -> tuple[FloatArray, bool]:
    """The line between walls at most `reach` beyond its ends; and whether there are walls at both."""
    a, b = line
    middle = shapely.Point((a + b) / 2)
    whole = shapely.LineString([a - reach * direction, b + reach * direction])
    free = [part for part in shapely.get_parts(whole.difference(near)) if part.length > 0.2]
    if not free:
        return line, bool(near.covers(whole))  # a door drawn over a wall that goes on below it
    piece = min(free, key=lambda part: (round(float(part.distance(middle)), 6), -part.length))
    ends = shapely.get_coordinates(piece)[[0, -1]]
    if (ends[1] - ends[0]) @ direction < 0:
        ends = ends[::-1]
    limits = [
        float((ends[0] - whole.coords[0]) @ direction) > 1e-6,
        float((whole.coords[-1] - ends[1]) @ direction) > 1e-6,
    ]
    kept = [ends[k] if limits[k] else line[k] for k in (0, 1)]
    return np.array(kept), all(limits)


def _at_symbols(lines: Sequence[FloatArray], taken: Region, walls: _Near, *, kind: str) -> Iterator[WallGap]:
    """Gaps at symbols that show no swing: a line across, or what is drawn of a sliding or folding door."""
    for group in groups_of(lines, within=_TOUCH):
        shape = shapely.union_all([shapely.LineString(line) for line in group if len(line) > 1])
        if shape.is_empty or shape.intersects(taken):
            continue
        line, breadth = _middle_line(shape)
        length = float(np.hypot(*(line[1] - line[0])))
        if not SYMBOL[0] <= length <= SYMBOL[1] or breadth > _BROAD:
            continue
        gap = _placed(line, kind, walls, reach=max(_REACH, 0.6 * length))
        wide = float(np.hypot(*(gap.line[1] - gap.line[0])))
        if gap.held and wide >= SYMBOL[0]:
            yield gap


def _middle_line(shape: Region) -> tuple[FloatArray, float]:
    """The longer middle line (2, 2) of the smallest rectangle around a shape, and the rectangle's breadth."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shape))
    if len(corners) < 5:
        return corners[[0, 1]], 0.0
    middles = (corners[:4] + corners[1:5]) / 2
    one, other = middles[[0, 2]], middles[[1, 3]]
    sizes = [float(np.hypot(*(line[1] - line[0]))) for line in (one, other)]
    return (one, sizes[1]) if sizes[0] >= sizes[1] else (other, sizes[0])


def _apart(gaps: Sequence[WallGap]) -> list[WallGap]:
    """Without gaps that lie in one found before."""
    kept: list[WallGap] = []
    for gap in gaps:
        middle = shapely.LineString(gap.line).interpolate(0.5, normalized=True)
        if not any(shapely.dwithin(other.place, middle, 0.1) for other in kept):
            kept.append(gap)
    return kept


def passages_of(walls: SolidWalls, known: Sequence[WallGap], closed: Region) -> list[WallGap]:
    """Gaps between walls' ends that face each other, where nothing known or `closed` (windows) lies."""
    middles, directions, widths = caps_of(shapely.union_all(list(walls.solids)))
    shape = walls.shape
    taken = shapely.union_all([gap.place.buffer(0.05) for gap in known])
    found: list[WallGap] = []
    for k, other in _facing(middles, directions):
        line = np.array([middles[k], middles[other]])
        between = shapely.LineString(
            [middles[k] + 0.01 * directions[k], middles[other] + 0.01 * directions[other]]
        )
        if not (between.intersects(shape) or between.intersects(taken) or between.intersects(closed)):
            found.append(WallGap("passage", line, float(min(widths[k], widths[other])), held=True))
    return found


def _facing(middles: FloatArray, directions: FloatArray) -> Iterator[tuple[int, int]]:
    """Pairs of ends that look at each other across a passage, the nearest first, each end once."""
    if len(middles) < 2:
        return
    one, other = _near_pairs(middles)
    across = middles[other] - middles[one]
    ahead, back = (np.einsum("ij,ij->i", sign * across, directions[k]) for sign, k in ((1, one), (-1, other)))
    turns = (across[:, 0] * directions[k, 1] - across[:, 1] * directions[k, 0] for k in (one, other))
    aside = np.maximum(*map(np.abs, turns))
    facing = (np.einsum("ij,ij->i", directions[one], directions[other]) < -0.95) & (aside <= _ASIDE)
    for way in (ahead, back):
        facing &= (way >= PASSAGE[0]) & (way <= PASSAGE[1])
    one, other, ahead = one[facing], other[facing], ahead[facing]
    used: set[int] = set()
    for k in np.lexsort((other, one, ahead)).tolist():
        pair = int(one[k]), int(other[k])
        if not used & set(pair):
            used |= set(pair)
            yield pair


def _near_pairs(middles: FloatArray) -> tuple[IntArray, IntArray]:
    """Pairs of ends no farther apart than a passage's, the lower index first: all pairs take memory."""
    points = shapely.points(middles)
    one, other = shapely.STRtree(points).query(points, predicate="dwithin", distance=_FARTHEST)
    return one[one < other], other[one < other]
