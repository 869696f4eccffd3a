"""What recordings carry besides pictures: the mission, what its stops see, and runs, as values read back."""
