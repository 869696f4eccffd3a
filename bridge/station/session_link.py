"""Link of one command: through the session that its user holds open, and by a session of its own.

The command waits for the open session for 0.2 s at most. After that it asks by a session of its own as well,
with the same bytes. The robot executes a command once, whichever session brings it first.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager

import msgspec

from stopgo.bridge.link.keys import HeldKeys, now_utc, read_keys
from stopgo.bridge.link.link import Answering, Hearing, Link, Presence, Publish
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.link.tls_probe import why_no_link
from stopgo.bridge.station.session_socket import (
    LONGEST_PATH,
    SESSION_VERSION,
    Conversation,
    Greeting,
    SessionAnswers,
    SessionOptions,
    SessionQuestion,
    check_private,
    has_unix_sockets,
    is_same_user,
)
from stopgo.bridge.station.station import Station, connect
from stopgo.mission.errors import InputError

SESSION_S = 0.2
"""Longest wait for the open session before a command is sent by its own session too."""


class SessionLink:
    """Link that asks through an open session, and by the link of `open_own` where that does not answer."""

    def __init__(
        self, conversation: Conversation, greeting: Greeting, open_own: Callable[[], Link], *, left_s: float
    ) -> None:
        self._conversation: Conversation | None = conversation
        self._greeting = greeting
        self._open_own = open_own
        self._own: Link | None = None
        self._left_s = left_s
        """Time that is left to wait for the session."""
        self._asked: SessionQuestion | None = None
        """SessionQuestion that the session has not answered yet."""
        self._presence: list[tuple[str, Presence]] = []
        self._distrusted = ""

    @property
    def path_text(self) -> str:
        """Sessions that the command used, as one line of text."""
        session = f"the open session of process {self._greeting.process}"
        if self._own is None:
            return f"sent through {session}"
        return f"{session} did not answer within {SESSION_S:g} s; sent by a session of its own as well"

    @property
    def distrusted(self) -> str:
        return self._distrusted if self._own is None else self._own.distrusted

    @property
    def may_be_sent(self) -> bool:
        """True always: the open session has found the robot."""
        return True

    def ask(
        self,
        key: str,
        payload: bytes = b"",
        *,
        timeout_s: float,
        parameters: Mapping[str, str] | None = None,
        bulk: bool = False,
    ) -> bytes | None:
        question = SessionQuestion(
            key=key, payload=payload, parameters=dict(parameters or {}), timeout_s=timeout_s
        )
        replies = self._answers(question)
        return replies[0] if replies else None

    def ask_all(self, key: str, payload: bytes = b"", *, timeout_s: float) -> list[bytes]:
        question = SessionQuestion(key=key, payload=payload, parameters={}, timeout_s=timeout_s, every=True)
        return self._answers(question)

    def watch_presence(self, key: str, changed: Presence) -> None:
        """Call `changed` with what the session has found; an own link continues."""
        if self._own is not None:
            self._own.watch_presence(key, changed)
        else:
            self._presence.append((key, changed))
            changed(key, True)

    def serve(self, key: str, answer: Answering) -> None:
        self._own_link().serve(key, answer)

    def publisher(self, key: str, *, bulk: bool = False) -> Publish:
        return self._own_link().publisher(key, bulk=bulk)

    def announce(self, key: str) -> None:
        self._own_link().announce(key)

    def hear(self, key: str, heard: Hearing) -> None:
        self._own_link().hear(key, heard)

    def close(self) -> None:
        """Leave the session; the own link is closed by whoever opened it."""
        if self._conversation is not None:
            self._conversation.close()
            self._conversation = None

    def _answers(self, question: SessionQuestion) -> list[bytes]:
        began = time.monotonic()
        replies = self._through_session(question)
        if replies:
            return list(replies)
        try:
            own = self._own_link()
        except InputError:  # such as keys that were removed meanwhile
            if self._asked is None:
                raise
            self._left_s = question.timeout_s
            return list(self._through_session(question))
        left_s = max(question.timeout_s - (time.monotonic() - began), 0.0)
        if question.every:
            return own.ask_all(question.key, question.payload, timeout_s=left_s)
        reply = own.ask(question.key, question.payload, timeout_s=left_s, parameters=question.parameters)
        return [] if reply is None else [reply]

    def _own_link(self) -> Link:
        if self._own is None:
            self._own = self._open_own()
            for key, changed in self._presence:
                self._own.watch_presence(key, changed)
        return self._own

    def _through_session(self, question: SessionQuestion) -> tuple[bytes, ...]:
        """Return the session's answers if they come in time; the next try takes answers that are late."""
        if self._conversation is None:
            return ()
        try:
            answers = self._converse(self._conversation, question)
        except (OSError, msgspec.DecodeError):
            self.close()
            return ()
        if answers is None:
            return ()
        self._asked, self._distrusted = None, answers.distrusted
        if answers.replies:
            self._left_s = SESSION_S
        else:
            self.close()
        return answers.replies

    def _converse(self, conversation: Conversation, question: SessionQuestion) -> SessionAnswers | None:
        began = time.monotonic()
        if self._asked is None:
            self._asked = question
            conversation.send(question, within_s=self._left_s)
        if not _same(self._asked, question):
            return None
        answers = conversation.receive(SessionAnswers, within_s=self._left_s)
        self._left_s = max(0.0, self._left_s - (time.monotonic() - began))
        return answers


def _same(one: SessionQuestion, other: SessionQuestion) -> bool:
    """True if two questions differ at most in the time for an answer."""
    return (one.key, one.payload, one.parameters) == (other.key, other.payload, other.parameters)


@contextmanager
def connect_shared(
    options: SessionOptions, *, timeout_s: float, at_once: bool, say: Callable[[str], None]
) -> Iterator[Station]:
    """Connect to a robot through the user's open session, or by an own one if there is none of use.

    Raises
    ------
    RobotUnreachable
        If the robot was not found within `timeout_s`; nothing was sent.
    """
    with ExitStack() as opened:
        began = time.monotonic()
        met = _open_session(options, say)
        if met is None:
            with connect(
                options.endpoint, robot=options.robot, site=options.site, commander=options.commander,
                timeout_s=timeout_s, insecure=options.insecure, keys=options.keys, at_once=at_once,
            ) as station:  # fmt: skip
                yield station
            return
        conversation, greeting = met
        left_s = max(0.0, SESSION_S - (time.monotonic() - began))
        link = SessionLink(
            conversation, greeting, lambda: opened.enter_context(_own_link(options, timeout_s)), left_s=left_s
        )
        opened.callback(link.close)
        opened.callback(lambda: say(f"{options.robot}: {link.path_text}"))
        keys = KeyExpressions(options.robot, options.site)
        station = Station(link, keys, commander=greeting.commander, timeout_s=timeout_s)
        station.look_for(options.endpoint, why=lambda: why_no_link(options.endpoint, _held(options)))
        yield station


def _held(options: SessionOptions) -> HeldKeys | None:
    return None if options.keys is None else read_keys(options.keys, now=now_utc())


@contextmanager
def _own_link(options: SessionOptions, open_s: float) -> Iterator[Link]:
    from stopgo.bridge.link.zenoh_link import Guard, connecting

    with connecting(options.endpoint, Guard(_held(options), options.insecure), open_s=open_s) as link:
        yield link


def _open_session(
    options: SessionOptions, say: Callable[[str], None]
) -> tuple[Conversation, Greeting] | None:
    """Return the user's open session and its greeting; `None` if there is none that can be used."""
    if not has_unix_sockets() or len(os.fsencode(path := options.path)) > LONGEST_PATH:
        return None
    if not os.path.exists(path):  # also where its folder may not be entered
        return None
    connected = socket.socket(socket.AF_UNIX)
    try:
        check_private(path.parent)
        connected.settimeout(SESSION_S)
        connected.connect(str(path))
        greeting = _greeted(connected)
    except (OSError, msgspec.DecodeError):  # stale: its process was killed; or frozen
        greeting, why = None, "does not answer"
    except InputError as error:
        greeting, why = None, str(error)
    else:
        if greeting is not None and greeting.found:
            return Conversation(connected), greeting
        why = "does not answer" if greeting is None else "has no link to the robot"
    connected.close()
    say(f"{options.robot}: the open session at {path} is not used ({why}); sent by a session of its own")
    return None


def _greeted(connected: socket.socket) -> Greeting | None:
    """Return the greeting of this user's session, in time."""
    if not is_same_user(connected):
        raise InputError("it belongs to another user")
    greeting = Conversation(connected).receive(Greeting, within_s=SESSION_S)
    return greeting if greeting is not None and greeting.version == SESSION_VERSION else None
