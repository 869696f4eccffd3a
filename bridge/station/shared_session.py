"""The end of a shared session that holds it open, and asks the robot for the commands of its user."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec

from stopgo.bridge.link.link import Link
from stopgo.bridge.station.session_socket import (
    LONGEST_PATH,
    PATH_ADVICE,
    SESSION_VERSION,
    Conversation,
    Greeting,
    SessionAnswers,
    SessionQuestion,
    check_private,
    has_unix_sockets,
    is_same_user,
)
from stopgo.mission.console.process import LOOK_S
from stopgo.mission.errors import InputError

MOST_COMMANDS = 16
"""Commands that are served at the same time."""
LONGEST_ASK_S = 60.0
IDLE_S = 60.0
"""Time after which a silent connection is closed."""
SEND_S = 5.0


class SharedSession:
    """SessionAnswers the questions of commands with those of the robot, over one open link."""

    def __init__(self, link: Link, *, token: str, commander: str) -> None:
        self._link = link
        self._commander = commander
        self._alive: set[str] = set()
        self._free = threading.BoundedSemaphore(MOST_COMMANDS)
        link.watch_presence(token, self._presence_changed)

    def _presence_changed(self, key: str, alive: bool) -> None:
        (self._alive.add if alive else self._alive.discard)(key)

    def serve(self, listener: socket.socket) -> None:
        """Serve commands until the process is ended."""
        listener.settimeout(LOOK_S)
        while True:
            try:
                connected, _ = listener.accept()
            except TimeoutError:  # a signal that another thread got is handled now
                continue
            if is_same_user(connected) and self._free.acquire(blocking=False):
                threading.Thread(target=self._served, args=(connected,), daemon=True).start()
            else:
                connected.close()

    def _served(self, connected: socket.socket) -> None:
        try:
            with connected, suppress(OSError, msgspec.DecodeError):
                self._converse(Conversation(connected))
        finally:
            self._free.release()

    def _converse(self, conversation: Conversation) -> None:
        greeting = Greeting(
            version=SESSION_VERSION, process=os.getpid(), commander=self._commander, found=bool(self._alive)
        )
        conversation.send(greeting, within_s=SEND_S)
        while (question := conversation.receive(SessionQuestion, within_s=IDLE_S)) is not None:
            conversation.send(self.answers(question), within_s=SEND_S)

    def answers(self, question: SessionQuestion) -> SessionAnswers:
        """Ask the robot, and return what the link verified."""
        within_s = min(question.timeout_s, LONGEST_ASK_S)
        if question.every:
            replies = self._link.ask_all(question.key, question.payload, timeout_s=within_s)
        else:
            reply = self._link.ask(
                question.key, question.payload, timeout_s=within_s, parameters=question.parameters
            )
            replies = [] if reply is None else [reply]
        return SessionAnswers(replies=tuple(replies), distrusted=self._link.distrusted)


@contextmanager
def listening_at(path: Path) -> Iterator[socket.socket]:
    """Listen at a socket of this user alone; one that a killed process left is replaced.

    Raises
    ------
    InputError
        If others can enter its folder, or another process holds this session.
    """
    if not has_unix_sockets():
        raise InputError("session: this system has no Unix sockets; commands open their own sessions")
    if len(os.fsencode(path)) > LONGEST_PATH:
        raise InputError(f"{path}: too long for a socket; {PATH_ADVICE}")
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        check_private(path.parent)
        with _only_one(path.with_suffix(".lock")), socket.socket(socket.AF_UNIX) as listener:
            path.unlink(missing_ok=True)
            listener.bind(str(path))
            path.chmod(0o600)
            listener.listen(MOST_COMMANDS)
            try:
                yield listener
            finally:
                path.unlink(missing_ok=True)
    except PermissionError as error:
        raise InputError(f"{error.filename or path}: {error.strerror}; {PATH_ADVICE}") from None


@contextmanager
def _only_one(path: Path) -> Iterator[None]:
    """Hold a lock that the system releases when the process ends, however it ends."""
    import fcntl

    with path.open("a") as held:
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"session: another process holds this session ({path}); end it first, or use it"
            ) from None
        yield
