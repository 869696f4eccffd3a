"""Checks of every request before anything reads it: address, origin, size, and who may do it.

A page of another site in the same browser, a name that another site lets point here, another user of this
machine and a request that is too large are refused here. What passes has a session, except the start page
and its files, which hold nothing of the site.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from stopgo.site.page_access import PageAccess, PageSession, holds_key

MOST_BODY = 64 * 1024
"""Largest body of a request, bytes; nothing is uploaded."""
MOST_PATH = 2048
KEY_HEADER = "X-Stopgo-Key"
READING = ("GET", "HEAD")
SIGN_IN = "/api/session"
RECORDINGS = "/recordings/"
FREE = ("/pages/", RECORDINGS)
"""Paths without a session: files of the page, and recordings for the viewer, whose names are secrets."""

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content-Security-Policy of the pages: their own files, no script or style inside a page, in no frame."""
DOCUMENT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; sandbox allow-downloads allow-popups"
)
"""Of reports and drawings, which are one file: they run nothing."""
SAFETY = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}
"""Headers of every answer."""


@dataclass(frozen=True)
class SiteAddress:
    """Address of the site as browsers name it."""

    scheme: str
    hosts: tuple[str, ...]
    """Names with the port, such as `127.0.0.1:26000`; the first is printed."""

    @property
    def url(self) -> str:
        return f"{self.scheme}://{self.hosts[0]}"

    @property
    def origins(self) -> Sequence[str]:
        return [f"{self.scheme}://{host}" for host in self.hosts]

    @property
    def cookie(self) -> str:
        """Name of the cookie: cookies of one host are shared by its ports."""
        return f"stopgo-{self.hosts[0].rpartition(':')[2]}"


@dataclass(frozen=True)
class NotAdmitted:
    """Reason why a request is refused."""

    status: int
    reason: str


class RequestChecks:
    """ASGI application in front of another: refuses what may not pass."""

    def __init__(
        self, app: ASGIApp, *, address: SiteAddress, access: PageAccess, viewer: Callable[[], str]
    ) -> None:
        self._app = app
        self._address = address
        self._access = access
        self._viewer = viewer
        """Returns the origin of Rerun's viewer; empty while it does not run."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        refused = self._refused(scope, headers)
        if refused is not None:
            answer = JSONResponse({"error": refused.reason}, status_code=refused.status)
            await answer(scope, receive, _with_safety(send))
            return
        await self._app(scope, _limited(receive), _with_safety(send))

    def _refused(self, scope: Scope, headers: Headers) -> NotAdmitted | None:
        """Return why a request may not pass; puts its session into the scope if it may."""
        path, method = scope["path"], scope["method"]
        foreign = self._foreign(headers, path, reading=method in READING)
        if foreign or len(path) > MOST_PATH:
            return NotAdmitted(403, foreign or "the path is too long")
        if method not in READING:
            wrong = _wrong_body(headers)
            if wrong is not None:
                return wrong
        session = self._session(headers)
        scope["session_of_page"] = session
        if path == SIGN_IN if method not in READING else path == "/" or path.startswith(FREE):
            return None
        return _not_allowed(session, headers, reading=method in READING)

    def _foreign(self, headers: Headers, path: str, *, reading: bool) -> str:
        """Return why a request does not come from this site's own page; empty if it does."""
        if headers.getlist("host") not in [[host] for host in self._address.hosts]:
            return "this address is not the site's"
        origin = headers.get("origin")
        if reading and path.startswith(RECORDINGS) and origin and origin == self._viewer():
            return ""
        if origin is None and reading:
            outside = headers.get("sec-fetch-site", "none") not in ("none", "same-origin")
            return "requested by another site's page" if outside and not _opens_page(headers) else ""
        return "" if origin in self._address.origins else "requested by another site's page"

    def _session(self, headers: Headers) -> PageSession | None:
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return None
        found = cookies.get(self._address.cookie)
        return None if found is None else self._access.session(found.value)


def _opens_page(headers: Headers) -> bool:
    """True for a link that was followed: the page opens in a tab of its own, and nothing else learns it."""
    return headers.get("sec-fetch-mode") == "navigate" and headers.get("sec-fetch-dest") == "document"


def _not_allowed(session: PageSession | None, headers: Headers, *, reading: bool) -> NotAdmitted | None:
    """Return why a session may not do this; None if it may."""
    if session is None:
        return NotAdmitted(401, "sign in with the address that stopgo site prints")
    if reading:
        return None
    if not holds_key(session, headers.get(KEY_HEADER, "")):
        return NotAdmitted(403, "the page's key is missing or wrong; sign in again")
    return None if session.role == "operator" else NotAdmitted(403, "this page only watches")


def _wrong_body(headers: Headers) -> NotAdmitted | None:
    if headers.get("content-type", "").partition(";")[0].strip() != "application/json":
        return NotAdmitted(415, "send JSON")
    size = headers.get("content-length", "")
    if not size.isdecimal():
        return NotAdmitted(411, "the length of the body is missing")
    if len(size) > 9 or int(size) > MOST_BODY:
        return NotAdmitted(413, f"the body is larger than {MOST_BODY} bytes")
    return None


def _limited(receive: Receive) -> Receive:
    """Receive at most the largest body, whatever its announced length."""
    left = MOST_BODY

    async def received() -> Message:
        nonlocal left
        message = await receive()
        left -= len(message.get("body", b""))
        if left < 0:
            return {"type": "http.disconnect"}
        return message

    return received


def _with_safety(send: Send) -> Send:
    """Send with the headers of safety, and those of pages where the answer has no policy of its own."""

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _missing(headers).items():
                headers[name] = value
        await send(message)

    return sent


def _missing(headers: MutableHeaders) -> Mapping[str, str]:
    more = {
        "Content-Security-Policy": POLICY,
        "Cache-Control": "no-store",
        "Cross-Origin-Resource-Policy": "same-origin",
    }
    return {**SAFETY, **{name: value for name, value in more.items() if name not in headers}}
