"""Shares the stops of a route out: among robots that drive at once, or tours that come back in time."""
