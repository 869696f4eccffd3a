"""MAVLink: the mission protocol, a run of it by an autopilot, and a vehicle that exists only as numbers.

`url` and `wire` are the edge: bytes, sockets, signatures. Everything behind them speaks in messages.
"""
