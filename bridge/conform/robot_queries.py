"""Queries of a robot under test, and strict decoding of its answers and publications."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final, TypeVar

import msgspec

from stopgo.bridge.conform.requirements import Nonconforming, NotTried, must, short
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import Info, KeyExpressions, LogPage, Malformed, Rejected, Reply, decode
from stopgo.mission.run.events import AnyEvent, Pose, PoseReport, StateReport, event_of
from stopgo.mission.run.run_commands import Answer

TRY_S: Final = 1.0
"""Timeout of one try."""
POLL_S: Final = 0.02
"""Pause between two checks of a condition."""
MOST_PAGES: Final = 1000
"""Largest number of pages that are read of a journal or a mission."""

K = TypeVar("K")
V = TypeVar("V")


class Published:
    """Messages that the robot has published since the link was opened, undecoded."""

    def __init__(self, link: Link, keys: KeyExpressions) -> None:
        self.states: list[bytes] = []
        self.events: list[bytes] = []
        self.poses: list[bytes] = []
        link.hear(keys.state, lambda key, payload: self.states.append(payload))
        link.hear(keys.event, lambda key, payload: self.events.append(payload))
        link.hear(keys.pose, lambda key, payload: self.poses.append(payload))


class RobotQueries:
    """Queries of one robot under test; `commander` and `link` may be another station's for a while."""

    def __init__(self, link: Link, keys: KeyExpressions, *, commander: str, timeout_s: float) -> None:
        self.link = link
        self.keys = keys
        self.commander = commander
        self.timeout_s = timeout_s
        self.published = Published(link, keys)

    def ask_raw(self, key: str, payload: bytes = b"", **parameters: str) -> bytes | None:
        """Return the undecoded answer; repeat the query until there is one or the time is up."""
        deadline = time.monotonic() + self.timeout_s
        while (left := deadline - time.monotonic()) > 0:
            reply = self.link.ask(key, payload, timeout_s=min(TRY_S, left), parameters=parameters)
            if reply is not None:
                return reply
            time.sleep(min(POLL_S, left))
        return None

    def ask(self, key: str, payload: bytes = b"", **parameters: str) -> Any:
        """Return the decoded answer; raise `Nonconforming` if there is none or it is not a message."""
        raw = self.ask_raw(key, payload, **parameters)
        if raw is None:
            why = f" ({self.link.distrusted})" if self.link.distrusted else ""
            raise Nonconforming(f"no answer that can be believed on {self._tail(key)}{why}")
        return read_reply(raw)

    def ask_for(self, kind: type[K], key: str, payload: bytes = b"", **parameters: str) -> K:
        """Return the answer, which must be of type `kind`."""
        reply = self.ask(key, payload, **parameters)
        must(isinstance(reply, kind), f"{self._tail(key)} was answered with {describe(reply)}")
        return reply

    def must_be_malformed(self, key: str, payload: bytes, what: str, **parameters: str) -> None:
        """Raise `Nonconforming` unless the answer is `Malformed`."""
        reply = self.ask(key, payload, **parameters)
        must(
            isinstance(reply, Malformed),
            f"{what} on {self._tail(key)} was answered with {describe(reply)}, not Malformed",
        )

    def _tail(self, key: str) -> str:
        return key.removeprefix(f"{self.keys.root}/")

    def info(self) -> Info:
        """Request the robot's info."""
        return self.ask_for(Info, self.keys.info)

    def wait(self, seen: Callable[[], V | None], within_s: float, what: str) -> V:
        """Call `seen` until it returns something; raise `Nonconforming` with `what` after `within_s`."""
        deadline = time.monotonic() + within_s
        while True:
            found = seen()
            if found is not None:
                return found
            must(time.monotonic() < deadline, f"within {within_s:g} s {what}")
            time.sleep(POLL_S)

    def wait_for_state(self, *states: str, within_s: float = 20.0) -> StateReport:
        """Wait until the robot's state is one of these, and return it."""

        def reached() -> StateReport | None:
            state = self.info().state
            return state if state.state in states else None

        return self.wait(reached, within_s, f"the robot did not become {' or '.join(states)}")

    def log(self, since: int = 0) -> list[AnyEvent]:
        """Read all events of the journal above a number."""
        events: list[AnyEvent] = []
        for _ in range(MOST_PAGES):
            page = self.ask_for(LogPage, self.keys.log, since=str(since))
            if not page.bodies:
                break
            for body in page.bodies:
                event = read_event(bytes(body))
                must(event.number > since, "the log does not go on behind `since`")
                events.append(event)
                since = event.number
        return events

    def pose(self) -> Pose:
        """Return the robot's pose; raise `NotTried` if it publishes none."""

        def newest() -> PoseReport | None:
            return None if not self.published.poses else read(self.published.poses[-1], PoseReport, "a pose")

        self.published.poses.clear()
        try:
            return self.wait(newest, self.timeout_s, "no pose was published").pose
        except Nonconforming as unknown:
            raise NotTried(f"the pose of the robot is not known: {unknown}") from None


def read_reply(raw: bytes) -> Any:
    """Decode an answer of any type."""
    return read(raw, Reply, "an answer")


def read(raw: bytes, kind: Any, what: str) -> Any:
    """Decode a message strictly; raise `Nonconforming` if it is not of type `kind`."""
    with _readable(raw, what):
        return decode(raw, kind)


def read_event(raw: bytes) -> AnyEvent:
    """Decode an event; raise `Nonconforming` if it is none."""
    with _readable(raw, "an event"):
        return event_of(raw)


@contextmanager
def _readable(raw: bytes, what: str) -> Iterator[None]:
    try:
        yield
    except msgspec.DecodeError as error:
        raise Nonconforming(f"{what} cannot be read ({error}): {short(raw)}") from None


def describe(reply: Any) -> str:
    """Describe an answer in a few words."""
    if isinstance(reply, Rejected):
        return f"Rejected {reply.reason} ({short('; '.join(reply.messages))})"
    if isinstance(reply, Answer):
        return f"Answer {reply.outcome} {reply.reason or ''}".strip()
    if isinstance(reply, Malformed):
        return f"Malformed ({short(reply.message)})"
    return type(reply).__name__


def must_reject(reply: Any, *reasons: str) -> None:
    """Raise `Nonconforming` unless an answer is a rejection for one of these reasons."""
    must(
        isinstance(reply, Rejected) and reply.reason in reasons,
        f"answered with {describe(reply)}, not Rejected {' or '.join(reasons)}",
    )
