"""Missions as MAVLink items."""
