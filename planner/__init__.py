"""Floor -> plan: where the scanner must stand, and by which route a robot visits those stops."""

from __future__ import annotations

from stopgo.planner.pipeline import Observe, plan

__all__ = ["Observe", "plan"]
