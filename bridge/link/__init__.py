"""The link between station and robot: in memory or over zenoh, with keys and a clock."""
