"""Straight pieces of shortest paths between nodes of a mesh, of which most are corners of its region.

A path that bends at a corner passes by it: both sides of the corner lie on the same side of the piece. So
from a corner only the directions past its sides are searched, and of other corners only those are found that
are passed by too. A piece between a corner and a point off the corners is found from the point.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.shapes import to_grid
from stopgo.planner.routing.tangent_kernel import pieces
from stopgo.planner.visibility.sight.mesh import Mesh, containing

LARGE = 10_000_000
"""Views × mesh triangles from which on the interpreted kernel takes seconds."""
ROOM = 16
"""Nodes per view for which there is room at first."""


def straight_pieces(
    mesh: Mesh, nodes: FloatArray, corners: IntArray, sides: FloatArray, *, between_corners: bool = True
) -> IntArray:
    """Pairs (m, 2) of nodes (n, 2), local metres, between which a piece may lead; some are there repeatedly.

    The nodes `corners` (c,) are vertices of the mesh. Their `sides` (c, 2, 2) are the vectors to the previous
    and to the next corner, zero where a path may pass in any direction. Pieces between two corners that have
    sides are left out unless `between_corners`.
    """
    at, to_sides = to_grid(nodes), to_grid(sides)
    looking = to_sides.any(axis=(1, 2))
    bent = corners[looking]
    all_round = np.setdiff1d(np.arange(len(nodes)), bent)
    looking &= between_corners
    bent = bent[: np.count_nonzero(looking)]
    viewer = np.concatenate([all_round, bent, bent])
    right, left = limits_of(at[bent], to_sides[looking])
    number = len(mesh.vertices) + np.arange(len(right))
    unlimited = np.full(len(all_round), -1)
    vertices = np.concatenate([mesh.vertices, right, left])
    point, triangle = containing(mesh, at)
    arrays = [
        *(viewer, at[:, 0], at[:, 1], np.searchsorted(point, np.arange(len(nodes) + 1)), triangle),
        *(np.concatenate([unlimited, number]), np.concatenate([unlimited, number + len(right)])),
        *(vertices[:, 0], vertices[:, 1], mesh.corners.ravel(), mesh.neighbour.ravel()),
        *_at_vertices(mesh, at, corners, to_sides),
        *_in_triangles(mesh, *_off_corners(point, triangle, corners)),
    ]
    return _found(arrays, len(all_round), mesh.triangles)


def limits_of(corners: IntArray, sides: IntArray) -> tuple[IntArray, IntArray]:
    """Points right and left of the two views from each corner (2 n, 2), those of all first views first.

    A path that passes by a corner leaves it between one of its sides and the extension of the other.
    """
    back, on = sides[:, 0], sides[:, 1]
    right = np.concatenate([corners + on, corners - on])
    return right, np.concatenate([corners - back, corners + back])


def _at_vertices(mesh: Mesh, at: IntArray, corners: IntArray, sides: IntArray) -> list[IntArray]:
    """The node at each vertex of the mesh, or -1, and the coordinates of both of its sides."""
    keys, wanted = (xy[:, 0] * 2**31 + xy[:, 1] for xy in (mesh.vertices, at[corners]))
    vertex = np.searchsorted(keys, wanted)
    node = np.full(len(mesh.vertices), -1)
    node[vertex] = corners
    of_vertex = np.zeros((len(mesh.vertices), 4), dtype=np.int64)
    of_vertex[vertex] = sides.reshape(-1, 4)
    return [node, *of_vertex.T]


def _off_corners(point: IntArray, triangle: IntArray, corners: IntArray) -> tuple[IntArray, IntArray]:
    """Those pairs of a node and a triangle whose node is no corner."""
    off = ~np.isin(point, corners)
    return point[off], triangle[off]


def _in_triangles(mesh: Mesh, item: IntArray, triangle: IntArray) -> list[IntArray]:
    """The begin of each triangle's nodes (t + 1,), and these nodes."""
    order = np.argsort(triangle, kind="stable")
    return [np.searchsorted(triangle[order], np.arange(mesh.triangles + 1)), item[order]]


def _found(arrays: list[IntArray], all_round: int, triangles: int) -> IntArray:
    """Call the kernel, again with more room for its output whenever it runs out."""
    given: list[Any] = [np.ascontiguousarray(array, dtype=np.int64) for array in arrays]
    rows = len(given[0])
    sizes = rows + 1, 4 * (2 * triangles + 16), 4096 + ROOM * rows
    scratch: list[Any] = [np.zeros(size, dtype=np.int64) for size in sizes]
    kernel: Any = compiled(pieces, large=rows * triangles > LARGE)
    if kernel is None:
        kernel, given, scratch = pieces, *([a.tolist() for a in part] for part in (given, scratch))
    pointer, stack, out = scratch
    done = kernel(0, all_round, *given, pointer, stack, out)
    while done < rows:
        out = [*out, *out] if isinstance(out, list) else np.concatenate([out, out])
        done = kernel(done, all_round, *given, pointer, stack, out)
    seen = np.array(out[: pointer[-1]], dtype=np.int64)
    return np.stack([np.repeat(arrays[0], np.diff(pointer)), seen], axis=1)
