"""A vehicle's messages -> the events of a run in AUTO: for a live link and for a log alike.

`observer` collects messages into the vehicle's present state, `steps` derives the events from it,
`resuming` the item to go on with. Nothing here touches a vehicle, a clock or a disk.
"""
