"""What a run of a mission is: its states, the orders that change it, who may give them, and the way.

Nothing here touches a robot, a clock, a link or a disk: every function takes a run and gives the next one
with the events that tell of it.
"""
