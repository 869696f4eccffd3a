"""A run that an autopilot does by itself in AUTO: followed and ordered in a robot's words."""
