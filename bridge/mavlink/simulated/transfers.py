"""The simulated vehicle's end of the mission protocol: uploads and downloads, by its kind's behaviour."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import msgspec

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.simulated.item_check import ACCEPTED, verdict
from stopgo.bridge.mavlink.simulated.replies import (
    item_float,
    item_int,
    item_wanted,
    mission_ack,
    mission_count,
    received_item,
)
from stopgo.bridge.mavlink.simulated.vehicle_faults import Mishaps
from stopgo.bridge.mavlink.simulated.vehicle_store import ALL, FENCE, MISSION, RALLY, Store, StoredItems
from stopgo.bridge.mavlink.vehicle_link.wire import Who
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.enums import MissionResult
from stopgo.mission.mavlink.items import Item
from stopgo.mission.mavlink.telemetry import Message

KINDS = (MISSION, FENCE, RALLY)


@dataclass
class Upload:
    """A list that a station is sending."""

    station: Who
    kind: int
    count: int
    received_ns: int
    asked_ns: int = 0
    items: list[Item] = field(default_factory=list)
    marked: int | None = None
    """The item that is to be the current one."""


@dataclass
class Download:
    """A list that a station fetches in order."""

    station: Who
    kind: int
    received_ns: int
    next: int = 0


class Transfers:
    """Handles every mission message of every station.

    Parameters
    ----------
    stored
        Called with the kind and the item marked as current when a list was replaced or cleared.
    running
        True while the mission is being driven.
    event
        Called with the number of an upload's item that has come, before anything else; false: it is lost.
    """

    def __init__(
        self,
        autopilot: Autopilot,
        store: Store,
        clock: Clock,
        *,
        send: Callable[[Message], None],
        text: Callable[[str], None],
        home: Callable[[], Item],
        stored: Callable[[int, int | None], None],
        running: Callable[[], bool],
        event: Callable[[int], bool],
        mishaps: Mishaps,
    ) -> None:
        self._autopilot, self._habits = autopilot, autopilot.behaviour
        self._one_by_one = autopilot.gives_items == "in order"
        self._store, self._clock = store, clock
        self._send, self._text, self._home, self._stored = send, text, home, stored
        self._running, self._event, self._mishaps = running, event, mishaps
        self._upload: Upload | None = None
        self._download: Download | None = None
        self._done: tuple[Who, int, int] | None = None
        """Station, kind and number of the last item that completed an upload."""
        self._completed = 0
        self.handlers: dict[str, Callable[[Who, Message], None]] = {
            "MISSION_COUNT": self._count,
            "MISSION_ITEM_INT": self._item,
            "MISSION_ITEM": self._item,
            "MISSION_REQUEST_LIST": self._request_list,
            "MISSION_REQUEST_INT": self._request,
            "MISSION_REQUEST": self._request,
            "MISSION_CLEAR_ALL": self._clear_all,
            "MISSION_ACK": self._take_ack,
            "MISSION_REQUEST_PARTIAL_LIST": self._partial,
            "MISSION_WRITE_PARTIAL_LIST": self._partial,
        }

    def reset(self) -> None:
        """Forget transfers in progress, as a reboot does."""
        self._upload = self._download = self._done = None

    @property
    def running(self) -> bool:
        """True while a list is sent or received."""
        return self._upload is not None or self._download is not None

    def tick(self) -> None:
        """Request again, or give up."""
        now, up, down, habits = self._clock.now_ns(), self._upload, self._download, self._habits
        if up and now - up.received_ns > habits.give_up_s * 1e9:
            self._upload = None
            if habits.tells_giving_up:
                self._ack(up.station, MissionResult.OPERATION_CANCELLED, up.kind)
        elif up and now - up.asked_ns >= habits.ask_again_s * 1e9:
            self._ask(up)
        if down and now - down.received_ns > habits.give_up_s * 1e9:
            self._download = None

    def items(self, kind: int) -> StoredItems:
        """The list as stations read it: with the vehicle's own home as first item where it has one."""
        items = self._store.items(kind)
        if kind == MISSION and self._autopilot.home_first and items:
            return (self._home(), *items[1:])
        return items

    # Messages in

    def _count(self, who: Who, message: Message) -> None:
        up, habits, kind = self._upload, self._habits, message.mission_type
        if kind not in KINDS:
            return self._ack(who, MissionResult.UNSUPPORTED, kind)
        if up and up.station != who:
            return self._ack(who, habits.other_station, kind)
        if up and up.items and not habits.begins_again:
            return self._ack(who, MissionResult.ERROR, kind)
        if self._download and self._one_by_one:
            return self._ack(who, MissionResult.ERROR, kind)  # source: busy, until it is acknowledged
        if message.count > self._autopilot.max_items:
            return self._ack(who, MissionResult.NO_SPACE, kind)
        self._begin(who, kind, message.count)

    def _begin(self, who: Who, kind: int, count: int) -> None:
        self._upload = self._download = self._done = None
        if count == 0:
            self._replace(kind, (), None)
            return self._ack(who, ACCEPTED, kind)
        if not self._habits.atomic:
            self._store.put(kind, self._store.items(kind)[:count])
        self._upload = Upload(who, kind, count, received_ns=self._clock.now_ns())
        self._ask(self._upload)

    def _item(self, who: Who, message: Message) -> None:
        up = self._upload
        if not self._event(message.seq):
            return
        if up and up.station != who:
            return self._busy(who, message.mission_type)
        if up is None:
            return self._no_upload(who, message)
        if message.mission_type != up.kind:
            return self._ack(who, MissionResult.ERROR, message.mission_type)
        if message.seq != len(up.items):
            return self._stray(up)
        item = received_item(message)
        result = self._verdict(up, item)
        if result != ACCEPTED:
            self._upload = None
            return self._ack(who, result, up.kind)
        up.received_ns = self._clock.now_ns()
        self._take(up, item, marked=bool(message.current))

    def _verdict(self, up: Upload, item: Item) -> int:
        number = len(up.items)
        fault = self._mishaps.once("nack", number)
        if fault:
            return int(fault.amount) or int(MissionResult.ERROR)
        return verdict(self._autopilot, up.kind, item)

    def _take(self, up: Upload, item: Item, *, marked: bool) -> None:
        number = len(up.items)
        up.items.append(self._autopilot.kept(item))
        if marked:
            up.marked = number
        if not self._habits.atomic:
            old = self._store.items(up.kind)
            self._store.put(up.kind, (*old[:number], up.items[-1], *old[number + 1 :]))
        if len(up.items) < up.count:
            return self._ask(up)
        self._upload, self._done = None, (up.station, up.kind, number)
        self._replace(up.kind, tuple(up.items), up.marked)
        self._completed += 1
        if not self._mishaps.due("lostack", self._completed):
            self._ack(up.station, ACCEPTED, up.kind)

    def _stray(self, up: Upload) -> None:
        """Answer an item that was not requested; it shows a live station, except to ArduPilot."""
        if self._habits.strays != "tell":
            up.received_ns = self._clock.now_ns()
        if self._habits.strays == "tell":
            self._ack(up.station, MissionResult.INVALID_SEQUENCE, up.kind)
        elif self._habits.strays == "ask":
            self._ask(up)

    def _no_upload(self, who: Who, message: Message) -> None:
        """Answer an item without an upload: a late copy of one that is over, or nonsense."""
        kind, done = message.mission_type, self._done
        if (who, kind, message.seq) == done:
            return self._ack(who, self._habits.last_again, kind)
        late = done is not None and (who, kind) == done[:2] and message.seq < done[2]
        if not (late and self._habits.forgives_late):
            self._ack(who, MissionResult.ERROR, kind)

    def _request_list(self, who: Who, message: Message) -> None:
        kind = message.mission_type
        if kind not in KINDS:
            return self._ack(who, MissionResult.UNSUPPORTED, kind)
        if self._upload:
            return self._busy(who, kind)
        if self._one_by_one:
            if self._download and (self._download.station, self._download.kind) != (who, kind):
                return self._busy(who, kind)
            self._download = Download(who, kind, received_ns=self._clock.now_ns())
        self._send_count(who, kind)

    def _request(self, who: Who, message: Message) -> None:
        kind, number = message.mission_type, message.seq
        if kind not in KINDS:
            return self._ack(who, MissionResult.UNSUPPORTED, kind)
        if self._upload:
            return self._busy(who, kind)
        if self._one_by_one and not self._in_order(who, kind, number):
            return
        items = self.items(kind)
        if kind == MISSION and self._autopilot.home_first and not items:
            items = (self._home(),)  # source: home can always be read
        if number < len(items):
            whole = message.get_type() == "MISSION_REQUEST_INT"
            return self._send((item_int if whole else item_float)(who, kind, number, items[number]))
        if self._habits.counts_again:
            self._send_count(who, kind)
            return self._ack(who, MissionResult.ERROR, kind)
        self._ack(who, MissionResult.INVALID_SEQUENCE, kind)

    def _in_order(self, who: Who, kind: int, number: int) -> bool:
        """True for the next item, or the last one again; anything else ends the download (source)."""
        down = self._download
        if down is None or (down.station, down.kind) != (who, kind):
            return False
        if number not in (down.next, down.next - 1):
            self._download = None
            self._ack(who, MissionResult.ERROR, kind)
            return False
        down.received_ns, down.next = self._clock.now_ns(), number + 1
        return True

    def _clear_all(self, who: Who, message: Message) -> None:
        kind = message.mission_type
        if kind not in (*KINDS, ALL):
            return self._ack(who, MissionResult.UNSUPPORTED, kind)
        if (self._upload or self._download) and self._one_by_one:
            return self._busy(who, kind)
        drives = kind in (MISSION, ALL) and self._running()
        if self._upload or (drives and not self._habits.clears_in_auto):
            return self._ack(who, MissionResult.ERROR, kind)
        for one in KINDS if kind == ALL else (kind,):
            self._replace(one, (), None)
        self._ack(who, ACCEPTED, kind)

    def _take_ack(self, who: Who, message: Message) -> None:
        up, down = self._upload, self._download
        if down and (down.station, down.kind) == (who, message.mission_type):
            self._download = None
        ends = message.type == MissionResult.OPERATION_CANCELLED and self._habits.cancels
        if up and ends and (up.station, up.kind) == (who, message.mission_type):
            self._upload = None

    def _busy(self, who: Who, kind: int) -> None:
        """Refuse during an upload by somebody else: PX4 does so in a text for people only (source)."""
        if self._habits.busy_in_words:
            self._text("Busy with a mission transfer")
        else:
            self._ack(who, self._habits.other_station, kind)

    def _partial(self, who: Who, message: Message) -> None:
        self._ack(who, MissionResult.UNSUPPORTED, message.mission_type)

    # Messages out

    def _replace(self, kind: int, items: StoredItems, marked: int | None) -> None:
        """Store a list; the same list again changes nothing on PX4 (source: it compares a checksum)."""
        same = _same(self._store.items(kind), items)
        self._store.put(kind, items)
        if not (same and self._habits.same_is_nothing):
            self._stored(kind, marked)

    def _ask(self, up: Upload) -> None:
        up.asked_ns = self._clock.now_ns()
        self._send(item_wanted(up.station, up.kind, len(up.items), as_int=self._habits.asks_int))

    def _ack(self, who: Who, result: int, kind: int) -> None:
        self._send(mission_ack(who, kind, result))

    def _send_count(self, who: Who, kind: int) -> None:
        count = len(self.items(kind))
        self._send(mission_count(who, kind, count))


def _same(one: StoredItems, other: StoredItems) -> bool:
    """True if two lists are equal bit by bit, as a NaN is not equal to itself."""
    return msgspec.msgpack.encode(one) == msgspec.msgpack.encode(other)
