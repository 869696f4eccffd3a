"""Puts somebody else's robot or station through its paces, and says which requirement it does not meet."""
