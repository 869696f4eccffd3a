"""Many recordings: the index of runs, their site, and merging."""
