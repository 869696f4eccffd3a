"""Proof of a mission by simulation: the floor raised to its heights, scanned, measured, and registered."""
