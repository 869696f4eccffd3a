"""Download of the items that a vehicle holds, each requested until it has come.

Several are requested at once where the vehicle answers in any order.
"""

from __future__ import annotations

import time

from stopgo.bridge.console import Progress
from stopgo.bridge.mavlink.transfer.flow_control import Pace, TransferTimeout, window_for
from stopgo.bridge.mavlink.vehicle_link.messages import (
    ack_message,
    item_of,
    item_request,
    list_request,
    of_mission,
    result_name,
)
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.errors import NegativeResult, RobotUnreachable
from stopgo.mission.mavlink.enums import MissionResult
from stopgo.mission.mavlink.items import Item
from stopgo.mission.mavlink.telemetry import Message

STUCK = 12
"""Tries without a new item, after which items are requested one by one: MAVSDK's vehicle needs that."""
REFUSALS = 3
"""Refused tries that make a refusal certain; fewer may be late answers to something else."""
END_REPEATS = 3
"""The end of a transfer is not answered, so it is sent this often: until it comes, PX4 takes no other."""


def download(
    peer: Peer, *, patience_s: float | None = None, progress: Progress | None = None
) -> tuple[Item, ...]:
    """All items that the vehicle holds, its home included where it has one.

    Raises
    ------
    RobotUnreachable
        If no data come from it any more.
    AnswerIsNo
        If it refuses, which it does while another station uploads.
    """
    with peer.reading_list:
        return _downloaded(peer, patience_s or peer.patience_s, progress)


def _downloaded(peer: Peer, patience_s: float, progress: Progress | None) -> tuple[Item, ...]:
    window = 1 if peer.in_order or peer.autopilot.gives_items == "in order" else window_for(peer)
    reading = _Reading(peer, window, patience_s, progress)
    refused = reading.run()
    if refused is not None and window > 1:
        peer.in_order = True
        reading = _Reading(peer, 1, patience_s, progress)
        refused = reading.run()
    if refused is not None:
        raise NegativeResult(
            f"{peer}: reading its mission was answered {result_name(refused)}; "
            "another station may be using it: try again"
        )
    return tuple(reading.items[seq] for seq in sorted(reading.items))


class _Reading:
    """One transfer from the vehicle."""

    def __init__(self, peer: Peer, window: int, patience_s: float, progress: Progress | None) -> None:
        self.items: dict[int, Item] = {}
        self._peer = peer
        self._pace = Pace(window, peer.round_trips)
        self._silence = TransferTimeout(patience_s)
        self._progress = progress
        self._count: int | None = None
        self._next = 0
        self._lists = 0
        """Number of requests for the list."""
        self._listed_s = self._moved_s = time.monotonic()
        """Time of the last new item."""
        self._asked_s: dict[int, float] = {}
        """Time of the last request for each item that has not come."""
        self._asked_again: set[int] = set()
        self._refused = False
        """True after a refusal since the last try, or since the last item if their order may matter."""
        self._refusals = 0
        self._result = MissionResult.ACCEPTED

    def run(self) -> int | None:
        """Read all items; return the result by which the vehicle refuses, or `None`."""
        with self._peer.waiting("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK") as waiting:
            self._ask_count()
            while self._count is None or len(self.items) < self._count:
                if self._silence.over:
                    raise RobotUnreachable(self._incomplete())
                message = waiting.get(self._pace.again_s if self._count is None else self._due_s())
                if message is None:
                    self._again()
                elif of_mission(message):
                    self._take(message)
                if self._refusals >= REFUSALS or self._stuck:
                    return self._result
        for _ in range(END_REPEATS):
            self._peer.send(ack_message(MissionResult.ACCEPTED, self._peer.who))
        return None

    def _incomplete(self) -> str:
        if self._count is None or not self.items:
            return f"{self._peer} did not send its mission{self._peer.why_silent()}"
        sent = f"{len(self.items)} of the {self._count} items that it announced"
        return f"{self._peer} sent {sent}, and no more{self._peer.why_silent(answers=True)}"

    @property
    def _stuck(self) -> bool:
        """True if the vehicle seems to wait for a request of another item, in order."""
        late = time.monotonic() - self._moved_s > STUCK * self._pace.again_s
        return late and self._may_want_order

    @property
    def _may_want_order(self) -> bool:
        several = self._pace.window > 1 and self._count is not None
        return several and self._peer.autopilot.gives_items != "any order"

    def _take(self, message: Message) -> None:
        name = message.get_type()
        if name == "MISSION_ACK":
            self._silence.received(went_on=False)
            if message.type != MissionResult.ACCEPTED:
                self._refused, self._result = True, message.type
            return
        self._refused, self._refusals = False, 0
        if name == "MISSION_COUNT":
            self._take_count(message.count)
        elif self._count is not None and message.seq < self._count:
            self._take_item(message)

    def _take_count(self, count: int) -> None:
        if self._count == count:
            return
        self._silence.received(went_on=True)
        if self._count is None:
            see = self._pace.saw if self._lists == 1 else self._pace.guessed
            see(time.monotonic() - self._listed_s)
        self._moved_s = time.monotonic()
        self._count = count
        self.items.clear()
        self._asked_s.clear()
        self._next = 0
        self._ask_more()

    def _take_item(self, message: Message) -> None:
        is_new = message.seq not in self.items
        self._silence.received(went_on=is_new)
        self._moved_s = time.monotonic() if is_new else self._moved_s
        asked_s = self._asked_s.pop(message.seq, None)
        if asked_s is not None and message.seq not in self._asked_again:
            self._pace.saw(time.monotonic() - asked_s)
        self.items[message.seq] = item_of(message)
        self._pace.went_on()
        if self._progress is not None and self._count:
            self._progress(len(self.items), self._count)
        self._ask_more()

    def _ask_count(self) -> None:
        self._lists += 1
        self._listed_s = time.monotonic()
        self._peer.send(list_request(self._peer.who))

    def _ask_more(self) -> None:
        """Fill the window with requests for the next items."""
        while len(self._asked_s) < self._pace.window and self._next < (self._count or 0):
            self._next += 1
            if self._next - 1 not in self.items:
                self._ask(self._next - 1)

    def _ask(self, seq: int) -> None:
        self._asked_s[seq] = time.monotonic()
        self._peer.send(item_request(seq, self._peer.who))

    def _due_s(self) -> float:
        """Seconds until the first item has to be requested again."""
        return min(self._asked_s.values()) + self._pace.again_s - time.monotonic()

    def _again(self) -> None:
        self._refusals += self._refused
        self._refused = self._refused and self._may_want_order
        if self._count is None:
            self._pace.waited()
            self._ask_count()
        late_s = time.monotonic() - self._pace.again_s
        for seq in [seq for seq, asked_s in self._asked_s.items() if asked_s <= late_s]:
            self._asked_again.add(seq)
            self._ask(seq)
