"""A site whose ends hold keys, in memory, and a router between them that need not be honest."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from stopgo.bridge.link.authority import init_site, issue
from stopgo.bridge.link.keys import HolderRole, now_utc, read_keys
from stopgo.bridge.link.memory_link import SignedMessage, Switchboard
from stopgo.bridge.link.signatures import KeySigning
from stopgo.bridge.station.station import Station
from stopgo.mission.run.events import StateReport
from tests.bridge.world import Field

HOLDERS: tuple[tuple[HolderRole, str], ...] = (
    ("robot", "r1"), ("robot", "r2"), ("station", "alice"), ("station", "bob"), ("viewer", "vera"),
)  # fmt: skip


def keys_of_site(folder: Path) -> Path:
    """A folder with keys for two robots, two stations and a viewer."""
    now = now_utc()
    init_site(folder, now=now)
    for role, name in HOLDERS:
        issue(folder, role, name, now=now)
    return folder


class Router(Switchboard):
    """Carries every message, unless `meddle` makes something else of it."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[SignedMessage] = []
        self.meddle: Callable[[SignedMessage], Iterable[SignedMessage]] = lambda packet: (packet,)

    def carried(self, packet: SignedMessage) -> Iterable[SignedMessage]:
        self.seen.append(packet)
        return self.meddle(packet)


class GuardedField(Field):
    """A robot with keys, behind a router."""

    def __init__(self, site: Path, **details: Any) -> None:
        super().__init__(**details)
        self.site = site
        self.set_forward_ns = 0
        self.board = self.router = Router()
        self.link = self.board.link()
        self.answer_as("r1")

    def signing(self, name: str, *, boot_id: str = "") -> KeySigning:
        """Signatures of `name`, on the field's clock."""
        held = read_keys(self.site / name, now=now_utc())
        return KeySigning(held, boot_id=boot_id, clock_ns=self.steady_ns)

    def steady_ns(self) -> int:
        """Time that no date changes."""
        return self.clock.now_ns() - self.set_forward_ns

    def set_date(self, seconds: float) -> None:
        """Somebody sets the robot's date, forward or back."""
        self.set_forward_ns += round(seconds * 1e9)
        self.clock.jump(seconds)

    def agent_state(self) -> StateReport:
        """The robot's present report of its state."""
        return self.agent._state()

    def answer_as(self, name: str) -> None:
        """Answer for the robot, with the keys of `name`."""
        self.serve(self.signing(name, boot_id=self.controller.boot_id))

    def guarded_station(self, name: str = "alice") -> Station:
        """A station with the keys of `name`; the robot goes on answering as it does."""
        held = read_keys(self.site / name, now=now_utc())
        link = self.board.link(self.signing(name))
        return Station(link, self.keys, commander=name, timeout_s=0.1, patience_s=0.1, held=held)
