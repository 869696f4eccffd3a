"""Guard of the vehicle's list: it is read back and compared whenever somebody may have changed it.

A comparison is due after an upload by another station was heard, when the vehicle reports another mission id,
before a scan counts, and a while after the last one: the faster the link, the sooner. A vehicle that reports
the mission id of a list that was found to be ours is not read again.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass

from stopgo.bridge.mavlink.auto.logbook import Logbook
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.vehicle_link.messages import of_mission
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.wire import Who, sender
from stopgo.mission.errors import NegativeResult, RobotUnreachable
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.observer import Observer
from stopgo.mission.mavlink.read_back import differences
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.run.states import Run

SOONEST_CHECK_NS, CHECK_NS = 2 * 10**9, 30 * 10**9
"""Shortest and longest time between two comparisons that nothing else calls for."""
SHARE = 20
"""Multiple of the time that a comparison takes after which the next is due: reading takes 5 % of the link."""
AGAIN_NS = 10**9
"""Time after one that the vehicle refused, or that got no answer: another station may use the list."""
SHOWN = 3
"""Number of differences in a report."""
BY_VEHICLE = frozenset({"MISSION_ACK", "MISSION_REQUEST", "MISSION_REQUEST_INT"})
"""Messages of an upload that the vehicle sends to the station."""
BY_STATION = frozenset(
    {"MISSION_COUNT", "MISSION_ITEM", "MISSION_ITEM_INT", "MISSION_CLEAR_ALL", "MISSION_WRITE_PARTIAL_LIST"}
)
UPLOAD_MESSAGES = BY_VEHICLE | BY_STATION


@dataclass(frozen=True)
class ListComparison:
    """Result of reading the list back."""

    listed: ListedMission
    began_ns: int
    differences: tuple[str, ...]
    mission_id: int
    """Id of the list, as the vehicle reported it before and after; 0 if it reports none."""


class ListGuard:
    """Compares the vehicle's list with the one that was sent. `compare` may be called in any thread."""

    def __init__(self, book: Logbook, peer: Peer, observer: Observer) -> None:
        self._book = book
        self._peer = peer
        self._observer = observer
        self._comparing = threading.Lock()
        self._last: ListComparison | None = None
        self._failed_ns = 0
        self._wanted = False
        self._pause_ns = SOONEST_CHECK_NS
        self._least_ns = CHECK_NS
        """Shortest time that a comparison took: a longer one was held up by losses, not by a slow link."""
        self._uploader: tuple[Who, int] | None = None
        """Station whose upload was heard last, and when."""

    def hear(self, message: Message) -> None:
        """Take a message of another station's upload."""
        who = uploader_of(message, self._peer.who, self._peer.wire.me)
        if who is not None:
            self._uploader, self._wanted = (who, self._book.clock.now_ns()), True

    def want(self) -> None:
        """Have the list compared soon."""
        self._wanted = True

    def is_due(self, run: Run) -> bool:
        """True if the list must be compared now."""
        now_ns, last = self._book.clock.now_ns(), self._last
        if run.state in ("IDLE", "FINISHED", "ABORTED") or now_ns < self._failed_ns + AGAIN_NS:
            return False
        if last is None or self._wanted or self._has_other_id:
            return True
        known = last.mission_id != 0 and not last.differences
        return now_ns > last.began_ns + (CHECK_NS if known else self._pause_ns)

    def compare(self) -> None:
        """Read the list back, unless no run is in progress; the vehicle may refuse it for now."""
        with self._comparing:
            listed, began_ns = self._book.listed, self._book.clock.now_ns()
            if listed is None or self._book.run.state in ("FINISHED", "ABORTED"):
                return
            self._wanted, number = False, self._observer.position.mission_id
            try:
                found = differences(listed.sent, download(self._peer))
            except (NegativeResult, RobotUnreachable):
                self._wanted, self._failed_ns = True, began_ns
                return
            self._least_ns = min(self._least_ns, self._book.clock.now_ns() - began_ns)
            self._pause_ns = max(SOONEST_CHECK_NS, min(CHECK_NS, SHARE * self._least_ns))
            number = number if number == self._observer.position.mission_id else 0
            self._last = ListComparison(listed, began_ns, found, number)
            if not found and self._uploader is not None and self._uploader[1] < began_ns:
                self._uploader = None

    def is_ours(self, listed: ListedMission, since_ns: int) -> bool:
        """True if the list was found to be the one that was sent, at some time after `since_ns`."""
        last = self._last
        if last is None or last.listed is not listed or last.differences:
            return False
        same_id = last.mission_id != 0 and last.mission_id == self._observer.position.mission_id
        return last.began_ns > since_ns or (same_id and self._observer.position.current_ns > since_ns)

    def is_compared(self, listed: ListedMission) -> bool:
        """True if the list was found to be the one that was sent, by the last comparison."""
        return self._last is not None and self._last.listed is listed and not self._last.differences

    def difference(self, listed: ListedMission, run: Run) -> str:
        """The items that differ and who changed them, in words; empty if no difference is known.

        A comparison from before the run went on says nothing about the list by which it did.
        """
        last, items = self._last, self._observer.position.items
        found: tuple[str, ...] = ()
        old = last is not None and run.state == "RUNNING" and last.began_ns < self._book.changed_ns
        if last is not None and last.listed is listed and not old:
            found = last.differences
        if items is not None and items != listed.end:
            found = (f"it holds {items} items, {listed.end} were sent",)
        if not found:
            return ""
        more = f" (and {len(found) - SHOWN} more)" if len(found) > SHOWN else ""
        change = f"{self._by} has changed the vehicle's mission"
        if items == 0 and self._uploader is None:
            change = "the vehicle has lost its mission in a restart, or somebody has cleared it"
        return f"{change}: {'; '.join(found[:SHOWN])}{more}"

    @property
    def _by(self) -> str:
        if self._uploader is None:
            return "somebody"
        who, _ = self._uploader
        return f"system {who.system}, component {who.component}"

    @property
    def _has_other_id(self) -> bool:
        last = self._last
        return last is not None and last.mission_id not in (0, self._observer.position.mission_id)


def uploader_of(message: Message, vehicle: Who, me: Who) -> Who | None:
    """The station that uploads a mission to the vehicle, by a message of that upload; `None` for our own."""
    name, who = message.get_type(), sender(message)
    if name not in UPLOAD_MESSAGES or not of_mission(message):
        return None
    if who == vehicle:
        station = Who(message.target_system, message.target_component)
        return station if name in BY_VEHICLE and station.system != 0 and station != me else None
    to_vehicle = message.target_system in (0, vehicle.system)
    return who if name in BY_STATION and to_vehicle and who != me else None
