"""Meshes of open space, as one process sends them to another."""

from __future__ import annotations

import pickle

import numpy as np
from shapely.geometry import box

from stopgo.planner.visibility.sight.mesh import containing, mesh_of

POINTS = np.array([[10, 10], [90, 40], [500, 500]])


def test_pickled_mesh_leaves_its_tree_out_and_answers_the_same() -> None:
    mesh = mesh_of(box(0, 0, 100, 50))
    found = containing(mesh, POINTS)
    again = pickle.loads(pickle.dumps(mesh))
    assert "tree" in vars(mesh)
    assert "tree" not in vars(again)
    assert all(map(np.array_equal, containing(again, POINTS), found))
