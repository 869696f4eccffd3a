"""Socket of a session that the commands of one user share: its path, its permissions, and its messages.

The socket is in a folder that only its owner can enter. Each end verifies that the other one belongs to the
same user, so that a session gives nobody a right that its user does not have.
"""

from __future__ import annotations

import hashlib
import os
import select
import socket
import stat
import struct
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

import msgspec

from stopgo.mission.console.state_folder import state_folder
from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError

SESSION_VERSION: Final = 1
MOST_BYTES = 4_000_000
"""Largest message on the socket."""
LONGEST_PATH = 100
"""Longest path of a Unix socket, in bytes; macOS allows 103."""
PATH_ADVICE = "set XDG_STATE_HOME to a short path"


class Greeting(msgspec.Struct, frozen=True, kw_only=True):
    """First message of a session: who holds it, and its view of the robot."""

    version: int
    process: int
    commander: str
    found: bool
    """True if the robot shows its token."""


class SessionQuestion(msgspec.Struct, frozen=True, kw_only=True):
    """Query that a command hands to the session."""

    key: str
    payload: bytes
    parameters: dict[str, str]
    timeout_s: float
    every: bool = False
    """True if all answers are wanted, not only the first."""


class SessionAnswers(msgspec.Struct, frozen=True, kw_only=True):
    """Verified answers to a question; none means unknown."""

    replies: tuple[bytes, ...]
    distrusted: str = ""


SessionMessage = TypeVar("SessionMessage", Greeting, SessionQuestion, SessionAnswers)


@dataclass(frozen=True)
class SessionOptions:
    """Options of a connection; commands share a session only if all of them are equal."""

    endpoint: str
    robot: str
    site: str | None = None
    commander: str | None = None
    insecure: bool = False
    keys: Path | None = None

    @property
    def path(self) -> Path:
        """Path of the socket: its name is a digest of the options."""
        keys = None if self.keys is None else str(self.keys.resolve())
        same = [self.endpoint, self.robot, self.site, self.commander, self.insecure, keys]
        digest = hashlib.sha256(msgspec.json.encode(same)).hexdigest()[:16]
        return session_folder() / f"{digest}.sock"


def session_folder() -> Path:
    """Return the folder of the user's sessions, in `$XDG_STATE_HOME/stopgo/session`."""
    return state_folder() / "session"


def has_unix_sockets() -> bool:
    """True where a session can be shared; Windows has no such sockets in Python."""
    return hasattr(socket, "AF_UNIX") and hasattr(os, "geteuid")


def check_private(folder: Path) -> None:
    """Refuse a folder that others can enter or that belongs to another user.

    Raises
    ------
    InputError
        Names the folder and the remedy.
    """
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid():
        raise InputError(f"{folder}: is not a folder of this user; remove it")
    if found.st_mode & 0o077:
        raise InputError(f"{folder}: others can enter it; run: chmod 700 {folder}")


def is_same_user(connected: socket.socket) -> bool:
    """True if the process at the other end belongs to this user, as far as the system can say."""
    if not hasattr(socket, "SO_PEERCRED"):
        return True
    credentials = connected.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    return bool(struct.unpack("3i", credentials)[1] == os.geteuid())


class Conversation:
    """Messages over a connected socket, one JSON document a line."""

    def __init__(self, connected: socket.socket) -> None:
        self._socket = connected
        self._received = bytearray()

    def send(self, message: Any, *, within_s: float) -> None:
        """Send a message; raises `OSError` if it is not taken in time."""
        self._socket.settimeout(max(within_s, 0.001))
        self._socket.sendall(msgspec.json.encode(message) + b"\n")

    def receive(self, kind: type[SessionMessage], *, within_s: float) -> SessionMessage | None:
        """Return the next message, or `None` if it does not arrive in time.

        Raises
        ------
        OSError, msgspec.DecodeError
            If the other end is gone, or sends something else.
        """
        deadline = time.monotonic() + within_s
        while b"\n" not in self._received:
            ready, _, _ = select.select([self._socket], [], [], max(0.0, deadline - time.monotonic()))
            if not ready:
                return None
            arrived = self._socket.recv(65536)
            if not arrived or len(self._received) > MOST_BYTES:
                raise ConnectionError
            self._received += arrived
        line, _, rest = self._received.partition(b"\n")
        self._received = rest
        return decoded(line, kind)

    def close(self) -> None:
        self._socket.close()
