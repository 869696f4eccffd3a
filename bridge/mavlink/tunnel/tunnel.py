"""Tunnel of MAVLink frames over a link, between a vehicle and ground programs at stations.

Each end reads whole frames at its MAVLink side and publishes them on one key expression; it writes the frames
that it receives on the other. Each direction has a queue that loses the oldest frames when it is full. So
neither a slow link nor a blocked listener delays the robot. Frames pass unchanged, with their signatures, in
their order.
"""

from __future__ import annotations

import math
import threading
import time
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from stopgo.bridge.link.link import Link, Presence
from stopgo.bridge.mavlink.vehicle_link.frames import Frames, dialect
from stopgo.bridge.mavlink.vehicle_link.messages import on_board_beat
from stopgo.bridge.mavlink.vehicle_link.transport import Transport
from stopgo.mission.console.process import wait_for
from stopgo.mission.mavlink.enums import Component
from stopgo.mission.mavlink.telemetry import Message

QUEUE = 500
"""Frames that wait in one direction: some seconds of a vehicle with many messages."""
OLDEST_S = 2.0
"""Age above which a command or a position in the queue is useless, or worse."""
SAMPLE_BYTES = 1200
"""Frames share a sample up to this size: fewer samples on a slow link, and no datagram that must be cut."""
READ_S = 0.1
GREET_S = 0.5
GREET_EVERY_S = 5.0
ECHOES = 512
"""Number of written frames that are remembered; one that comes back soon is an echo."""
KNOCKING = (252, Component.UDP_BRIDGE)
"""Sender of our heartbeats: not the gateway (253), whose heartbeats show a vehicle that it is alive."""


class Waiting:
    """Queue of frames; the oldest are dropped if there are too many, or they are too old."""

    def __init__(self, dropped: Counter[str], what: str) -> None:
        self._dropped, self._what = dropped, what
        self._frames: deque[tuple[float, bytes]] = deque()
        self._ready = threading.Condition()
        self._closed = False

    def put(self, frame: bytes) -> None:
        with self._ready:
            if len(self._frames) >= QUEUE:
                self._frames.popleft()
                self._dropped[f"{self._what}, too many"] += 1
            self._frames.append((time.monotonic(), frame))
            self._ready.notify()

    def sample(self) -> bytes:
        """The next frames for one sample; waits for a frame, and is empty once closed."""
        with self._ready:
            self._ready.wait_for(lambda: self._fresh() or self._closed)
            taken = b""
            while self._frames and len(taken) + len(self._frames[0][1]) <= SAMPLE_BYTES:
                taken += self._frames.popleft()[1]
            return taken

    def close(self) -> None:
        with self._ready:
            self._closed = True
            self._frames.clear()
            self._ready.notify_all()

    def _fresh(self) -> bool:
        while self._frames and self._frames[0][0] < time.monotonic() - OLDEST_S:
            self._frames.popleft()
            self._dropped[f"{self._what}, too old"] += 1
        return bool(self._frames)


class Echoes:
    """Frames that were written lately: one that comes back must not circulate."""

    def __init__(self) -> None:
        self._frames: OrderedDict[bytes, float] = OrderedDict()
        self._lock = threading.Lock()

    def wrote(self, frame: bytes) -> None:
        with self._lock:
            self._frames[frame] = time.monotonic()
            while len(self._frames) > ECHOES:
                self._frames.popitem(last=False)

    def knows(self, frame: bytes) -> bool:
        with self._lock:
            return self._frames.get(frame, -OLDEST_S) > time.monotonic() - OLDEST_S


class Tunnel:
    """One end: `publishes` and `receives` are key expressions of the link, out and in.

    `sees` is called with each message from the MAVLink side, `wrote` with each message written there.
    `passes` judges a message for that side, and `refused` gives the frame that is sent back for a blocked
    one, if any. An end that `knocks` sends a heartbeat of its own: a program that listens on UDP answers only
    known senders.
    """

    def __init__(
        self,
        link: Link,
        transport: Transport,
        *,
        publishes: str | None,
        receives: str,
        sees: Callable[[Message], None] = lambda message: None,
        passes: Callable[[Message], bool] = lambda message: True,
        wrote: Callable[[Message], None] = lambda message: None,
        refused: Callable[[Message], bytes] = lambda message: b"",
        knocks: bool = False,
        bulk: bool = False,
    ) -> None:
        self.carried: Counter[str] = Counter()
        """Number of frames by direction."""
        self.dropped: Counter[str] = Counter()
        """Number of frames that did not pass, by reason."""
        self._transport = transport
        self._sees, self._passes, self._wrote, self._refused = sees, passes, wrote, refused
        self._knocks = knocks
        self._echoes = Echoes()
        self._out = Waiting(self.dropped, "to the link")
        self._in = Waiting(self.dropped, "from the link")
        self._read_frames = Frames(self.dropped)
        self._received_frames = Frames(self.dropped)
        self._ended = threading.Event()
        self._error: Exception | None = None
        self._publish = None if publishes is None else link.publisher(publishes, bulk=bulk)
        link.hear(receives, self._receive)
        works = (self._read, self._publish_frames, self._write)
        self._threads = [threading.Thread(target=self._watched, args=(work,), daemon=True) for work in works]
        for thread in self._threads:
            thread.start()

    def wait(self) -> None:
        """Wait until the tunnel ends, which happens only by an error; that is raised here."""
        wait_for(self._ended)
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        self._ended.set()
        self._out.close()
        self._in.close()
        for thread in self._threads:
            thread.join()

    def _watched(self, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception as error:  # noqa: BLE001 (the end of a thread)
            self._error = error
            self._ended.set()

    def _read(self) -> None:
        coder = dialect.MAVLink(None, *KNOCKING)
        knocked_s = -math.inf
        while not self._ended.is_set():
            if self._knocks and time.monotonic() - knocked_s >= 1.0:
                knocked_s = time.monotonic()
                self._transport.write(bytes(on_board_beat().pack(coder)))
                coder.seq = (coder.seq + 1) % 256
            for address, data in self._transport.read(READ_S):
                for frame, message in self._read_frames.whole(
                    data, datagram=self._transport.datagrams, sender=address
                ):
                    self._take(frame, message)

    def _take(self, frame: bytes, message: Message) -> None:
        self._sees(message)
        if self._echoes.knows(frame):
            self.dropped["echo"] += 1
        elif self._publish is None:
            self.dropped["from a viewer"] += 1
        else:
            self._out.put(frame)

    def _publish_frames(self) -> None:
        while not self._ended.is_set():
            sample = self._out.sample()
            if sample and self._publish is not None:
                self._publish(sample)
                self.carried["to the link"] += 1

    def _write(self) -> None:
        while not self._ended.is_set():
            for frame, message in self._received_frames.whole(self._in.sample(), datagram=True):
                if self._passes(message):
                    self._echoes.wrote(frame)
                    self._transport.write(frame)
                    self._wrote(message)
                    self.carried["from the link"] += 1
                else:
                    self.dropped["refused"] += 1
                    self._send_back(self._refused(message))

    def _receive(self, key: str, payload: bytes) -> None:
        if len(payload) <= SAMPLE_BYTES:
            self._in.put(payload)
        else:
            self.dropped["too large"] += 1

    def _send_back(self, frame: bytes) -> None:
        if frame:
            self._out.put(frame)


def answer_greetings(link: Link, key: str) -> None:
    """Let stations verify this start of the tunnel's end at the robot: then they accept its messages."""
    link.serve(key, lambda request: b"{}")


@contextmanager
def greeting(link: Link, key: str, alive: str, changed: Presence) -> Iterator[None]:
    """Greet the tunnel's end at the robot, again whenever it connects, until the block ends.

    Where ends hold private keys, each accepts only recent messages, and counts from the last greeting.
    """
    ended, due = threading.Event(), threading.Event()

    def on_presence(token: str, there: bool) -> None:
        due.set()
        changed(token, there)

    def greet() -> None:
        while not ended.is_set():
            due.clear()
            answered = link.ask(key, timeout_s=GREET_S) is not None
            due.wait(GREET_EVERY_S if answered else GREET_S)

    link.watch_presence(alive, on_presence)
    thread = threading.Thread(target=greet, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        due.set()
        thread.join()


@contextmanager
def open_tunnel(link: Link, transport: Transport, **details: Any) -> Iterator[Tunnel]:
    """A running end of a tunnel until the block ends; its transport is closed then."""
    tunnel = Tunnel(link, transport, **details)
    try:
        yield tunnel
    finally:
        tunnel.close()
        transport.close()


def summary(carried: Counter[str], dropped: Counter[str]) -> Sequence[str]:
    """Counts of a tunnel as text: a line for frames that passed, and one for those that did not."""
    passed = ", ".join(f"{number} {what}" for what, number in sorted(carried.items())) or "nothing"
    lost = ", ".join(f"{number} {what}" for what, number in sorted(dropped.items()) if number)
    return (f"carried {passed}", *((f"dropped {lost}",) if lost else ()))
