"""The link to a vehicle: bytes and frames, and the peer at its other end.

`url`, `transport` and `wire` are the edge; `peer` is the vehicle: found, queried and commanded.
"""
