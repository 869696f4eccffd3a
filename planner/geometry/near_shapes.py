"""Groups of shapes that lie near one another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import IntArray


def labels_of(shapes: Sequence[BaseGeometry], within: float) -> IntArray:
    """The number of the group that each shape is in (n,), counted in the order of the shapes."""
    if not shapes:
        return np.empty(0, dtype=np.int64)
    pairs = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=within)
    links = coo_array((np.ones(pairs.shape[1]), tuple(pairs)), shape=(len(shapes), len(shapes)))
    _, label = connected_components(links, directed=False)
    return label.astype(np.int64)
