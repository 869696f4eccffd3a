"""Comparison of a robot's own log with its mission: placing, matching of standstills, verdict."""
