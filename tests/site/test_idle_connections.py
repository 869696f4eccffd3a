"""Connections that ask nothing: they keep no page from its STOP."""

from __future__ import annotations

import http.client
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from stopgo.bridge.link.memory_link import Switchboard
from stopgo.mission.console.ports import free_port
from stopgo.site import web_connections, web_server
from stopgo.site.web_server import SiteOptions, serving_site
from tests.waiting import LAST_RESORT_S


@pytest.fixture
def port(tmp_path: Path) -> Iterator[int]:
    """The port of a served site."""
    options = SiteOptions(tmp_path, "", port=free_port())
    with serving_site(options, say=lambda line: None, link=Switchboard().link()):
        yield options.port or 0


def opened(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=LAST_RESORT_S)


def status(port: int) -> int:
    page = http.client.HTTPConnection("127.0.0.1", port, timeout=LAST_RESORT_S)
    page.request("GET", "/")
    found = page.getresponse().status
    page.close()
    return found


def test_many_idle_connections_refuse_no_page(port: int) -> None:
    """They need no sign-in, and STOP was refused for as long as they were open."""
    with ExitStack() as held:
        for _ in range(web_connections.MOST_CONNECTIONS + 20):
            held.enter_context(opened(port))
        assert status(port) == 200


def test_a_page_that_asked_before_outlasts_those_that_never_asked(port: int) -> None:
    page = http.client.HTTPConnection("127.0.0.1", port, timeout=LAST_RESORT_S)
    page.request("GET", "/")
    page.getresponse().read()
    used = page.sock
    with ExitStack() as held:
        for _ in range(web_connections.MOST_CONNECTIONS + 20):
            held.enter_context(opened(port))
        page.request("GET", "/")
        assert page.getresponse().status == 200
        assert page.sock is used
    page.close()


def test_a_connection_that_asks_nothing_is_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web_connections, "FIRST_REQUEST_S", 0.1)
    options = web_server.SiteOptions(tmp_path, "", port=free_port())
    with (
        serving_site(options, say=lambda line: None, link=Switchboard().link()),
        opened(options.port or 0) as idle,
    ):
        assert idle.recv(1) == b""
