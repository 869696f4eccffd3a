"""Viewers of recordings: live, headless, and as an importer of Rerun."""
