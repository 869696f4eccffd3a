"""Attacks on the site: foreign pages, other users, replayed tokens, rebinding, paths, huge requests."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from starlette.routing import Route

from stopgo.mission.errors import InputError
from stopgo.site.page_access import SESSION_S, TOKEN_S, PageAccess
from stopgo.site.request_checks import KEY_HEADER, MOST_BODY
from stopgo.site.robot_orders import RobotOrders
from stopgo.site.site_folder import SiteFiles
from stopgo.site.web_app import SiteParts, web_app
from tests.site.pages import URL, Page, parts_of

STOP = {"id": "s1", "robots": []}


@pytest.fixture
def parts(tmp_path: Path) -> SiteParts:
    return parts_of(tmp_path)


def test_the_own_page_may_send_commands(parts: SiteParts) -> None:
    assert Page(parts).post("/api/stop", STOP).status_code == 200


@pytest.mark.parametrize(
    "origin", ["https://evil.example", "null", "http://127.0.0.1:9999", "http://localhost:9999", None]
)
def test_a_foreign_page_in_the_same_browser_commands_nothing(parts: SiteParts, origin: str | None) -> None:
    """Another port of this machine is foreign, too: the cookie goes there, so it does not count alone."""
    answer = Page(parts).post("/api/stop", STOP, Origin=origin)
    assert answer.status_code == 403


def test_a_foreign_page_reads_nothing(parts: SiteParts) -> None:
    page = Page(parts)
    for headers in ({"Origin": "https://evil.example"}, {"Sec-Fetch-Site": "cross-site"},
                    {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Dest": "iframe"}):  # fmt: skip
        assert page.get("/api/me", **headers).status_code == 403
    assert page.get("/api/me", **{"Sec-Fetch-Site": "same-origin"}).status_code == 200


def test_a_foreign_form_cannot_be_sent(parts: SiteParts) -> None:
    """A form needs no permission of the browser, but cannot send JSON."""
    page = Page(parts)
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data"):
        answer = page.client.post(
            "/api/stop", content=json.dumps(STOP), headers={"Origin": URL, "Content-Type": kind}
        )
        assert answer.status_code == 415


def test_a_stolen_cookie_commands_nothing(parts: SiteParts) -> None:
    """A server on another port of this machine may see the cookie; the page's key it never sees."""
    page = Page(parts)
    for key in ("", "x", "0" * 43):
        assert page.post("/api/stop", STOP, **{KEY_HEADER: key}).status_code == 403


def test_another_user_of_this_machine_gets_nothing(parts: SiteParts) -> None:
    """They can connect, and have neither token nor cookie."""
    stranger = Page(parts, role=None)
    for path in ("/api/me", "/api/events", "/api/folder", "/api/missions/x/1", "/api/robots/r1/difference"):
        assert stranger.get(path).status_code == 401, path
    for path in ("/api/stop", "/api/invitations", "/api/robots/r1/orders", "/api/robots/r1/push"):
        assert stranger.post(path, {}).status_code == 401, path
    assert stranger.sign_in("guessed") == 401


def test_what_is_stored_opens_no_session(tmp_path: Path, parts: SiteParts) -> None:
    page = Page(parts)
    stored = (tmp_path / "state" / "access.json").read_text()
    (cookie,) = page.client.cookies.values()
    assert cookie not in stored
    assert page.key not in stored
    assert (tmp_path / "state").stat().st_mode & 0o077 == 0


def test_a_token_opens_one_session(parts: SiteParts) -> None:
    token = parts.access.invite("operator")
    assert Page(parts, role=None).sign_in(token) == 200
    assert Page(parts, role=None).sign_in(token) == 401


def test_a_token_and_a_session_end(tmp_path: Path) -> None:
    now = [0.0]
    access = PageAccess(tmp_path / "state" / "access.json", 1, now=lambda: now[0])
    late = access.invite("operator")
    now[0] = TOKEN_S + 1
    assert access.redeem(late) is None
    made = access.redeem(access.invite("operator"))
    assert made is not None
    now[0] += SESSION_S
    assert access.session(made.cookie) is not None
    now[0] += 1
    assert access.session(made.cookie) is None


@pytest.mark.parametrize("host", ["evil.example:26000", "127.0.0.1", "127.0.0.1:80", "[::1]:26000", ""])
def test_a_name_that_is_made_to_point_here_gets_nothing(parts: SiteParts, host: str) -> None:
    """DNS rebinding: the browser believes that the foreign name is this server, and sends that name."""
    page = Page(parts)
    for path in ("/", "/pages/main.js", "/api/me"):
        assert page.get(path, Host=host).status_code == 403
    assert page.post("/api/stop", STOP, Host=host, Origin=f"http://{host}").status_code == 403


@pytest.mark.parametrize(
    "name",
    ["../secret", "/etc/passwd", "a/../../secret", "..\\secret", "link/secret", ".git/config", "a\0b", "",
     "plans/../../secret", "%2e%2e/secret", "x" * 2000],
)  # fmt: skip
def test_no_path_leads_out_of_the_folder(tmp_path: Path, name: str) -> None:
    (tmp_path / "secret").write_text("secret")
    place = tmp_path / "site"
    place.mkdir()
    (place / "link").symlink_to(tmp_path)
    with pytest.raises(InputError):
        SiteFiles.at(place).file(name)


@pytest.mark.parametrize(
    "path", ["/pages/..%2fweb_app.py", "/pages/../web_app.py", "/pages/%2e%2e", "/pages/x"]
)
def test_the_pages_files_are_those_of_the_page(parts: SiteParts, path: str) -> None:
    assert Page(parts).get(path).status_code in (401, 404)


def test_a_huge_request_is_refused_before_it_is_read(parts: SiteParts) -> None:
    page = Page(parts)
    headers = {"Origin": URL, KEY_HEADER: page.key, "Content-Type": "application/json"}
    for size in (str(MOST_BODY + 1), "9" * 30, "-1", "1e9"):
        answer = page.client.post("/api/stop", content=b"{}", headers={**headers, "Content-Length": size})
        assert answer.status_code in (411, 413)
    longer = b'{"id":"' + b"x" * MOST_BODY + b'"}'
    assert page.client.post("/api/stop", content=longer, headers=headers).status_code == 413
    lied = page.client.post("/api/stop", content=longer, headers={**headers, "Content-Length": "10"})
    assert lied.status_code >= 400


@pytest.mark.parametrize(
    "body", [b"", b"[]", b"{", b'{"id": 1}', b'{"id":"a","robots":[1]}', b'{"id":"a","more":1}', b"\xff",
             b"[" * 30_000]
)  # fmt: skip
def test_a_request_that_is_something_else_is_one_line(parts: SiteParts, body: bytes) -> None:
    page = Page(parts)
    headers = {"Origin": URL, KEY_HEADER: page.key, "Content-Type": "application/json"}
    answer = page.client.post("/api/stop", content=body, headers=headers)
    assert answer.status_code == 400
    assert "\n" not in answer.json()["error"]


def test_nothing_changes_by_get(parts: SiteParts) -> None:
    changing = {"/api/session", "/api/invitations", "/api/stop", "/api/robots/r/orders", "/api/robots/r/push"}
    page = Page(parts)
    for path in changing:
        assert page.get(path).status_code == 405
    routes = web_app(parts)._app.routes  # type: ignore[attr-defined]
    posts = {one.path for one in routes if isinstance(one, Route) and "POST" in (one.methods or ())}
    assert all("GET" not in (one.methods or ()) for one in routes if one.path in posts)


def test_a_viewers_page_commands_nothing(parts: SiteParts) -> None:
    page = Page(parts, role="viewer")
    assert page.get("/api/me").json()["role"] == "viewer"
    for path in ("/api/stop", "/api/invitations", "/api/robots/r1/orders", "/api/robots/r1/push"):
        assert page.post(path, STOP).status_code == 403


def test_a_viewers_keys_make_every_page_a_viewers(tmp_path: Path) -> None:
    page = Page(parts_of(tmp_path, may_command=False))
    assert page.get("/api/me").json()["role"] == "viewer"
    assert page.post("/api/stop", STOP).status_code == 409


def test_every_answer_has_the_headers_of_safety(parts: SiteParts) -> None:
    page = Page(parts)
    for path in ("/", "/pages/main.js", "/api/me", "/nowhere", "/api/robots/r1/difference"):
        headers = page.get(path).headers
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert "server" not in headers
    made = page.post("/api/session", {"token": parts.access.invite("viewer")}).headers["set-cookie"].lower()
    assert all(word in made for word in ("httponly", "samesite=strict", "path=/"))


def test_an_unknown_robot_gets_no_command(parts: SiteParts) -> None:
    answer = Page(parts).post("/api/robots/r9/orders", {"id": "1", "verb": "start"})
    assert (answer.status_code, answer.json()["error"]) == (400, "robot 'r9': not on this site")
    assert isinstance(parts.orders, RobotOrders)


def test_the_viewers_pages_read_recordings_alone(tmp_path: Path) -> None:
    """Rerun's viewer has another port; it may read recordings whose secret names it was given."""
    viewer = "http://127.0.0.1:9090"
    page = Page(parts_of(tmp_path, viewer=lambda: viewer))
    assert page.get("/recordings/guessed.rrd", Origin=viewer).status_code == 404
    assert page.get("/recordings/guessed.rrd", Origin="http://127.0.0.1:9091").status_code == 403
    assert page.get("/api/me", Origin=viewer).status_code == 403
    assert page.post("/api/stop", STOP, Origin=viewer).status_code == 403
