"""Data embedded in recordings besides pictures: the mission, what its stops see, and runs."""
