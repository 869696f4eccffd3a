"""A mission as MAVLink mission items: the conversion in both directions, and the fields each autopilot keeps.

Numbers of commands and frames are those of the MAVLink common dialect; nothing here opens a link.
"""
