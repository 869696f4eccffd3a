"""The robot's end: an agent that stations reach, a controller that drives, and what it drives."""
