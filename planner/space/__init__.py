"""The space of a floor: what carries the robot, what stands in its way, and what is to be seen."""
