"""The site at a real socket: over TLS, with keys, and what it refuses there."""

from __future__ import annotations

import http.client
import json
import socket
import ssl
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from stopgo.bridge.link.authority import init_site, issue
from stopgo.bridge.link.keys import now_utc
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.robot.program import RobotOptions, robot_on
from stopgo.bridge.robot.robot_hardware import SimulatedBody
from stopgo.bridge.robot.simulated_faults import read_faults
from stopgo.bridge.station.station import Station
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.files.mission_json import write
from stopgo.site.request_checks import KEY_HEADER
from stopgo.site.server_certificate import own_certificate
from stopgo.site.web_server import SiteOptions, _certificates, serving_site
from tests.ports import free_port
from tests.recordings import world
from tests.waiting import wait_until

STOP = {"id": "s1"}


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    (tmp_path / "site").mkdir()


class Browser:
    """Requests of a page to a served site."""

    def __init__(self, connection: http.client.HTTPConnection, address: str) -> None:
        self._connection = connection
        self._origin, _, token = address.partition("/#token=")
        self._more: dict[str, str] = {}
        answer, body = self.send("POST", "/api/session", {"token": token})
        self.cookie = answer.getheader("Set-Cookie") or ""
        self._more = {"Cookie": self.cookie.partition(";")[0], KEY_HEADER: body["key"]}

    def send(self, method: str, path: str, body: Any = None) -> tuple[http.client.HTTPResponse, Any]:
        sent = None if body is None else json.dumps(body)
        about = {"Content-Type": "application/json", "Origin": self._origin, **self._more}
        self._connection.request(method, path, sent, about)
        answer = self._connection.getresponse()
        return answer, json.loads(answer.read())


def quiet(line: str) -> None:
    """Take what is for the terminal."""


@pytest.fixture
def tls_site(tmp_path: Path) -> Iterator[tuple[int, str, Path]]:
    """A site with a given certificate: its port, address and certificate."""
    made, port = own_certificate(tmp_path / "certificate", "127.0.0.1"), free_port()
    options = SiteOptions(
        tmp_path / "site", "", port=port, certificate=made.certificate, certificate_key=made.key
    )
    with serving_site(options, say=quiet, link=Switchboard().link()) as address:
        yield port, address, made.certificate


def test_the_page_over_tls(tls_site: tuple[int, str, Path]) -> None:
    port, address, certificate = tls_site
    assert address.startswith(f"https://127.0.0.1:{port}/#token=")
    context = ssl.create_default_context(cafile=str(certificate))
    browser = Browser(http.client.HTTPSConnection("127.0.0.1", port, context=context), address)
    assert {"Secure", "HttpOnly"} <= {word.strip() for word in browser.cookie.split(";")}
    assert browser.send("POST", "/api/stop", STOP)[0].status == 200
    with pytest.raises(ssl.SSLCertVerificationError):
        http.client.HTTPSConnection("127.0.0.1", port, context=ssl.create_default_context()).connect()


def test_nothing_is_served_in_the_clear_where_tls_is(tls_site: tuple[int, str, Path]) -> None:
    port, _, _ = tls_site
    with socket.create_connection(("127.0.0.1", port)) as plain:
        plain.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert b"<html" not in plain.recv(4096)


def test_beyond_this_machine_there_is_no_page_without_tls(tmp_path: Path) -> None:
    """Every other address gets a certificate of its own, if none is given."""
    said: list[str] = []
    for listen in ("192.0.2.5", "2001:db8::1"):
        assert _certificates(SiteOptions(tmp_path, "", listen=listen), said.append) is not None
    assert _certificates(SiteOptions(tmp_path, ""), said.append) is None
    assert len(said) == 2 and "SHA-256" in said[0]


@pytest.mark.parametrize(("role", "may"), [("viewer", False), ("station", True)])
def test_who_may_order_follows_the_keys(tmp_path: Path, role: Any, may: bool) -> None:
    init_site(tmp_path / "keys", now=now_utc())
    issue(tmp_path / "keys", role, "vera", now=now_utc())
    port = free_port()
    options = SiteOptions(tmp_path / "site", "", port=port, keys=tmp_path / "keys" / "vera")
    with serving_site(options, say=quiet, link=Switchboard().link()) as address:
        browser = Browser(http.client.HTTPConnection("127.0.0.1", port), address)
        _, me = browser.send("GET", "/api/me")
        assert (me["role"], me["commander"]) == ("operator" if may else "viewer", "vera")
        assert browser.send("POST", "/api/stop", STOP)[0].status == (200 if may else 409)


def order(browser: Browser, verb: str, **fields: Any) -> tuple[str, str]:
    """Give an order, and return its outcome with the state or the reason."""
    path = "/api/robots/r1/" + ("push" if verb == "push" else "orders")
    given = {"id": uuid.uuid4().hex, **({} if verb == "push" else {"verb": verb}), **fields}
    answer, body = browser.send("POST", path, given)
    assert answer.status == 200, body
    (record,) = body["orders"]
    return record["outcome"], record["reason"] or record["state"]


@pytest.fixture
def served_robot(tmp_path: Path) -> Iterator[tuple[Browser, Station]]:
    """A page of a site with a robot whose first stop is blocked, and another station."""
    board, port, keys = Switchboard(), free_port(), KeyExpressions("r1")
    body = SimulatedBody(tmp_path / "r1", faults=read_faults(["blocked@1"]))
    robot = RobotOptions(name="r1", listen="", state=tmp_path / "r1", body=body, speed_up=60.0)
    options = SiteOptions(tmp_path / "site", "", robots=("r1",), port=port)
    with (
        robot_on(board.link(), keys, robot),
        serving_site(options, say=quiet, link=board.link()) as address,
    ):
        page = Browser(http.client.HTTPConnection("127.0.0.1", port), address)
        yield page, Station(board.link(), keys, commander="ben")


def test_an_order_for_what_another_page_has_changed_is_refused(
    served_robot: tuple[Browser, Station], tmp_path: Path
) -> None:
    """One page started what the other had pushed; two that skipped one stop skipped two."""
    page, station = served_robot
    first = world.nouns_at()[-1]
    assert isinstance(first, Mission)
    second = with_digest(structs.replace(first, id="f" * 32))
    write(first, tmp_path / "site" / "first.json")
    write(second, tmp_path / "site" / "second.json")
    assert order(page, "push", file="first.json")[0] == "ok"
    assert order(page, "push", file="second.json")[0] == "ok"
    shown = {"mission_id": first.id, "revision": first.revision}
    assert order(page, "start", **shown) == ("refused", "wrong_mission")
    assert order(page, "start", **{**shown, "mission_id": second.id}) == ("ok", "RUNNING")
    held = wait_until(lambda: (state := station.status()).state == "HELD" and state)
    skip = {"run_id": held.run_id, "stop": "S1"}
    assert order(page, "skip", **{**skip, "run_id": "another"}) == ("refused", "wrong_run")
    assert order(page, "skip", **skip)[0] == "ok"
    assert order(page, "skip", **skip)[0] == "refused"
    assert station.status().skipped == ("S1",)


def test_what_is_pushed_is_what_the_page_showed(
    served_robot: tuple[Browser, Station], tmp_path: Path
) -> None:
    """Another page saved into the file, or pushed another mission, while this one showed the difference."""
    page, station = served_robot
    first = world.nouns_at()[-1]
    assert isinstance(first, Mission)
    second = with_digest(structs.replace(first, revision=first.revision + 1, name="renamed"))
    file = tmp_path / "site" / "mission.json"
    write(first, file)
    wait_until(lambda: difference(page)["known"])
    shown = difference(page)
    assert (shown["new"]["digest"], shown["held"]) == (first.digest, None)
    write(second, file)
    assert order(page, "push", file="mission.json", digest=first.digest, held="") == ("not_sent", "")
    assert station.status().mission_id is None
    assert order(page, "push", file="mission.json", digest=second.digest, held="")[0] == "ok"
    wait_until(lambda: difference(page)["held"])
    assert order(page, "push", file="mission.json", digest=second.digest, held=first.digest)[0] == "not_sent"
    assert order(page, "push", file="mission.json", digest=second.digest, held="")[0] == "not_sent"
    assert order(page, "push", file="mission.json", digest=second.digest, held=second.digest)[0] == "ok"


def difference(page: Browser) -> Any:
    """Return what the page shows before a push."""
    return page.send("GET", "/api/robots/r1/difference?file=mission.json")[1]


def test_what_a_silent_robot_holds_is_not_known(tmp_path: Path) -> None:
    """It was said to hold no mission."""
    mission, port = world.nouns_at()[-1], free_port()
    assert isinstance(mission, Mission)
    write(mission, tmp_path / "site" / "mission.json")
    options = SiteOptions(tmp_path / "site", "", robots=("r1",), port=port)
    with serving_site(options, say=quiet, link=Switchboard().link()) as address:
        page = Browser(http.client.HTTPConnection("127.0.0.1", port), address)
        assert difference(page)["known"] is False
