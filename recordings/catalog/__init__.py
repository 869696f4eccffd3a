"""Collections of recordings: the index of runs, their web pages, and merging."""
