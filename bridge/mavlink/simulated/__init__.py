"""A rover that exists only as numbers and speaks MAVLink as a vehicle, by the habits of one autopilot.

`vehicle` holds the parts together: `transfers` is its end of the mission protocol, `store` what it keeps,
`rover` where it stands, `course` what it does in AUTO, `commands` what it obeys, `telemetry` what it tells,
`scanner` the scanner on it. All of them speak in messages and know nothing of sockets; `process` does.
"""
