"""A vehicle's messages -> the steps of a run that it drives by itself: for a live line and for a log alike.

`observer` gathers what is told into what is known at a moment, `steps` says what has happened by then,
`resuming` where the vehicle must go on. Nothing here touches a vehicle, a clock or a disk.
"""
