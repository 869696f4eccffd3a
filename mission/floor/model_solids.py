"""Solids of a floor: all that stops the laser, as triangles; of a model, or by given heights."""

from __future__ import annotations

from dataclasses import dataclass

from stopgo.mission.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class ModelSolids:
    """Triangles of everything on a floor that stops the laser, from the floor to the next one above."""

    triangles: FloatArray
    """(n, 3, 3): the drawing's coordinates, and metres above the floor."""
    ceiling: float
    """Height of the next floor above, or of the ceiling, metres."""
    source: str = "the model's solids"
    """Source of the heights, in words."""
