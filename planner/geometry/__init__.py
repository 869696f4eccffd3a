"""Geometry that every stage shares: shapes, room axes, compiled kernels, and an instance cache."""
