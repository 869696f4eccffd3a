"""A robot's own log laid beside the mission it was to drive: placed, its stand-stills matched, compared."""
