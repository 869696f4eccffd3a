"""Mission against floor: every clearance and every claim, measured again."""
