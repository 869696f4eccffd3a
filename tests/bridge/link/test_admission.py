"""Strangers, however many, do not keep holders out; and nobody else gets through to zenoh."""

from __future__ import annotations

import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from stopgo.bridge.link import admission as admissions
from stopgo.bridge.link.admission import Admission, inner_endpoints, listening_socket
from stopgo.bridge.link.authority import init_site, issue, revoke
from stopgo.bridge.link.direct_question import PROTOCOL, DirectQuestion
from stopgo.bridge.link.keys import now_utc, read_keys
from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.link.signatures import KeySigning
from stopgo.bridge.link.zenoh_link import Guard, ZenohLink, admitting
from stopgo.bridge.robot.agent import Agent, on_link
from stopgo.bridge.station.station import connect
from stopgo.mission.errors import InputError, NegativeResult
from tests.bridge.world import Field, corridor
from tests.ports import free_port

NET_S = 30.0
"""Longest wait of a test that has failed."""
BYTES = 3_000_000


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("admission")
    for name in ("site", "other"):
        init_site(folder / name, now=now_utc())
    for role, name in (("robot", "r1"), ("station", "alice"), ("station", "bob"), ("station", "mallory")):
        issue(folder / "site", role, name, now=now_utc())  # type: ignore[arg-type]
    issue(folder / "other", "station", "stranger", now=now_utc())
    return folder


def tls(keys: Path | None, protocol: int = ssl.PROTOCOL_TLS_CLIENT) -> ssl.SSLContext:
    context = ssl.SSLContext(protocol)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    if keys is not None:
        context.load_verify_locations(str(keys / "ca.pem"))
        context.load_cert_chain(str(keys / "cert.pem"), str(keys / "key.pem"))
    return context


class Echo:
    """Listener behind the admission that sends back all that it receives."""

    def __init__(self, listener: socket.socket, context: ssl.SSLContext | None) -> None:
        self.listener, self.context, self.met = listener, context, 0
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                accepted, _ = self.listener.accept()
                self.met += 1
                threading.Thread(target=self._echo, args=(accepted,), daemon=True).start()

    def _echo(self, accepted: socket.socket) -> None:
        with suppress(OSError):
            line = accepted if self.context is None else self.context.wrap_socket(accepted, server_side=True)
            with line:
                while data := line.recv(65536):
                    line.sendall(data)


@dataclass
class Robot:
    """The end that admits."""

    site: Path
    port: int
    admission: Admission
    zenoh: Echo
    own: Echo
    refused: list[str]
    failures: list[Exception] = field(default_factory=list)

    def reached(
        self, name: str = "alice", *, site: str = "site", address: str = "127.0.0.1"
    ) -> ssl.SSLSocket:
        """A connection with the keys of that holder, after its own part of the handshake."""
        line = self.plain(address)
        return tls(self.site / site / name).wrap_socket(line)

    def plain(self, address: str = "127.0.0.1") -> socket.socket:
        """A connection that has said nothing."""
        line = socket.socket()
        line.settimeout(NET_S)
        line.bind((address, 0))
        line.connect(("127.0.0.1", self.port))
        return line

    def half_open(self, address: str) -> socket.socket:
        """A connection that has begun a handshake and does not go on."""
        line = self.plain(address)
        sent, into = ssl.MemoryBIO(), ssl.MemoryBIO()
        with suppress(ssl.SSLWantReadError):
            tls(None).wrap_bio(into, sent).do_handshake()
        line.sendall(sent.read())
        return line


@pytest.fixture
def robot(site: Path, tmp_path: Path) -> Iterator[Robot]:
    held, port, refused = read_keys(site / "site" / "r1", now=now_utc()), free_port(), list[str]()
    with ExitStack() as opened:
        inner = opened.enter_context(inner_endpoints(tmp_path))
        zenoh = opened.enter_context(socket.create_server(("127.0.0.1", inner.port)))
        own = opened.enter_context(socket.socket(socket.AF_UNIX))
        own.bind(str(inner.own))
        own.listen()
        listener = listening_socket(f"tls/127.0.0.1:{port}")
        admission = Admission(listener, held, inner, refused.append)
        robot = Robot(
            site, port, admission, Echo(zenoh, tls(site / "site" / "r1", ssl.PROTOCOL_TLS_SERVER)),
            Echo(own, None), refused,
        )  # fmt: skip
        admission.failed = robot.failures.append
        with admission.running():
            yield robot
        assert robot.failures == []


def answered(line: socket.socket, said: bytes = b"hello") -> bool:
    """True if what is sent comes back; false if the connection is closed."""
    try:
        line.sendall(said)
        return line.recv(100) == said
    except OSError:
        return False


def closed(line: socket.socket) -> bool:
    """True if the other end closes the connection, which is waited for."""
    try:
        return line.recv(1) == b""
    except TimeoutError:
        raise
    except OSError:
        return True


def test_a_holder_is_admitted_and_large_data_goes_in_both_directions(robot: Robot) -> None:
    with robot.reached() as line:
        sent = bytes(range(256)) * (BYTES // 256)
        sending = threading.Thread(target=line.sendall, args=(sent,))
        sending.start()
        received = bytearray()
        while len(received) < len(sent):
            received += line.recv(65536)
        sending.join()
    assert received == sent
    assert (robot.zenoh.met, robot.own.met) == (1, 0)


def test_the_robots_own_keys_go_by_the_unix_socket(robot: Robot) -> None:
    with robot.reached("r1") as line:
        assert answered(line)
    assert (robot.zenoh.met, robot.own.met) == (0, 1)


def test_nobody_else_reaches_zenoh(robot: Robot) -> None:
    with robot.plain() as garbage, robot.plain() as anonymous:
        garbage.sendall(b"GET / HTTP/1.1\r\n\r\n")
        assert closed(garbage)
        with suppress(OSError), tls(None).wrap_socket(anonymous) as line:
            assert not answered(line)
    with robot.reached("stranger", site="other") as stranger:
        assert not answered(stranger)
    assert (robot.zenoh.met, robot.own.met) == (0, 0)


def test_a_holder_whose_keys_are_revoked_is_shut_out_also_while_connected(
    robot: Robot, tmp_path: Path
) -> None:
    with robot.reached("mallory") as line:
        assert answered(line)
        revoke(robot.site / "site", "mallory")
        assert closed(line)
    with robot.reached("mallory") as again:
        assert not answered(again)
    assert {why.rpartition(" ")[2] for why in robot.refused} == {"revoked"}
    with robot.reached() as line:
        assert answered(line)


def address(number: int) -> str:
    return f"127.0.{1 + number // 250}.{1 + number % 250}"


def test_connections_that_say_nothing_are_closed_the_oldest_first(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(admissions, "SILENT", 20)
    with ExitStack() as opened:
        silent = [opened.enter_context(robot.plain(address(number))) for number in range(30)]
        assert all(closed(line) for line in silent[:10])
        with robot.reached() as line:
            assert answered(line)
        assert closed(silent[10])  # the holder was silent for a moment, too
        assert [one.address for one in robot.admission._connections][:19] == [
            address(n) for n in range(11, 30)
        ]


def test_handshakes_that_do_not_go_on_are_closed_the_oldest_first(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(admissions, "HANDSHAKES", 20)
    with ExitStack() as opened:
        half = [opened.enter_context(robot.half_open(address(number))) for number in range(30)]
        for line in half[:10]:
            while not closed(line):  # what the handshake has sent comes first
                pass
        with robot.reached() as line:
            assert answered(line)
    assert robot.zenoh.met == 1


def test_many_connections_of_one_address_displace_nobody_elses(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(admissions, "SILENT", 10)
    with ExitStack() as opened:
        other = opened.enter_context(robot.plain("127.0.0.2"))
        many = [opened.enter_context(robot.plain("127.0.0.3")) for _ in range(20)]
        assert all(closed(line) for line in many[:11])
        assert answered(tls(robot.site / "site" / "alice").wrap_socket(other))


def test_strangers_displace_no_address_of_a_holder(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(admissions, "SILENT", 10)
    with robot.reached(address="127.0.0.2") as line:
        assert answered(line)
    with ExitStack() as opened:
        known = [opened.enter_context(robot.plain("127.0.0.2")) for _ in range(5)]
        strangers = [opened.enter_context(robot.plain(address(number))) for number in range(30)]
        assert all(closed(line) for line in strangers[:25])
        context = tls(robot.site / "site" / "alice")
        assert all(answered(opened.enter_context(context.wrap_socket(line))) for line in known)


def test_one_certificate_has_so_many_connections_and_a_further_one_replaces_the_oldest(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(admissions, "EACH_HOLDER", 4)
    with ExitStack() as opened:
        others = opened.enter_context(robot.reached("bob"))
        assert answered(others)
        lines = []
        for _ in range(6):
            lines.append(opened.enter_context(robot.reached()))
            assert answered(lines[-1])
        assert all(closed(line) for line in lines[:2])
        assert all(answered(line) for line in (*lines[2:], others))


def test_what_takes_too_long_is_closed(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(admissions, "SILENT_S", 0.0)
    monkeypatch.setattr(admissions, "HANDSHAKE_S", 0.0)
    with robot.plain() as silent, robot.half_open("127.0.0.1") as half:
        assert closed(silent)
        while not closed(half):
            pass


def test_a_connection_to_a_zenoh_that_is_gone_is_closed(robot: Robot) -> None:
    robot.zenoh.listener.shutdown(socket.SHUT_RDWR)
    robot.zenoh.listener.close()
    with robot.reached() as line:
        assert not answered(line)


def test_an_error_that_ends_the_admission_is_reported(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    ended = threading.Event()

    def broken(connection: object) -> None:
        raise ZeroDivisionError

    robot.admission.failed = lambda error: ended.set()
    monkeypatch.setattr(robot.admission, "_advance", broken)
    with robot.plain() as line:
        line.sendall(b"x")
        assert ended.wait(NET_S)


def test_an_address_that_is_taken_is_named(robot: Robot) -> None:
    with pytest.raises(
        InputError, match=f"tls/127.0.0.1:{robot.port}: cannot be opened .* is the address free"
    ):
        listening_socket(f"tls/127.0.0.1:{robot.port}")


# Questions on connections of their own


def asked(robot: Robot, key: str, name: str = "alice") -> DirectQuestion:
    """A question after its thread has ended."""
    held = read_keys(robot.site / "site" / name, now=now_utc())
    question = DirectQuestion(f"tls/127.0.0.1:{robot.port}", held, key, b"why", timeout_s=NET_S)
    question.thread.join(NET_S)
    return question


def answering(robot: Robot) -> list[Request]:
    """The questions that the robot's end has answered."""
    requests: list[Request] = []

    def answer(request: Request) -> bytes:
        requests.append(request)
        return b"because"

    held = read_keys(robot.site / "site" / "r1", now=now_utc())
    robot.admission.answers["sx/1/r1/info"] = KeySigning(held, boot_id="b1").sign_answers(answer)
    return requests


def test_a_direct_question_is_answered_without_zenoh(robot: Robot) -> None:
    requests = answering(robot)
    question = asked(robot, "sx/1/r1/info")
    assert (question.reply, question.may_be_sent) == (b"because", True)
    assert [(one.key, one.payload, one.holder and one.holder.name) for one in requests] == [
        ("sx/1/r1/info", b"why", "alice")
    ]
    assert asked(robot, "sx/1/r1/cmd/start").reply is None
    assert (robot.zenoh.met, len(requests)) == (0, 1)


def test_an_answer_that_another_end_has_signed_is_not_taken(robot: Robot) -> None:
    held = read_keys(robot.site / "site" / "bob", now=now_utc())
    robot.admission.answers["sx/1/r1/info"] = KeySigning(held, boot_id="b1").sign_answers(
        lambda request: b"no"
    )
    assert asked(robot, "sx/1/r1/info").reply is None


@pytest.mark.parametrize("said", [b"nonsense\n", b"{}\n", b"x" * 100_000, b'{"key":1}\n'])
def test_a_direct_question_that_is_none_is_closed(robot: Robot, said: bytes) -> None:
    requests = answering(robot)
    context = tls(robot.site / "site" / "alice")
    context.set_alpn_protocols([PROTOCOL])
    with context.wrap_socket(robot.plain()) as line:
        with suppress(OSError):
            line.sendall(said)
        assert closed(line)
    assert requests == []
    assert asked(robot, "sx/1/r1/info").reply == b"because"


def test_more_direct_questions_than_are_answered_at_a_time_are_closed(robot: Robot) -> None:
    requests = answering(robot)
    context = tls(robot.site / "site" / "alice")
    context.set_alpn_protocols([PROTOCOL])
    with ExitStack() as opened:
        for _ in range(admissions.DIRECT):
            opened.enter_context(context.wrap_socket(robot.plain()))
        while asked(robot, "sx/1/r1/info").reply is not None:  # until all of them have a thread
            pass
        with robot.reached() as line:
            assert answered(line)
    while asked(robot, "sx/1/r1/info").reply is None:
        pass
    assert requests


def test_an_end_that_knows_no_direct_questions_is_not_sent_any(robot: Robot) -> None:
    held = read_keys(robot.site / "site" / "alice", now=now_utc())
    port = robot.zenoh.listener.getsockname()[1]
    question = DirectQuestion(f"tls/127.0.0.1:{port}", held, "sx/1/r1/info", b"", timeout_s=NET_S)
    question.thread.join(NET_S)
    assert (question.reply, question.may_be_sent) == (None, False)


@pytest.mark.parametrize("zenoh_answers", [False, True])
def test_a_stop_is_carried_out_once_by_whichever_connection(
    site: Path, tmp_path: Path, zenoh_answers: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not zenoh_answers:
        monkeypatch.setattr(ZenohLink, "ask", lambda self, *question, **options: None)
    with robot_of(site, tmp_path) as (field, endpoint):
        field.station().push(corridor())
        field.order("start")
        with connect(
            endpoint, robot="r1", keys=site / "site" / "alice", timeout_s=NET_S, at_once=True
        ) as station:
            assert station.command("pause").state == "PAUSED"
            assert station.command("abort").state == "ABORTED"
        assert field.told() == ["Started", "Paused", "Aborted"]


@contextmanager
def robot_of(site: Path, state: Path) -> Iterator[tuple[Field, str]]:
    """A robot with keys at an endpoint; it does not work by itself."""
    field, endpoint = Field(), f"tls/127.0.0.1:{free_port()}"
    field.controller.works = ()
    held = read_keys(site / "site" / "r1", now=now_utc())
    guard = Guard(held, boot_id=field.controller.boot_id, state=state)
    with admitting(endpoint, guard) as link:
        agent = Agent(
            keys=KeyExpressions("r1"), link=link, journal=field.journal, runner=field.controller,
            clock=field.clock, command_clock=field.clock,
        )  # fmt: skip
        with on_link(agent):
            yield field, endpoint


def test_a_stop_of_a_new_station_is_answered_during_floods(site: Path, tmp_path: Path) -> None:
    """More connections than there may be, from as many addresses: silent, or stopped in their handshake."""
    with ExitStack() as opened:
        _, endpoint = opened.enter_context(robot_of(site, tmp_path))
        reached = Robot(site, int(endpoint.rpartition(":")[2]), None, None, None, [])  # type: ignore[arg-type]
        for number in range(300):
            opened.enter_context(reached.plain(address(number)))
        for number in range(100):
            opened.enter_context(reached.half_open(address(number)))
        keys = site / "site" / "alice"
        with (
            connect(endpoint, robot="r1", keys=keys, timeout_s=NET_S, at_once=True) as station,
            pytest.raises(NegativeResult, match="no_mission"),
        ):
            station.command("pause")
