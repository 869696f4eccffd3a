"""Commands share a session that their user holds open; no fault of it keeps a command from the robot."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from stopgo.bridge.link.memory_link import MemoryLink
from stopgo.bridge.station import session_link, session_socket, shared_session
from stopgo.bridge.station.session_link import SessionLink, _open_session, connect_shared
from stopgo.bridge.station.session_socket import (
    Conversation,
    Greeting,
    SessionAnswers,
    SessionOptions,
    SessionQuestion,
    check_private,
)
from stopgo.bridge.station.shared_session import SharedSession, listening_at
from stopgo.bridge.station.station import Station
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.run.run_commands import Answer
from tests.bridge.world import Field, corridor

OPTIONS = SessionOptions(endpoint="tcp/127.0.0.1:7447", robot="r1")
NET_S = 20.0
"""Deadline of what always happens."""

pytestmark = pytest.mark.skipif(not session_socket.has_unix_sockets(), reason="needs Unix sockets")


class CountingLink(MemoryLink):
    """Counts the questions; with `deaf` it loses every answer."""

    asked = 0
    deaf = False

    def ask(
        self,
        key: str,
        payload: bytes = b"",
        *,
        timeout_s: float,
        parameters: Mapping[str, str] | None = None,
        bulk: bool = False,
    ) -> bytes | None:
        self.asked += 1
        answer = super().ask(key, payload, timeout_s=timeout_s, parameters=parameters)
        return None if self.deaf else answer


class World:
    """A robot that drives, the link of an open session, and the link of a command's own session."""

    def __init__(self) -> None:
        self.field = Field()
        self.field.serve()
        self.field.board.alive.add(self.field.keys.alive)
        self.shared, self.own = CountingLink(self.field.board), CountingLink(self.field.board)
        self.said: list[str] = []
        self.own_opened = 0
        Station(self.own, self.field.keys, commander="test", timeout_s=NET_S).push(corridor())
        assert self.field.order("start").outcome == "ok"
        self.own.asked = 0

    @contextmanager
    def own_link(self, options: SessionOptions, open_s: float) -> Iterator[CountingLink]:
        self.own_opened += 1
        yield self.own

    @contextmanager
    def session(self, path: Path) -> Iterator[None]:
        """Hold a session open in a thread."""
        shared = SharedSession(self.shared, token=self.field.keys.alive, commander="alice")
        with (
            listening_at(path) as listener,
            serving(lambda one: shared._converse(Conversation(one)), listener),
        ):
            yield

    def pause(self, options: SessionOptions = OPTIONS) -> Answer:
        with connect_shared(options, timeout_s=5.0, at_once=True, say=self.said.append) as station:
            return station.command("pause")

    @property
    def pauses(self) -> int:
        return sum(word.startswith("Paused") for word in self.field.told())


@contextmanager
def serving(serve: Callable[[socket.socket], None], listener: socket.socket) -> Iterator[None]:
    """Serve one connection in a thread."""

    def served() -> None:
        with suppress(OSError):  # the test is over
            connected, _ = listener.accept()
            with connected:
                serve(connected)

    thread = threading.Thread(target=served, daemon=True)
    thread.start()
    yield


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    made = World()
    monkeypatch.setattr(session_link, "_own_link", made.own_link)
    monkeypatch.setattr(session_link, "SESSION_S", NET_S)  # no answer depends on the machine's speed
    with TemporaryDirectory() as folder:  # the path of a socket is short
        monkeypatch.setenv("XDG_STATE_HOME", folder)
        yield made


def test_a_pause_goes_through_the_open_session_alone(world: World) -> None:
    with world.session(OPTIONS.path):
        assert world.pause().outcome == "ok"
    assert (world.shared.asked, world.own_opened) == (1, 0)
    assert world.said == [f"r1: sent through the open session of process {os.getpid()}"]


def test_a_state_is_read_through_the_open_session(world: World) -> None:
    with (
        world.session(OPTIONS.path),
        connect_shared(OPTIONS, timeout_s=5.0, at_once=False, say=world.said.append) as station,
    ):
        assert station.status().state == "RUNNING"
    assert world.own_opened == 0


def greet(connected: socket.socket) -> Conversation:
    conversation = Conversation(connected)
    conversation.send(Greeting(version=1, process=7, commander="alice", found=True), within_s=NET_S)
    return conversation


def link_to(world: World, *, left_s: float) -> SessionLink:
    """A link to the open session that has greeted, with a certain time to wait for it."""
    met = _open_session(OPTIONS, world.said.append)
    assert met is not None
    return SessionLink(*met, lambda: world.own, left_s=left_s)


def test_a_session_that_freezes_after_its_greeting_does_not_hold_a_pause(world: World) -> None:
    over = threading.Event()

    def freeze(connected: socket.socket) -> None:
        greet(connected)
        over.wait(NET_S)

    with listening_at(OPTIONS.path) as listener, serving(freeze, listener):
        link = link_to(world, left_s=0.01)
        assert Station(link, world.field.keys, commander="alice").command("pause").outcome == "ok"
        over.set()
        link.close()
    assert world.own.asked == 1
    assert "sent by a session of its own as well" in link.path_text


def test_a_session_that_dies_after_it_was_asked_does_not_hold_a_pause(world: World) -> None:
    def die(connected: socket.socket) -> None:
        greet(connected).receive(SessionQuestion, within_s=NET_S)

    with listening_at(OPTIONS.path) as listener, serving(die, listener):
        assert world.pause().outcome == "ok"
    assert world.own.asked == 1


def test_a_pause_that_takes_both_paths_counts_once(world: World) -> None:
    world.shared.deaf = True  # the robot pauses, and the session never learns of it
    with world.session(OPTIONS.path):
        assert world.pause().outcome == "ok"
    assert (world.shared.asked, world.own.asked) == (1, 1)
    assert world.pauses == 1


def test_a_late_answer_of_the_session_is_taken(world: World) -> None:
    over = threading.Event()

    def late(connected: socket.socket) -> None:
        conversation = greet(connected)
        conversation.receive(SessionQuestion, within_s=NET_S)
        over.wait(NET_S)
        conversation.send(SessionAnswers(replies=(b"late",)), within_s=NET_S)
        conversation.receive(SessionQuestion, within_s=NET_S)

    with listening_at(OPTIONS.path) as listener, serving(late, listener):
        link = link_to(world, left_s=0.01)
        world.own.deaf = True
        assert link.ask("k", b"p", timeout_s=5.0) is None
        over.set()
        link._left_s = NET_S
        assert link.ask("k", b"p", timeout_s=4.0) == b"late"
        link.close()


@pytest.fixture
def alone(world: World, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names the commands that connected without any open session."""
    connected: list[str] = []

    @contextmanager
    def connect(endpoint: str, **options: object) -> Iterator[object]:
        connected.append(endpoint)
        yield world.field.station_at_the_link("alice")

    monkeypatch.setattr(session_link, "connect", connect)
    return connected


def test_without_an_open_session_a_command_uses_its_own_and_says_nothing(
    world: World, alone: list[str]
) -> None:
    assert world.pause().outcome == "ok"
    assert alone == [OPTIONS.endpoint]
    assert world.said == []


def test_the_socket_of_a_killed_process_is_passed_over_and_replaced(world: World, alone: list[str]) -> None:
    OPTIONS.path.parent.mkdir(mode=0o700, parents=True)
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(OPTIONS.path))
    assert world.pause().outcome == "ok"
    assert alone
    assert "is not used (does not answer)" in world.said[0]
    with world.session(OPTIONS.path), pytest.raises(NegativeResult, match="is PAUSED"):
        world.pause()
    assert world.shared.asked == 1
    assert not OPTIONS.path.exists()


def test_a_frozen_session_that_does_not_greet_is_passed_over(
    world: World, alone: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_link, "SESSION_S", 0.01)
    with listening_at(OPTIONS.path):  # nobody accepts
        assert world.pause().outcome == "ok"
    assert "is not used (does not answer)" in world.said[0]


def test_a_session_without_the_robot_is_passed_over(world: World, alone: list[str]) -> None:
    world.field.board.alive.clear()
    with world.session(OPTIONS.path):
        assert world.pause().outcome == "ok"
    assert world.shared.asked == 0
    assert "is not used (has no link to the robot)" in world.said[0]


def test_a_path_that_is_too_long_for_a_socket_is_refused_and_passed_over(
    world: World, alone: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / ("long" * 30)))
    assert world.pause().outcome == "ok"
    with pytest.raises(InputError, match="too long for a socket"), listening_at(OPTIONS.path):
        raise AssertionError


@pytest.mark.parametrize(
    "other",
    [
        SessionOptions(endpoint="tcp/127.0.0.1:7448", robot="r1"),
        SessionOptions(endpoint="tcp/127.0.0.1:7447", robot="r2"),
        SessionOptions(endpoint="tcp/127.0.0.1:7447", robot="r1", site="north"),
        SessionOptions(endpoint="tcp/127.0.0.1:7447", robot="r1", commander="bob"),
        SessionOptions(endpoint="tcp/127.0.0.1:7447", robot="r1", keys=Path("keys/alice")),
        SessionOptions(endpoint="tcp/127.0.0.1:7447", robot="r1", insecure=True),
    ],
)
def test_a_session_serves_only_commands_with_equal_options(
    world: World, alone: list[str], other: SessionOptions
) -> None:
    with world.session(OPTIONS.path):
        world.pause(other)
    assert (world.shared.asked, alone) == (0, [other.endpoint])


def test_a_second_process_cannot_hold_the_same_session(world: World) -> None:
    with (
        listening_at(OPTIONS.path),
        pytest.raises(InputError, match="another process holds this session"),
        listening_at(OPTIONS.path),
    ):
        raise AssertionError
    with listening_at(OPTIONS.path):
        pass


def test_only_the_owner_can_reach_the_socket(world: World) -> None:
    with listening_at(OPTIONS.path):
        assert OPTIONS.path.stat().st_mode & 0o777 == 0o600
        assert OPTIONS.path.parent.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_others_can_enter_is_refused_at_both_ends(world: World, alone: list[str]) -> None:
    with world.session(OPTIONS.path):
        OPTIONS.path.parent.chmod(0o755)
        assert world.pause().outcome == "ok"
    assert (world.shared.asked, len(alone)) == (0, 1)
    assert "others can enter it; run: chmod 700" in world.said[0]
    with pytest.raises(InputError, match="others can enter it"), listening_at(OPTIONS.path):
        raise AssertionError


def test_a_link_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "theirs").mkdir(mode=0o700)
    (tmp_path / "link").symlink_to(tmp_path / "theirs")
    with pytest.raises(InputError, match="is not a folder of this user"):
        check_private(tmp_path / "link")


def test_a_folder_of_another_user_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tmp_path.chmod(0o700)
    monkeypatch.setattr(os, "geteuid", lambda: tmp_path.stat().st_uid + 1)
    with pytest.raises(InputError, match="is not a folder of this user"):
        check_private(tmp_path)


def test_a_process_of_another_user_is_not_asked(
    world: World, alone: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_link, "is_same_user", lambda connected: False)
    with world.session(OPTIONS.path):
        assert world.pause().outcome == "ok"
    assert world.shared.asked == 0
    assert "it belongs to another user" in world.said[0]


def test_a_session_closes_the_connection_of_another_user(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shared_session, "is_same_user", lambda connected: False)
    shared = SharedSession(world.shared, token=world.field.keys.alive, commander="alice")
    with listening_at(OPTIONS.path) as listener, socket.socket(socket.AF_UNIX) as stranger:
        threading.Thread(target=lambda: _serve_until_closed(shared, listener), daemon=True).start()
        stranger.connect(str(OPTIONS.path))
        stranger.settimeout(NET_S)
        assert stranger.recv(1) == b""


def _serve_until_closed(shared: SharedSession, listener: socket.socket) -> None:
    with suppress(OSError):
        shared.serve(listener)


@pytest.mark.skipif(not hasattr(socket, "SO_PEERCRED"), reason="needs SO_PEERCRED")
def test_the_user_of_the_other_end_is_read_from_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = socket.socketpair(socket.AF_UNIX)
    with one, other:
        assert session_socket.is_same_user(one)
        user = os.geteuid()
        monkeypatch.setattr(os, "geteuid", lambda: user + 1)
        assert not session_socket.is_same_user(one)
