"""MAVLink, by purpose.

`vehicle_link` connects to a vehicle; `transfer` uploads a mission to it; `auto` follows and commands an
autopilot that runs the mission by itself; `driving` drives an autopilot as a robot's base; `tunnel` carries
frames elsewhere; `simulated` is a simulated vehicle.
"""
