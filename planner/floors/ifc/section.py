"""Surface -> plan: the cut at a height, the projection of a band, and the faces that look up."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.ifc.model import Surface
from stopgo.planner.floors.rings import Region
from stopgo.planner.geometry.shapes import noded_lines

GRID = 1e-4
"""Sections are drawn on a grid of this many metres, so that faces which touch in the model touch."""
STRAIGHT = 2e-4
"""A corner nearer than this to the straight line is one of a triangulation."""
MOST_FACES = 6000
"""Bodies of more triangles are shown as hulls where they are projected."""
SHEET = 5e-3
"""Half of the thickness at which a face without a body is shown, metres."""
NOTHING = shapely.Polygon()


def cut(mesh: Surface, height: float) -> Region:
    """Section of a mesh with a horizontal plane at `height`.

    Triangles become directed segments; a face between them is solid if the surface winds around it, or if
    it is entered an odd number of times: so nested, overlapping and badly oriented bodies are read alike.
    """
    segments = _segments(mesh.triangles, height)
    if len(segments) < 3:
        return NOTHING
    lines = noded_lines(shapely.linestrings(segments), grid_size=GRID)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(lines).tolist()))
    solid = [face for face in faces if _inside(shapely.get_coordinates(face.point_on_surface())[0], segments)]
    return tidy(shapely.union_all(solid, grid_size=GRID)) if solid else NOTHING


def _segments(triangles: FloatArray, height: float) -> FloatArray:
    """Directed segments (k, 2, 2) on the grid where a plane meets triangles."""
    z = triangles[:, :, 2]
    above = z >= height
    crossing = above.any(axis=1) & ~above.all(axis=1)
    corners, above = triangles[crossing], above[crossing]
    following, above_next = np.roll(corners, -1, axis=1), np.roll(above, -1, axis=1)
    rise = following[..., 2] - corners[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (height - corners[..., 2]) / rise
        points = corners[..., :2] + t[..., None] * (following[..., :2] - corners[..., :2])
    up, down = ~above & above_next, above & ~above_next
    segments = np.stack([points[up], points[down]], axis=1) if len(points) else np.empty((0, 2, 2))
    segments = np.round(segments / GRID) * GRID
    return segments[(segments[:, 0] != segments[:, 1]).any(axis=1)]


def _inside(point: FloatArray, segments: FloatArray) -> bool:
    """True if directed segments wind around a point, or a ray from it meets an odd number of them."""
    a, b = segments[:, 0] - point, segments[:, 1] - point
    rising = (a[:, 1] <= 0) & (b[:, 1] > 0)
    falling = (a[:, 1] > 0) & (b[:, 1] <= 0)
    side = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    winding = int((rising & (side > 0)).sum()) - int((falling & (side < 0)).sum())
    crossings = int((rising & (side > 0)).sum()) + int((falling & (side < 0)).sum())
    return winding != 0 or crossings % 2 == 1


def same_throughout(body: Surface, low: float, high: float) -> bool:
    """True if every cut between two heights is the same: no corner lies there, and the faces are vertical."""
    z = body.triangles[..., 2]
    if ((z > low) & (z < high)).any():
        return False
    a, b, c = (body.triangles[(z.min(axis=1) <= low) & (z.max(axis=1) >= high)][:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    return bool((np.abs(normal[:, 2]) <= 1e-6 * np.linalg.norm(normal, axis=1)).all())


def tidy(region: Region) -> Region:
    """Without the corners of triangulations and slivers thinner than the grid shows."""
    whole = region.simplify(STRAIGHT)
    parts = [part for part in shapely.get_parts(whole) if part.area > GRID * part.length]
    return shapely.union_all(parts) if parts else NOTHING


def footprint(mesh: Surface, low: float, high: float, *, is_closed: bool = True) -> Region:
    """The projection of what of a mesh lies between two heights.

    What looks up within the band, and the cuts at both its ends, throw the same shadow as the whole. Bodies
    of very many faces are taken for the hulls of their pieces, which is never too little. Of a mesh that may
    be open or inside out every face counts.
    """
    if len(mesh.faces) > MOST_FACES:
        return _hulls(mesh, low, high)
    a, b, c = (mesh.triangles[:, index, :2] for index in range(3))
    u, v = b - a, c - a
    facing = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    looks_up = (facing if is_closed else np.abs(facing)) > GRID * GRID
    up = mesh.triangles[looks_up]
    lowest, highest = up[..., 2].min(axis=1), up[..., 2].max(axis=1)
    within = (lowest >= low) & (highest <= high)
    partly = ~within & (highest > low) & (lowest < high)
    pieces = [_clipped(item, low, high) for item in up[partly]]
    rings = [_as_ring(piece) for piece in pieces if len(piece) > 2]
    shapes = [*shapely.polygons(up[within][..., :2]), *map(shapely.Polygon, rings)]
    shadow = shapely.union_all([cut(mesh, low), cut(mesh, high), *shapely.make_valid(shapes)])
    return _areas(shadow if is_closed else shapely.union_all([shadow, *_sheets(mesh, low, high, shadow)]))


def _sheets(mesh: Surface, low: float, high: float, shadow: Region) -> list[Region]:
    """Upright faces that enclose nothing, as strips."""
    steps = np.linspace(low, high, 5)
    segments = np.vstack([_segments(mesh.triangles, height) for height in steps])
    if not len(segments):
        return []
    lines = shapely.linestrings(np.unique(segments, axis=0))
    alone = lines[~shapely.covers(shadow.buffer(SHEET), lines)]
    return [shapely.union_all(shapely.buffer(alone, SHEET))] if len(alone) else []


def _areas(region: Region) -> Region:
    """The polygons of a region, on the grid."""
    whole = shapely.set_precision(region, GRID)
    return tidy(shapely.union_all([part for part in shapely.get_parts(whole) if part.area > 0]))


def _hulls(mesh: Surface, low: float, high: float) -> Region:
    """The convex hull of each piece of a mesh that reaches into the band."""
    edges = mesh.faces[:, [0, 1, 2]], mesh.faces[:, [1, 2, 0]]
    a, b = (np.concatenate(edge.T) for edge in edges)
    size = len(mesh.vertices)
    _, piece = connected_components(coo_array((np.ones(len(a)), (a, b)), shape=(size, size)), directed=False)
    order = np.argsort(piece, kind="stable")
    groups = np.split(mesh.vertices[order], np.flatnonzero(np.diff(piece[order])) + 1)
    reaching = [item for item in groups if item[:, 2].max() > low and item[:, 2].min() < high]
    hulls = [shapely.MultiPoint(item[:, :2]).convex_hull for item in reaching]
    return _areas(shapely.union_all(hulls)) if hulls else NOTHING


def _as_ring(points: FloatArray) -> FloatArray:
    """The points in plan, on the grid."""
    return np.round(points[:, :2] / GRID) * GRID


def _clipped(triangle: FloatArray, low: float, high: float) -> FloatArray:
    """The part (n, 3) of a triangle between two heights."""
    below = _half(triangle, high, keep_below=True)
    return _half(below, low, keep_below=False) if len(below) else below


def _half(points: FloatArray, height: float, *, keep_below: bool) -> FloatArray:
    kept: list[FloatArray] = []
    for here, there in zip(points, np.roll(points, -1, axis=0), strict=True):
        here_in = (here[2] <= height) if keep_below else (here[2] >= height)
        there_in = (there[2] <= height) if keep_below else (there[2] >= height)
        if here_in:
            kept.append(here)
        if here_in != there_in:
            kept.append(here + (height - here[2]) / (there[2] - here[2]) * (there - here))
    return np.array(kept).reshape(-1, 3)


def upward(mesh: Surface) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Triangles (k, 3, 2) that look straight up, their heights (k,) and areas (k,)."""
    a, b, c = (mesh.triangles[:, index] for index in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    flat = (normal[:, 2] > 0.99 * length) & (length > GRID * GRID)
    chosen = mesh.triangles[flat]
    return chosen[..., :2], chosen[..., 2].mean(axis=1), length[flat] / 2


def union_of(triangles: FloatArray) -> Region:
    """The area that triangles (k, 3, 2) cover."""
    if not len(triangles):
        return NOTHING
    return tidy(shapely.union_all(shapely.polygons(np.round(triangles / GRID) * GRID), grid_size=GRID))
