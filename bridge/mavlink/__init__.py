"""MAVLink, by what is done over it.

`line` reaches a vehicle; `transfer` puts a mission onto it; `auto` follows and orders the autopilot that runs
it; `driving` drives an autopilot as a robot's base; `tunnel` carries frames elsewhere; `simulated` is a
vehicle that exists only as numbers.
"""
