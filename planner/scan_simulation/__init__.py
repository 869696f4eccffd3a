"""Verification of a mission by simulation: the floor is extruded, scanned, measured, and registered."""
