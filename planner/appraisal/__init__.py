"""Appraisal of a plan: its figures, the floor it leaves out, and its doubtful points."""
