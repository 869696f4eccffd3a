"""A run that an autopilot does by itself in AUTO: followed and commanded as a robot's run."""
