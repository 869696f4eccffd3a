"""Faces -> smooth surfaces: faces that continue each other as chords of a curve, or nearly straight."""

from __future__ import annotations

import math

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray

MOST_TURN = math.radians(25)
"""Largest turn between two faces of a smooth surface."""
LEAST_RADIUS_M = 0.14
"""Least radius of a curve along which points have a direction."""
NEAR_M = 0.14
"""Length of a face that counts for the radius at its end: that of the neighbours of a point."""


def smooth_surfaces(faces: FloatArray) -> tuple[IntArray, IntArray, BoolArray]:
    """Order of faces (m, 2, 2) in which each surface's follow each other, their first faces, and which close.

    Surfaces are in the order of their first faces. A closed one, such as a round column, begins at its first
    face in the order given, and its last face is continued by it.
    """
    after = _next_faces(faces)
    before = np.full(len(faces), -1, dtype=np.int64)
    before[after[after >= 0]] = np.flatnonzero(after >= 0)
    taken = np.zeros(len(faces), dtype=bool)
    chains: list[list[int]] = []
    for starts in (np.flatnonzero(before < 0), np.arange(len(faces))):  # then those that are closed
        chains += [_chain(start, after, taken) for start in starts.tolist() if not taken[start]]
    chains.sort(key=lambda chain: chain[0])
    order = np.array([face for chain in chains for face in chain], dtype=np.int64)
    sizes = np.array([len(chain) for chain in chains], dtype=np.int64)
    closed = np.array([before[chain[0]] >= 0 for chain in chains], dtype=bool)
    return order, np.cumsum(sizes) - sizes, closed


def _chain(start: int, after: IntArray, taken: BoolArray) -> list[int]:
    """The faces that follow a face, from itself to the last or to the one before it."""
    chain, face = [], start
    while face >= 0 and not taken[face]:
        taken[face] = True
        chain.append(face)
        face = int(after[face])
    return chain


def _next_faces(faces: FloatArray) -> IntArray:
    """The face that continues each face smoothly, or -1 (m,)."""
    after = np.full(len(faces), -1, dtype=np.int64)
    _, number, uses = np.unique(faces.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True)
    number = number.reshape(-1, 2)
    begins = np.full(len(uses), -1, dtype=np.int64)
    begins[number[:, 0]] = np.arange(len(faces))
    plain = uses[number[:, 1]] == 2  # elsewhere outlines touch
    ends = np.flatnonzero(plain & (begins[number[:, 1]] >= 0))
    follow = begins[number[ends, 1]]
    smooth = _is_smooth(faces[ends], faces[follow])
    after[ends[smooth]] = follow[smooth]
    return after


def _is_smooth(faces: FloatArray, following: FloatArray) -> BoolArray:
    """True where the next face (n, 2, 2) continues a face by a small turn of a wide curve (n,)."""
    one, two = faces[:, 1] - faces[:, 0], following[:, 1] - following[:, 0]
    cross = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    turn = np.abs(np.arctan2(cross, (one * two).sum(axis=1)))
    near = (np.minimum(np.hypot(*one.T), NEAR_M) + np.minimum(np.hypot(*two.T), NEAR_M)) / 2
    smooth: BoolArray = (turn <= MOST_TURN) & (turn * LEAST_RADIUS_M <= near)
    return smooth
