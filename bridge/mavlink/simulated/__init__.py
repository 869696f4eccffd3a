"""A rover that exists only as numbers and speaks MAVLink as a vehicle, by the habits of one autopilot.

`vehicle` holds the parts together: `transfers` is its end of the mission protocol, `store` what it keeps,
`rover` where it stands, `course` what it does in AUTO, `lead` where others lead it, `orders` what it obeys,
`telemetry` what it tells, `camera` the scanner on it. All speak in messages; sockets are known to
`process` alone.
"""
