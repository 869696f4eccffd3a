"""Lines of sight: what a point sees of a floor, exactly."""
