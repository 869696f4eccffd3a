"""The line to a vehicle: bytes and frames, and the one at the other end.

`url`, `transport` and `wire` are the edge; `peer` is the vehicle, found, asked and ordered.
"""
