"""Comparison of a run with its mission: stops, states, distance from the route, and acquired coverage."""
