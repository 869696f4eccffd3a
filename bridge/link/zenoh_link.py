"""A link over zenoh. All settings and all pitfalls of zenoh are in this module.

The robot listens as a router, and stations connect as peers without scouting. Shared memory is off, for it
drops queries silently. The lease is set at both ends, for each end's lease governs the other. A session is
always closed, for an open one with callbacks blocks the interpreter's exit.
"""

from __future__ import annotations

import ipaddress
import json
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

import zenoh

from stopgo.bridge.link.admission import Admission, can_admit, inner_endpoints, listening_socket
from stopgo.bridge.link.keys import HeldKeys, now_utc
from stopgo.bridge.link.link import Answering, Hearing, Presence, Publish, Request, Unanswered, endpoints_in
from stopgo.bridge.link.signatures import NO_SIGNING, KeySigning, MessageSigning
from stopgo.mission.errors import InputError

LEASE_MS = 2000
OPEN_S = 5.0
OPEN_MARGIN_S = 0.5
"""Time by which an attempt to connect outlasts the command that waits for it."""
LONGEST_OPEN_S = 15.0
"""Longest attempt to connect: TCP repeats ever more rarely, so a new attempt finds a robot sooner."""
ALL_LINKED_S = 1.0
"""Wait of a station with several endpoints for all of them."""
POLL_S = 0.02
BATCH_BYTES = 8192
"""Batch size of zenoh: a batch that takes longer than the lease to arrive closes the link."""
SEND_BUFFER_BYTES = 32 * 1024
"""Send buffer of the operating system, per link; no urgent message can overtake its content."""
MAX_MESSAGE_BYTES = 1_000_000
OPEN = ("tcp", "udp", "ws")
ENCRYPTED = ("tls", "quic")
JSON = zenoh.Encoding.APPLICATION_JSON

PROMPT = zenoh.Priority.INTERACTIVE_LOW
BULK = zenoh.Priority.DATA_LOW

COMMON: dict[str, Any] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "scouting/delay": 0,
    "transport/shared_memory/enabled": False,
    "transport/link/tx/lease": LEASE_MS,
    "transport/link/tx/batch_size": BATCH_BYTES,
    "transport/link/tcp/so_sndbuf": SEND_BUFFER_BYTES,
    "transport/link/tls/so_sndbuf": SEND_BUFFER_BYTES,
    "transport/link/rx/max_message_size": MAX_MESSAGE_BYTES,
    "adminspace/enabled": False,
}
RETRY = {"period_init_ms": 200, "period_max_ms": 500, "period_increase_factor": 1.5}
LAST_SECOND = timedelta(seconds=1)
"""Time in which zenoh accepts an expired certificate for a new link, which it does not close again."""


@dataclass(frozen=True)
class Guard:
    """Protection of a link: keys, or this machine only, or none (`insecure`)."""

    keys: HeldKeys | None = None
    insecure: bool = False
    access: dict[str, Any] | None = None
    """zenoh's access control, at the end that serves."""
    boot_id: str = ""
    """Boot of a robot, for its signatures."""
    refused: Callable[[str, str], None] = lambda key, why: None
    """Called with the key and the reason of questions that are not accepted."""
    turned_away: Callable[[str], None] = lambda why: None
    """Called with the reason of connections that are not admitted."""
    state: Path | None = None
    """Folder of a robot in which the newest revoked list is stored."""

    @property
    def signing(self) -> MessageSigning:
        """Signatures of messages on a link with this protection."""
        if self.keys is None:
            return NO_SIGNING
        return KeySigning(self.keys, boot_id=self.boot_id, refused=self.refused, state=self.state)


UNGUARDED = Guard()
"""No protection: for this machine only."""


@contextmanager
def listening(endpoint: str, guard: Guard = UNGUARDED) -> Iterator[ZenohLink]:
    """Open a link that listens on `endpoint`, such as `tcp/127.0.0.1:7447`, and routes between its peers."""
    check_endpoint(endpoint, guard, option="--listen")
    with _opened({"mode": "router", "listen/endpoints": [endpoint]}, endpoint, guard) as link:
        yield link


@contextmanager
def admitting(endpoint: str, guard: Guard) -> Iterator[ZenohLink]:
    """Open a robot's link that listens on `endpoint`; with keys, only holders get through to zenoh.

    An endpoint that is not `tls/`, or that has settings of zenoh (`#`), is zenoh's own listener.
    """
    check_endpoint(endpoint, guard, option="--listen")
    if guard.keys is None or not can_admit(endpoint):
        with listening(endpoint, guard) as link:
            yield link
        return
    with listening_socket(endpoint) as listener, inner_endpoints(guard.state) as inner:
        settings = {"mode": "router", "listen/endpoints": inner.endpoints}
        with _opened(settings, endpoint, guard) as link:
            link.admission = Admission(listener, guard.keys, inner, guard.turned_away, guard.state)
            with link.admission.running():
                yield link


@contextmanager
def joining(endpoint: str, guard: Guard = UNGUARDED) -> Iterator[ZenohLink]:
    """Open a robot's link to the router at `endpoint`, to which stations connect too.

    The robot is a router too: a router does not carry between two peers that it takes for neighbours.
    """
    check_endpoint(endpoint, guard, option="--connect")
    with _opened({"mode": "router", **_reaching(endpoint)}, endpoint, guard) as link:
        yield link


@contextmanager
def connecting(endpoint: str, guard: Guard = UNGUARDED, *, open_s: float = OPEN_S) -> Iterator[ZenohLink]:
    """Open a station's link to `endpoint`; it is returned at once, and connects in the background.

    `open_s` is the time in which it is needed. Closing waits for the current attempt, so that one outlasts
    this time a little: a second would have to be waited for whole. There may be several endpoints, with
    commas between them. The link waits a moment for all, so that two robots of one name both answer.
    """
    endpoints = endpoints_in(endpoint)
    for one in endpoints:
        check_endpoint(one, guard, option="--connect")
    opening = {"transport/unicast/open_timeout": round((min(open_s, LONGEST_OPEN_S) + OPEN_MARGIN_S) * 1e3)}
    with _opened({"mode": "peer", **_reaching(*endpoints), **opening}, endpoint, guard) as link:
        if len(endpoints) > 1:
            link.await_others(len(endpoints), ALL_LINKED_S)
        yield link


def _reaching(*endpoints: str) -> dict[str, Any]:
    return {"connect/endpoints": list(endpoints), "listen/endpoints": [], "connect/retry": RETRY,
            "connect/exit_on_failure": False}  # fmt: skip


def _guarding(guard: Guard) -> dict[str, Any]:
    """Return zenoh's settings for keys and access; a wrong one is refused at opening."""
    settings: dict[str, Any] = {} if guard.access is None else {"access_control": guard.access}
    if guard.keys is None:
        return settings
    files, tls = guard.keys.files, "transport/link/tls"
    return settings | {
        f"{tls}/root_ca_certificate": str(files.authority),
        f"{tls}/enable_mtls": True,
        f"{tls}/verify_name_on_connect": True,
        f"{tls}/close_link_on_expiration": True,
        f"{tls}/listen_certificate": str(files.certificate),
        f"{tls}/listen_private_key": str(files.key),
        f"{tls}/connect_certificate": str(files.certificate),
        f"{tls}/connect_private_key": str(files.key),
    }


@contextmanager
def _opened(settings: dict[str, Any], endpoint: str, guard: Guard) -> Iterator[ZenohLink]:
    config = zenoh.Config()
    try:
        for key, value in {**COMMON, **settings, **_guarding(guard)}.items():
            config.insert_json5(key, json.dumps(value))
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise InputError(f"{endpoint}: cannot be opened ({_short(error)}); is the address free?") from None
    with session:
        link = ZenohLink(session, guard.signing)
        try:
            with _silent_after(link, guard.keys):
                yield link
        finally:
            link.close()


@contextmanager
def _silent_after(link: ZenohLink, keys: HeldKeys | None) -> Iterator[None]:
    """Silence the link once the keys have expired, also a link of the last second."""
    if keys is None:
        yield
        return
    left = keys.holder.not_after + LAST_SECOND - now_utc()
    timer = threading.Timer(left.total_seconds(), link.fall_silent)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


class ZenohLink:
    """One open zenoh session."""

    def __init__(self, session: zenoh.Session, signing: MessageSigning = NO_SIGNING) -> None:
        self._session = session
        self._signing = signing
        # A token or subscriber without a reference is garbage collected, and undeclared.
        self._declared: list[Any] = []
        self._publishers: list[zenoh.Publisher] = []
        self._queriers: dict[str, zenoh.Querier] = {}
        self._asking, self._closed = threading.Lock(), False
        self._lock = threading.Lock()
        self._silent = False
        self.may_be_sent = False
        self.admission: Admission | None = None
        """What accepts the connections, if zenoh's own listener does not."""

    @property
    def distrusted(self) -> str:
        return self._signing.distrusted

    def await_others(self, count: int, within_s: float) -> None:
        """Wait until `count` others are connected, or the time is over."""
        deadline = time.monotonic() + within_s
        while len(self._others()) < count and time.monotonic() < deadline:
            time.sleep(POLL_S)

    def _others(self) -> set[str]:
        """Return the zenoh ids of all who are connected now."""
        info = self._session.info
        return {str(one) for one in (*info.routers_zid(), *info.peers_zid())}

    def fall_silent(self) -> None:
        """Disappear for the others, while the session stays open."""
        self._silent = True
        with self._lock:
            _undeclare(self._declared)

    def serve(self, key: str, answer: Answering) -> None:
        signed = self._signing.sign_answers(answer)
        if self.admission is not None and "*" not in key:
            self.admission.answers[key] = signed

        def answered(query: zenoh.Query) -> None:
            with query:
                payload = b"" if query.payload is None else query.payload.to_bytes()
                parameters = _parameters(query.parameters)
                try:
                    reply, attachment = signed(
                        Request(str(query.key_expr), payload, parameters, _attachment_of(query))
                    )
                except Unanswered:
                    return
                # The answer has the priority of the question: zenoh offers no other.
                query.reply(query.key_expr, reply, encoding=JSON, attachment=attachment or None)

        self._declared.append(self._session.declare_queryable(key, answered, complete=True))

    def publisher(self, key: str, *, bulk: bool = False) -> Publish:
        control = zenoh.CongestionControl.DROP if bulk else zenoh.CongestionControl.BLOCK
        publisher = self._session.declare_publisher(
            key, encoding=JSON, congestion_control=control, priority=BULK if bulk else PROMPT
        )
        self._publishers.append(publisher)

        def publish(payload: bytes) -> None:
            if not self._silent:
                publisher.put(payload, attachment=self._signing.sign_publication(key, payload) or None)

        return publish

    def announce(self, key: str) -> None:
        self._declared.append(self._session.liveliness().declare_token(key))

    def ask(
        self,
        key: str,
        payload: bytes = b"",
        *,
        timeout_s: float,
        parameters: Mapping[str, str] | None = None,
        bulk: bool = False,
    ) -> bytes | None:
        return next(self._answers(key, payload, timeout_s, parameters or {}, bulk=bulk), None)

    def ask_all(self, key: str, payload: bytes = b"", *, timeout_s: float) -> list[bytes]:
        return list(self._answers(key, payload, timeout_s, {}, bulk=False))

    def _answers(
        self, key: str, payload: bytes, timeout_s: float, parameters: Mapping[str, str], *, bulk: bool
    ) -> Iterator[bytes]:
        """Yield the verified answers, as they come."""
        if self._silent:
            return
        question = self._signing.sign_question(key, payload, parameters)
        linked = self._others()
        self.may_be_sent = self.may_be_sent or self._is_served(key)
        replies = self._session.get(
            zenoh.Selector(key, dict(parameters)),
            payload=payload,
            attachment=question.attachment or None,
            encoding=JSON,
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=timeout_s,
            priority=zenoh.Priority.BACKGROUND if bulk else zenoh.Priority.INTERACTIVE_HIGH,
            congestion_control=zenoh.CongestionControl.BLOCK,
            express=not bulk,
        )
        linked |= self._others()
        self.may_be_sent = self.may_be_sent or self._is_served(key)  # by one who came just now
        for reply in replies:
            self.may_be_sent = True  # also an error: zenoh's own one of a question without an answer in time
            if reply.ok is not None:
                opened = self._signing.verify_answer(
                    question, reply.ok.payload.to_bytes(), _attachment_of(reply.ok)
                )
                if opened is not None:
                    yield opened
        # Without any reply there was nobody to ask, or one who was asked did not answer, or is lost.
        self.may_be_sent = self.may_be_sent or self._is_served(key) or not linked <= self._others()

    def _is_served(self, key: str) -> bool:
        """Return true if another end is known to serve `key` now.

        A router says who serves a key only after it was asked, so the answer may come too late for the
        first question on a key. The queriers are kept for the next one.
        """
        with self._asking:
            if self._closed:
                return False
            if key not in self._queriers:
                target = zenoh.QueryTarget.ALL_COMPLETE
                self._queriers[key] = self._session.declare_querier(key, target=target)
            status: Any = self._queriers[key].matching_status  # declared as a bool, which it is not
            return bool(status.matching)

    def hear(self, key: str, heard: Hearing) -> None:
        judged = self._signing.verify_publications(heard)

        def sampled(sample: zenoh.Sample) -> None:
            judged(str(sample.key_expr), sample.payload.to_bytes(), _attachment_of(sample))

        self._declared.append(self._session.declare_subscriber(key, sampled))

    def watch_presence(self, key: str, changed: Presence) -> None:
        def noticed(sample: zenoh.Sample) -> None:
            changed(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        self._declared.append(self._session.liveliness().declare_subscriber(key, noticed, history=True))

    def close(self) -> None:
        with self._lock:
            _undeclare(self._declared)
            _undeclare(self._publishers)
        with self._asking:
            self._closed = True
            while self._queriers:
                self._queriers.popitem()[1].undeclare()


def _undeclare(declared: list[Any]) -> None:
    while declared:
        declared.pop().undeclare()


def check_endpoint(endpoint: str, guard: Guard, *, option: str) -> None:
    """Refuse a text that is not an endpoint, and an endpoint without the protection it needs.

    Raises
    ------
    InputError
        Naming the option, the endpoint and the remedy.
    """
    protocol, _, rest = endpoint.partition("/")
    address = rest.partition("?")[0].partition("#")[0]
    host, _, port = address.rpartition(":")
    known = protocol in (*OPEN, *ENCRYPTED) and "," not in endpoint
    if not known or not host or not re.fullmatch("[0-9]+", port):
        raise InputError(f"{option} {endpoint}: not an endpoint; write it like tcp/127.0.0.1:7447")
    if not 1 <= int(port) <= 65535:
        raise InputError(f"{option} {endpoint}: {port} is no port (1 to 65535)")
    if guard.keys is None and protocol in ENCRYPTED:
        raise InputError(f"{option} {endpoint}: {protocol} needs --keys DIR; make them with stopgo keys")
    if guard.keys is not None and protocol in OPEN:
        raise InputError(f"{option} {endpoint}: {protocol} cannot carry keys; write it like tls/{address}")
    if guard.keys is None and not guard.insecure and not is_loopback(host):
        raise InputError(
            f"{option} {endpoint}: leaves this machine without keys; use 127.0.0.1, tls/ with --keys DIR,"
            " or add --insecure"
        )


def is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def _parameters(parameters: zenoh.Parameters) -> dict[str, str]:
    pairs = (pair.partition("=") for pair in str(parameters).split(";") if pair)
    return {name: value for name, _, value in pairs}


def _attachment_of(message: zenoh.Query | zenoh.Sample) -> bytes:
    return b"" if message.attachment is None else message.attachment.to_bytes()


def _short(error: zenoh.ZError) -> str:
    """Return the useful part of zenoh's message: the operating system's, if there is one."""
    found = re.search(r"[A-Z][A-Za-z ]+ \(os error \d+\)", str(error))
    return found.group() if found else re.sub(r" at \S+\.rs:\d+\S*", "", str(error).splitlines()[0])[:200]
