"""A rover that exists only as numbers and speaks MAVLink as a vehicle, by the habits of one autopilot.

`vehicle` holds the parts together: `transfers` is its end of the mission protocol, `vehicle_store` what it
keeps, `rover` where it stands, `auto_mission` what it does in AUTO, `guided_target` where a station leads it,
`command_handlers` what it obeys, `vehicle_telemetry` what it tells, `camera` the scanner on it. All speak in
messages; sockets are known to `vehicle_process` alone.
"""
