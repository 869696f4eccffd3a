"""A run of a mission: its states, the commands that change it, who may give them, and its route.

Nothing here touches a robot, a clock, a link or a disk. Every function takes a run and returns the next one
with the events of the change.
"""
