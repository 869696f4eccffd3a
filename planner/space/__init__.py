"""The space of a floor: the ground, the obstacles, the drive area and the targets."""
