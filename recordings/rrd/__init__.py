"""Rerun files: reading, compacting and writing in chunks."""
