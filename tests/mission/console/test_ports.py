"""Ports that are given to what is started here."""

from __future__ import annotations

import socket

import pytest

from stopgo.mission.console.ports import free_port
from tests import ports


@pytest.mark.parametrize("kind", [socket.SOCK_STREAM, socket.SOCK_DGRAM])
def test_a_taken_port_is_not_given(kind: socket.SocketKind) -> None:
    with socket.socket(socket.AF_INET, kind) as taken:
        port = ports.free_port()
        taken.bind(("127.0.0.1", port))
        with pytest.raises(OSError, match=f"no port of 127.0.0.1 between {port} and {port} is free"):
            free_port(port, port)


def test_no_test_is_given_the_port_of_another() -> None:
    assert len({ports.free_port() for _ in range(50)}) == 50
