"""A mission as MAVLink mission items: what each autopilot keeps of them, and the way there and back.

Numbers of commands and frames are those of the MAVLink common dialect; nothing here opens a link.
"""
