"""Messages in and out of a transport: frames, checksums, signatures, and addresses of senders.

One thread reads; whoever waits for messages opens a queue for their types. No input can stop the thread. It
drops and counts bytes that are no frame, frames with a wrong checksum or signature, and messages for somebody
else.
"""

from __future__ import annotations

import hashlib
import hmac
import queue
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple, TypeVar

from stopgo.bridge.console import say
from stopgo.bridge.mavlink.vehicle_link.frames import UNREADABLE, Frames, dialect
from stopgo.bridge.mavlink.vehicle_link.sender_addresses import SenderAddresses
from stopgo.bridge.mavlink.vehicle_link.transport import Address, End, Transport, open_transport
from stopgo.bridge.mavlink.vehicle_link.url import Url, check_guarded, read_url
from stopgo.mission.console.whole_file import whole_file
from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.enums import Component, MessageId
from stopgo.mission.mavlink.telemetry import Message

QUEUE_SIZE = 10_000
APART_LINK = 1
"""Link id of signatures on frames that another process sends; ours is 0."""
READ_S = 0.1
MAVLINK_EPOCH_S = 1_420_070_400
"""2015-01-01, from which signatures count in steps of 10 µs."""
OLDEST_STEPS = 6_000_000
"""Largest delay of a new sender's clock: a minute."""
SIGNATURE = "wrong or no signature"
"""Reason by which `dropped` counts messages without a signature by our key, and replays."""
SLOW_BAUD = 57_600
"""Highest rate of a slow link: eight mission items take 70 ms; telemetry radios are not faster."""
DOUBLED = "from another vehicle with the same system id"
"""Reason by which `dropped` counts messages of a second vehicle."""
UNSIGNED_ALLOWED = (MessageId.RADIO_STATUS,)
"""Radios cannot sign."""
LEAST_PASSPHRASE = 8
KEY_FILE = f"64 hexadecimal digits, or a passphrase of {LEAST_PASSPHRASE} characters or more"
READ_BY_OTHERS = 0o044
"""Read permissions of the group and of all users."""


class Who(NamedTuple):
    """System and component of a sender or receiver."""

    system: int
    component: int


GROUND_STATION = Who(254, Component.MISSIONPLANNER)
"""Our address as a station; not 255, which QGroundControl has: a vehicle must distinguish two stations."""


B = TypeVar("B", bound="MessageQueue")


class MessageQueue:
    """Queue of messages for one reader: of these types (empty: all), from one sender (`None`: all)."""

    overhears = False
    """True to get messages for others as well."""

    def __init__(self, types: frozenset[str] = frozenset(), of: Who | None = None) -> None:
        self.types = types
        self.of = of
        self._queue: queue.Queue[Message] = queue.Queue(QUEUE_SIZE)

    def wants(self, message: Message) -> bool:
        of_type = not self.types or message.get_type() in self.types
        return of_type and (self.of is None or self.of == sender(message))

    def put(self, message: Message) -> None:
        with suppress(queue.Full):  # too many are dropped, as on any lossy link
            self._queue.put_nowait(message)

    def get(self, timeout_s: float) -> Message | None:
        """The next message, or `None` when the time is up."""
        try:
            return self._queue.get(timeout=max(0.0, timeout_s)) if timeout_s > 0 else self._queue.get_nowait()
        except queue.Empty:
            return None


def sender(message: Message) -> Who:
    """Sender of a received message."""
    return Who(message.get_srcSystem(), message.get_srcComponent())


class Wire:
    """One end of MAVLink traffic."""

    def __init__(
        self,
        transport: Transport,
        *,
        me: Who = GROUND_STATION,
        signing_key: bytes | None = None,
        signs: bool = True,
        name: str = "the link",
        slow: bool = False,
    ) -> None:
        self.me = me
        self.name = name
        """Its name in errors."""
        self.slow = slow
        """True if a few messages fill it for a noticeable time."""
        self.dropped: Counter[str] = Counter()
        """Number of dropped messages, by reason."""
        self._transport = transport
        self._ended = ""
        self._key, self._signs = signing_key, signs
        self._seen = SeenStreams()
        self._sending = self._mav()
        self._frames = Frames(self.dropped, self._mav)
        self._addresses = SenderAddresses()
        self._watched: set[int] = set()
        self._queues: list[MessageQueue] = []
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._beat: Callable[[], Message] | None = None
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._read, self._beats)]
        for thread in self._threads:
            thread.start()

    @property
    def disconnected(self) -> str:
        """Reason why no data pass now; empty if they pass."""
        return self._ended or self._transport.disconnected

    def doubled(self, system: int) -> str:
        """The addresses that send as one and the same vehicle, in words; empty if there is only one."""
        return " and ".join(map(_named, self._addresses.doubled(system)))

    def report_doubled(self, system: int) -> None:
        """Print a line if from now on another vehicle with this system id is heard."""
        self._watched.add(system)

    def _note_doubled(self, system: int) -> None:
        self.dropped[DOUBLED] += 1
        if system in self._watched and (doubled := self.doubled(system)):
            self._watched.discard(system)
            say(
                f"note: two vehicles have the system id {system}, at {doubled}: only the first is heard and"
                " commanded; give the other one another id"
            )

    def send(self, message: Message, *, component: int | None = None, everywhere: bool = False) -> None:
        """Send to the receiver of the message, if its address is known; else, or `everywhere`, to all.

        `component`: the sender within our system, if not `me`.
        """
        target = (getattr(message, "target_system", 0), getattr(message, "target_component", 0))
        with self._lock:
            self._sending.signing.timestamp = max(self._sending.signing.timestamp, signing_time())
            self._sending.srcComponent = self.me.component if component is None else component
            data = bytes(message.pack(self._sending))
            self._sending.seq = (self._sending.seq + 1) % 256
            self._transport.write(data, None if everywhere else self._route(*target))

    def packed_apart(self, message: Message, count: int) -> list[bytes]:
        """Frames of a message that another process may send later, each as if it were new.

        Signed, they belong to a stream of their own, whose times do not have to follow those of this one.
        """
        coder = self._mav()
        coder.signing.link_id = APART_LINK
        frames = []
        for seq in range(count):
            coder.seq = seq
            frames.append(bytes(message.pack(coder)))
        return frames

    def ends(self, to: Who) -> list[End]:
        """Descriptors by which another process may write to a receiver."""
        return self._transport.ends(self._route(to.system, to.component))

    @contextmanager
    def waiting(self, *types: str, of: Who | None = None) -> Iterator[MessageQueue]:
        """A queue that collects messages of these types (all, if none is given) while it is open."""
        with self.filling(MessageQueue(frozenset(types), of)) as waiting:
            yield waiting

    @contextmanager
    def filling(self, waiting: B) -> Iterator[B]:
        """Fill a queue of the caller's own until the block ends."""
        self._queues.append(waiting)
        try:
            yield waiting
        finally:
            self._queues.remove(waiting)

    def beat(self, heartbeat: Callable[[], Message]) -> None:
        """Send a heartbeat now and every second."""
        self._beat = heartbeat
        self.send(heartbeat())

    def close(self) -> None:
        self._closing.set()
        for thread in self._threads:
            thread.join()
        self._transport.close()

    def _route(self, system: int, component: int) -> Address | None:
        if system == 0:
            return None
        return self._addresses.address(system, component)

    def _beats(self) -> None:
        while not self._closing.wait(1.0):
            if self._beat is not None:
                self.send(self._beat())

    def _read(self) -> None:
        try:
            while not self._closing.is_set():
                for address, data in self._transport.read(READ_S):
                    datagram = self._transport.datagrams
                    for message in self._frames.messages(data, datagram=datagram, sender=address):
                        self._take(address, message)
        except Exception as error:  # noqa: BLE001 (the end of a thread)
            self._ended = f"reading ended: {error!r}; please report this"

    def _take(self, address: Address, message: Message) -> None:
        name = message.get_type()
        if name == "BAD_DATA" or name.startswith("UNKNOWN"):
            self.dropped[_why_dropped(message)] += 1
            return
        system = message.get_srcSystem()
        if not self._addresses.accepts(system, message.get_srcComponent(), address, time.monotonic()):
            self._note_doubled(system)
            return
        for_us = self._for_us(message)
        if not for_us:
            self.dropped["for others"] += 1
        for waiting in self._queues.copy():
            if (for_us or waiting.overhears) and waiting.wants(message):
                waiting.put(message)

    def _for_us(self, message: Message) -> bool:
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in (0, self.me.system) and component in (0, self.me.component)

    def _mav(self) -> Coder:
        """A new coder, one for each direction and peer: coders have state."""
        mav = Coder(self.me, self._seen)
        if self._key is not None:
            mav.signing.secret_key = self._key
            mav.signing.sign_outgoing = self._signs
            mav.signing.allow_unsigned_callback = lambda _, number: number in UNSIGNED_ALLOWED
            mav.signing.timestamp = signing_time()
        return mav


def _named(address: Address) -> str:
    """An address in words."""
    return f"{address[0]}:{address[1]}" if isinstance(address, tuple) else str(address)


def _why_dropped(message: Message) -> str:
    if message.get_type() != "BAD_DATA":
        return "unknown"
    return SIGNATURE if message.reason == "Invalid signature" else UNREADABLE


class SeenStreams:
    """The newest time signed by each sender, from whatever address: no message is accepted twice."""

    def __init__(self) -> None:
        self._newest: dict[tuple[int, int, int], int] = {}

    def fresh(self, stream: tuple[int, int, int], timestamp: int) -> bool:
        newest = self._newest.get(stream, signing_time() - OLDEST_STEPS)
        return timestamp > newest

    def took(self, stream: tuple[int, int, int], timestamp: int) -> None:
        self._newest[stream] = timestamp


class Coder(dialect.MAVLink):
    """The dialect's coder, but a signature's time counts only if the signature itself is right.

    Otherwise one forged frame with a time far in the future would block its sender's stream.
    """

    def __init__(self, me: Who, seen: SeenStreams) -> None:
        super().__init__(None, srcSystem=me.system, srcComponent=me.component)
        self.robust_parsing = True
        self._seen_streams = seen

    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:
        """Check a MAVLink 2 message signature: the first 48 bits of the SHA-256 of key and frame."""
        signed, signature = bytes(msgbuf[:-6]), bytes(msgbuf[-6:])
        right = hashlib.sha256(bytes(self.signing.secret_key or b"") + signed).digest()[:6]
        timestamp = int.from_bytes(signed[-6:], "little")
        stream = (signed[-7], srcSystem, srcComponent)
        if not (hmac.compare_digest(right, signature) and self._seen_streams.fresh(stream, timestamp)):
            return False
        self._seen_streams.took(stream, timestamp)
        return True


def signing_time() -> int:
    """Present time in the steps of signatures."""
    return round((time.time() - MAVLINK_EPOCH_S) * 1e5)


@contextmanager
def wire(url: Url, *, me: Who = GROUND_STATION, signing_key: bytes | None = None) -> Iterator[Wire]:
    """An open wire at `url`; raises as `open_transport` does."""
    slow = url.kind == "serial" and url.number <= SLOW_BAUD
    opened = Wire(open_transport(url), me=me, signing_key=signing_key, name=str(url), slow=slow)
    try:
        yield opened
    finally:
        opened.close()


def read_link(
    text: str, signing_key: Path | None, *, insecure: bool, option: str = "--mavlink"
) -> tuple[Url, bytes | None]:
    """URL of a vehicle and the signing key for it; an unsafe combination is refused.

    Raises
    ------
    InputError
        As `read_url`, `read_signing_key` and `check_guarded` do, in this order.
    """
    url = read_url(text, option)
    key = None if signing_key is None else read_signing_key(signing_key)
    check_guarded(url, signed=key is not None, insecure=insecure, option=option)
    return url, key


def read_signing_key(path: Path) -> bytes:
    """The 32 bytes in a key file: 64 hexadecimal digits, or a passphrase of which they are the SHA-256.

    Ground stations make a key from a passphrase that way. If other users of the machine can read the file, a
    note is printed.

    Raises
    ------
    InputError
        If the file holds no key.
    """
    try:
        text = whole_file(path).decode().strip()
        shared = path.stat().st_mode & READ_BY_OTHERS
    except OSError as error:
        raise InputError(f"--signing-key {path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(
            f"--signing-key {path}: is not text; write {KEY_FILE}; "
            f"of a binary key: xxd -p -c 64 {path} > {path}.hex"
        ) from None
    if not text:
        raise InputError(f"--signing-key {path}: is empty; write {KEY_FILE}")
    if shared:
        say(f"note: --signing-key {path}: others on this machine can read it; chmod 600 {path}")
    if len(text) == 64:
        with suppress(ValueError):
            return bytes.fromhex(text)
    if len(text) < LEAST_PASSPHRASE:
        raise InputError(f"--signing-key {path}: the passphrase is too short to be safe; write {KEY_FILE}")
    return hashlib.sha256(text.encode()).digest()
