"""Carries a mission to a robot and brings back its outcome.

`station` is this end: push, command, status, follow. `robot` is the other: an agent keeps every word in a
journal and lets the controller drive stop by stop through two small interfaces, `base.Base` and
`base.Scanner`. Between them lies a `link`: zenoh, or memory in the tests. `mavlink` is all that is done over
MAVLink, and `commands` what a person types.
"""
