"""Figures of the planner and the bridge, each run by one command; tables go into benchmarks/README.md."""
