"""Admission of connections to a robot, so that strangers cannot keep stations out.

zenoh's TLS listener takes 64 handshakes at a time, and waits 0.1 s after each that fails. A stranger who
opens a few connections a second therefore keeps every new station out, also for a minute afterwards. So the
robot accepts connections itself. It relays a connection to zenoh after its TLS handshake, and only if its
certificate is valid and not revoked. A connection is

silent      until something arrives: at most `SILENT`, each for `SILENT_S`,
new         during its TLS handshake: at most `HANDSHAKES`, each for `HANDSHAKE_S`,
admitted    until either end closes it, or its certificate is no longer valid: at most `EACH_HOLDER` of one
            certificate. A further one replaces the oldest. One that carries a single question
            (`direct_question`) is answered here.

Where there are too many, one is closed: strangers' before those at an address of an admitted holder, of the
address with the most connections, the oldest first. So a flood closes its own connections.

The way to zenoh is TLS as well, with the robot's own keys, for a small send buffer keeps urgent messages
fast. A holder of the robot's own keys (its tunnel) goes by a Unix socket, by which zenoh's access rules
know it.
"""

from __future__ import annotations

import os
import selectors
import socket
import ssl
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from stopgo.bridge.link.direct_question import PROTOCOL, answer_directly
from stopgo.bridge.link.keys import Certificates, HeldKeys, Holder, Untrusted, now_utc
from stopgo.bridge.link.relay_end import RelayEnd
from stopgo.bridge.link.signatures import SignedAnswering
from stopgo.mission.console.ports import free_port
from stopgo.mission.errors import InputError

SILENT, SILENT_S = 256, 5.0
HANDSHAKES, HANDSHAKE_S = 256, 10.0
EACH_HOLDER = 32
DIRECT = 32
"""Most questions that are answered at a time on connections of their own."""
NEWCOMERS, ACCEPTED = 4, 32
"""Most steps of handshakes, and most accepted connections, before admitted connections have their turn."""
ADDRESSES = 1024
"""Addresses of admitted holders that are remembered."""
LOOK_S = 0.25
"""Interval at which times and certificates are checked."""
CHUNK_BYTES = 8192
"""Data that is in the relay for each direction: no urgent message overtakes it."""
CHUNKS = 8
"""Chunks of one connection that are relayed before the others have their turn."""
BUFFER_BYTES = 32 * 1024
BACKLOG = 1024
SOCKET, LONGEST_PATH = "own.sock", 90
"""Name of the Unix socket, and the longest path of one in bytes; zenoh adds a few letters to it."""
CONNECT_S = 1.0
FILES = 4096
"""Open files that the process may need."""


@dataclass(eq=False)
class RelayedConnection:
    """A connection from outside, and the one to zenoh once it is admitted."""

    outer: RelayEnd
    address: str
    began_s: float
    has_spoken: bool = False
    certificate: bytes = b""
    inner: RelayEnd | None = None

    @property
    def ends(self) -> tuple[RelayEnd, ...]:
        return (self.outer,) if self.inner is None else (self.outer, self.inner)


@dataclass(frozen=True)
class InnerEndpoints:
    """Endpoints at which zenoh receives admitted connections: on this machine only."""

    port: int
    """Port of 127.0.0.1, with TLS."""
    own: Path
    """Unix socket for holders of the robot's own keys."""

    @property
    def endpoints(self) -> list[str]:
        """The endpoints as zenoh has them."""
        return [f"tls/127.0.0.1:{self.port}", f"unixsock-stream/{self.own}"]


@contextmanager
def inner_endpoints(state: Path | None) -> Iterator[InnerEndpoints]:
    """Yield a free port, and the path of a socket in a folder that this user alone can enter."""
    folder = Path(tempfile.gettempdir()) if state is None else state / "link"
    if state is not None and len(os.fsencode(folder / SOCKET)) <= LONGEST_PATH:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.chmod(0o700)
        yield InnerEndpoints(free_port(), folder / SOCKET)
        return
    with tempfile.TemporaryDirectory(prefix="stopgo-") as temporary:
        yield InnerEndpoints(free_port(), Path(temporary) / SOCKET)


def can_admit(endpoint: str) -> bool:
    """True if connections to this endpoint can be admitted here: `tls/` without settings of zenoh."""
    return os.name == "posix" and endpoint.startswith("tls/") and not set("?#") & set(endpoint)


def listening_socket(endpoint: str) -> socket.socket:
    """Return a socket that listens at an endpoint, such as `tls/0.0.0.0:7447`.

    Raises
    ------
    InputError
        If the address is taken, or not one of this machine.
    """
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    try:
        family, _, _, _, address = socket.getaddrinfo(host.strip("[]"), int(port), type=socket.SOCK_STREAM)[0]
        listener = socket.create_server(address[:2], family=family, backlog=BACKLOG)
    except OSError as error:
        raise InputError(
            f"{endpoint}: cannot be opened ({error.strerror or error}); is the address free?"
        ) from None
    listener.setblocking(False)
    return listener


@dataclass(eq=False)
class Admission:
    """Accepts connections at a listening socket, and relays those of holders to zenoh."""

    listener: socket.socket
    held: HeldKeys
    inner: InnerEndpoints
    refused: Callable[[str], None]
    state: Path | None = None
    answers: dict[str, SignedAnswering] = field(default_factory=dict)
    """Answers to questions on connections of their own, by key (`direct_question`)."""
    failed: Callable[[Exception], None] = lambda error: None
    """Called with an error that ended the relay."""
    _connections: dict[RelayedConnection, None] = field(default_factory=dict)
    """All connections, the oldest first."""
    _known: dict[str, None] = field(default_factory=dict)
    """Addresses of admitted holders, the last first admitted last."""

    def __post_init__(self) -> None:
        self._certificates = Certificates(self.held, now_utc, self.state)
        self._outer_tls = _context(self.held, ssl.PROTOCOL_TLS_SERVER)
        self._inner_tls = _context(self.held, ssl.PROTOCOL_TLS_CLIENT)
        self._selector = selectors.DefaultSelector()
        self._outer_tls.set_alpn_protocols([PROTOCOL])
        self._free = threading.BoundedSemaphore(DIRECT)
        self._closing = threading.Event()
        self._looked_s = time.monotonic()
        self._unfinished: set[RelayedConnection] = set()
        _allow_files(FILES)

    @contextmanager
    def running(self) -> Iterator[None]:
        """Admit connections in a thread until the block ends."""
        thread = threading.Thread(target=self._run, name="admission", daemon=True)
        thread.start()
        try:
            yield
        finally:
            self._closing.set()
            thread.join()

    def _run(self) -> None:
        try:
            self._selector.register(self.listener, selectors.EVENT_READ, None)
            while not self._closing.is_set():
                self._turn()
        except Exception as error:  # noqa: BLE001 (the end of a thread)
            self.failed(error)
        finally:
            self.listener.close()
            for connection in list(self._connections):
                self._close(connection)
            self._selector.close()

    def _turn(self) -> None:
        """Wait for events, and handle them; check times and certificates now and then.

        Admitted connections come first. A handshake takes much of a millisecond of processor time, so a turn
        has few: at known addresses first, then the newest, for an old one may be nobody's.
        """
        due = self._selector.select(0.0 if self._unfinished else LOOK_S / 2)
        ready = {key.data for key, _ in due if key.data is not None} | self._unfinished
        self._unfinished = set()
        newcomers = [one for one in ready if one.inner is None]
        newcomers.sort(key=lambda one: (one.address in self._known, one.began_s), reverse=True)
        for connection in (*ready.difference(newcomers), *newcomers[:NEWCOMERS]):
            if connection in self._connections:
                self._advance(connection)
        if any(key.data is None for key, _ in due):
            self._accept()
        if time.monotonic() - self._looked_s > LOOK_S:
            self._looked_s = time.monotonic()
            self._close_late()

    def _accept(self) -> None:
        for _ in range(ACCEPTED):
            try:
                accepted, address = self.listener.accept()
            except BlockingIOError:
                return
            except OSError:  # too many open files: one fewer, and again
                self._close_one(has_spoken=False)
                return
            connection = RelayedConnection(RelayEnd(accepted), str(address[0]), time.monotonic())
            accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            accepted.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
            self._connections[connection] = None
            self._watch(connection, connection.outer, reads=True, writes=False)
            self._bound(SILENT, has_spoken=False)

    def _advance(self, connection: RelayedConnection) -> None:
        """Take the next step of a connection; close it if that fails."""
        try:
            if not connection.has_spoken:
                self._begin_handshake(connection)
            if connection.inner is not None or self._is_admitted(connection):
                self._relay(connection)
        except OSError:
            self._close(connection)
        except Untrusted as error:
            self.refused(str(error))
            self._close(connection)

    def _begin_handshake(self, connection: RelayedConnection) -> None:
        outer = connection.outer
        self._selector.unregister(outer.socket)
        connection.outer = RelayEnd(
            self._outer_tls.wrap_socket(outer.socket, server_side=True, do_handshake_on_connect=False)
        )
        connection.has_spoken = True
        self._bound(HANDSHAKES, has_spoken=True)

    def _is_admitted(self, connection: RelayedConnection) -> bool:
        """True if a connection's handshake is over; it then is connected to zenoh."""
        outer = connection.outer
        if connection not in self._connections:
            return False
        if not outer.shake_hands():
            self._watch(connection, outer, reads=True, writes=False)
            return False
        assert isinstance(outer.socket, ssl.SSLSocket)
        connection.certificate = outer.socket.getpeercert(binary_form=True) or b""
        holder, _ = self._certificates.holder(connection.certificate)
        self._remember(connection.address)
        if outer.socket.selected_alpn_protocol() == PROTOCOL:
            self._answer_directly(connection, outer.socket)
            return False
        self._replace_oldest_of(connection.certificate)
        connection.inner = RelayEnd(self._to_zenoh(holder))
        return True

    def _answer_directly(self, connection: RelayedConnection, line: ssl.SSLSocket) -> None:
        """Hand a connection to a thread that answers its question: an answer may wait for a disk."""
        if not self._free.acquire(blocking=False):
            raise ConnectionResetError
        del self._connections[connection]
        self._watch(connection, connection.outer, reads=False, writes=False)

        def answer() -> None:
            try:
                answer_directly(line, self.answers)
            finally:
                self._free.release()

        threading.Thread(target=answer, name="direct answer", daemon=True).start()

    def _to_zenoh(self, holder: Holder) -> socket.socket:
        """Return a connection to zenoh for a holder; with the robot's own keys it is the Unix socket's."""
        own = (holder.role, holder.name) == (self.held.holder.role, self.held.holder.name)
        if own:
            line = socket.socket(socket.AF_UNIX)
            line.settimeout(CONNECT_S)
            line.connect(str(self.inner.own))
            return line
        line = socket.socket()
        line.settimeout(CONNECT_S)
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, CHUNK_BYTES)
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        line.connect(("127.0.0.1", self.inner.port))
        return self._inner_tls.wrap_socket(line, do_handshake_on_connect=False)

    def _relay(self, connection: RelayedConnection) -> None:
        """Carry data in both directions, as far as both ends take it."""
        outer, inner = connection.outer, connection.inner
        assert inner is not None
        if inner.shake_hands():
            for source, target in ((outer, inner), (inner, outer)):
                self._carry(connection, source, target)
        if connection in self._connections:
            self._watch(
                connection, outer, reads=inner.is_ready and not inner.waiting, writes=bool(outer.waiting)
            )
            self._watch(connection, inner, reads=not outer.waiting, writes=bool(inner.waiting))

    def _carry(self, connection: RelayedConnection, source: RelayEnd, target: RelayEnd) -> None:
        target.send(b"")
        for _ in range(CHUNKS):
            data = None if target.waiting else source.receive(CHUNK_BYTES)
            if data is None:
                return
            if not data:
                raise ConnectionResetError
            target.send(data)
        self._unfinished.add(connection)

    def _watch(self, connection: RelayedConnection, end: RelayEnd, *, reads: bool, writes: bool) -> None:
        events = (selectors.EVENT_READ if reads else 0) | (selectors.EVENT_WRITE if writes else 0)
        if events == end.events:
            return
        if not end.events:
            self._selector.register(end.socket, events, connection)
        elif events:
            self._selector.modify(end.socket, events, connection)
        else:
            self._selector.unregister(end.socket)
        end.events = events

    # Bounds

    def _bound(self, most: int, *, has_spoken: bool) -> None:
        """Close one of the connections that are not admitted, if there are more than `most`."""
        if len(self._not_admitted(has_spoken=has_spoken)) > most:
            self._close_one(has_spoken=has_spoken)

    def _not_admitted(self, *, has_spoken: bool) -> list[RelayedConnection]:
        return [one for one in self._connections if one.inner is None and one.has_spoken == has_spoken]

    def _close_one(self, *, has_spoken: bool) -> None:
        """Close the oldest connection of the address with the most; of strangers first."""
        waiting = self._not_admitted(has_spoken=has_spoken)
        each = Counter(one.address for one in waiting)
        worst = max(
            waiting, key=lambda one: (one.address not in self._known, each[one.address]), default=None
        )
        if worst is not None:
            self._close(worst)

    def _replace_oldest_of(self, certificate: bytes) -> None:
        same = [one for one in self._connections if one.inner is not None and one.certificate == certificate]
        if len(same) >= EACH_HOLDER:
            self._close(same[0])

    def _remember(self, address: str) -> None:
        self._known.pop(address, None)
        self._known[address] = None
        if len(self._known) > ADDRESSES:
            del self._known[next(iter(self._known))]

    def _close_late(self) -> None:
        """Close what takes too long, and the connections of holders whose certificate is no longer valid."""
        now_s = time.monotonic()
        for one in list(self._connections):
            try:
                if one.inner is not None:
                    self._certificates.holder(one.certificate)
                elif now_s - one.began_s > (HANDSHAKE_S if one.has_spoken else SILENT_S):
                    self._close(one)
            except Untrusted as error:
                self.refused(str(error))
                self._close(one)

    def _close(self, connection: RelayedConnection) -> None:
        self._connections.pop(connection, None)
        for end in connection.ends:
            with suppress(KeyError, ValueError):
                self._selector.unregister(end.socket)
            end.socket.close()


def _context(held: HeldKeys, protocol: int) -> ssl.SSLContext:
    """Return TLS settings with a holder's keys that demand a certificate of the same authority."""
    context = ssl.SSLContext(protocol)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.check_hostname = False
    context.verify_mode = ssl.CERT_REQUIRED
    context.load_verify_locations(str(held.files.authority))
    context.load_cert_chain(str(held.files.certificate), str(held.files.key))
    if protocol == ssl.PROTOCOL_TLS_SERVER:
        context.num_tickets = 0
    return context


def _allow_files(count: int) -> None:
    """Let the process open that many files, as far as the system lets it."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        if soft < count:
            most = count if hard == resource.RLIM_INFINITY else min(count, hard)
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
