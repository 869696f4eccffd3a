"""Recordings in a viewer: live, headless, and as an importer of Rerun."""
