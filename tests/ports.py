"""Ports for tests: those who run at the same time have their own, and no outgoing connection is given one."""

from __future__ import annotations

import os

from stopgo.mission.console import ports
from tests.workers import NUMBER

LOWEST, EACH, WORKERS = 14_000, 1_500, 8
_given: set[int] = set()


def free_port() -> int:
    """One that no other test of this run was given."""
    worker = int(os.environ.get(NUMBER, "0")) % WORKERS
    lowest = LOWEST + worker * EACH
    while (port := ports.free_port(lowest, lowest + EACH - 1)) in _given:
        pass
    _given.add(port)
    return port
