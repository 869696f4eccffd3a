"""Carries a mission to a robot and brings back what became of it.

`station` is this end: push, command, status, follow. `agent` is the robot's end: it keeps every word in a
`journal` and lets the `controller` drive stop by stop through two small interfaces, `robots.Base` and
`robots.Scanner`. Between them lies a `link`: zenoh, or memory in the tests.
"""
