"""Access of browsers to the site: one-time tokens, and the sessions that they open.

A browser shows that it is admitted by two secrets. The cookie goes with every request of the page, and no
script can read it. The page's key is kept by the page alone, and goes in a header with every request that
changes something. Cookies are shared by all ports of a machine, keys are not: a page of another port may
learn the cookie, but can order nothing with it.

Sessions outlast a restart of the server. Only hashes of their secrets are on disk, in a file of this user.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import msgspec

from stopgo.mission.document.decoding import decoded
from stopgo.mission.files.atomic import write_atomic

TOKEN_S = 3600.0
"""Time in which a token may be used."""
SESSION_S = 12 * 3600.0
"""Time after which a browser needs a new token: a working day."""
MOST_TOKENS, MOST_SESSIONS = 32, 64

PageRole = Literal["operator", "viewer"]
"""An operator's page has buttons; a viewer's has none, and what it sends is refused."""


class PageSession(msgspec.Struct, frozen=True, kw_only=True):
    """An admitted browser, with hashes of its secrets."""

    cookie: str
    key: str
    role: PageRole
    until: float
    """Seconds since 1970."""


class StoredAccess(msgspec.Struct, frozen=True, kw_only=True):
    """Sessions and the port, as they outlast a restart."""

    port: int
    sessions: tuple[PageSession, ...] = ()


class NewSession(msgspec.Struct, frozen=True, kw_only=True):
    """Secrets of a new session, which only the browser gets."""

    cookie: str
    key: str
    role: PageRole


class PageAccess:
    """Tokens and sessions of one site."""

    def __init__(self, file: Path, port: int, *, now: Callable[[], float] = time.time) -> None:
        self._file = file
        self._port = port
        self._now = now
        self._lock = threading.Lock()
        self._tokens: dict[str, tuple[PageRole, float]] = {}
        stored = read_stored(file)
        self._sessions = {one.cookie: one for one in ([] if stored is None else stored.sessions)}

    def invite(self, role: PageRole) -> str:
        """Return a new token, which admits one browser once."""
        token = secrets.token_urlsafe(32)
        with self._lock:
            self._tokens[_hashed(token)] = (role, self._now() + TOKEN_S)
            while len(self._tokens) > MOST_TOKENS:
                del self._tokens[next(iter(self._tokens))]
        return token

    def redeem(self, token: str) -> NewSession | None:
        """Return the session that a token opens; `None` if it is unknown, used or too old."""
        with self._lock:
            role, until = self._tokens.pop(_hashed(token), ("viewer", 0.0))
            if until < self._now():
                return None
            made = NewSession(cookie=secrets.token_urlsafe(32), key=secrets.token_urlsafe(32), role=role)
            session = PageSession(
                cookie=_hashed(made.cookie), key=_hashed(made.key), role=role, until=self._now() + SESSION_S
            )
            self._sessions[session.cookie] = session
            self._store()
        return made

    def session(self, cookie: str) -> PageSession | None:
        """Return the session of a cookie; `None` if there is none, or it is too old."""
        found = self._sessions.get(_hashed(cookie))
        return found if found is not None and found.until >= self._now() else None

    def _store(self) -> None:
        now = self._now()
        kept = [one for one in self._sessions.values() if one.until >= now][-MOST_SESSIONS:]
        self._sessions = {one.cookie: one for one in kept}
        write_private(self._file, StoredAccess(port=self._port, sessions=tuple(kept)))


def holds_key(session: PageSession, key: str) -> bool:
    """Return True if a page's key is that of the session."""
    return hmac.compare_digest(session.key, _hashed(key))


def read_stored(file: Path) -> StoredAccess | None:
    """Return the stored sessions; `None` if there are none, or the file is damaged."""
    try:
        return decoded(file.read_bytes(), StoredAccess)
    except (OSError, msgspec.DecodeError):
        return None


def write_private(file: Path, stored: StoredAccess) -> None:
    """Write the sessions to a file in a folder that only this user enters."""
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    file.parent.chmod(0o700)
    write_atomic(file, msgspec.json.encode(stored))


def _hashed(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "replace")).hexdigest()
