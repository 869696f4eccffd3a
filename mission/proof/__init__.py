"""Verification of a plan by simulated scans, and its text."""
