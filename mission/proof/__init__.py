"""The noun of a simulated scan of a plan, and its text."""
