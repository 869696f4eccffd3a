"""Ports of this machine for processes that are started here and talk to each other."""

from __future__ import annotations

import random
import socket

LOWEST, HIGHEST = 26_000, 32_767
"""Below the ports that systems give to outgoing connections (from 32 768 on Linux, from 49 152 elsewhere).
So a free port is taken only by a program that chooses it."""


def free_port(lowest: int = LOWEST, highest: int = HIGHEST) -> int:
    """Return a free port of 127.0.0.1 between the two, for TCP and for UDP, each time another one.

    Raises
    ------
    OSError
        If none of them is.
    """
    tried = random.sample(range(lowest, highest + 1), highest - lowest + 1)
    for port in tried:
        if all(_is_free(port, kind) for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM)):
            return port
    raise OSError(f"no port of 127.0.0.1 between {lowest} and {highest} is free")


def _is_free(port: int, kind: socket.SocketKind) -> bool:
    with socket.socket(socket.AF_INET, kind) as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True
