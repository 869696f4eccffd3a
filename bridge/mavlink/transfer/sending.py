"""One transfer of items to a vehicle, until the vehicle reports its end, or sends no data any more.

Items are sent ahead of the vehicle's requests, a few at a time: so a lost request costs nothing, and a lost
item costs a round trip. The vehicle's messages only hint at its progress; `download` shows what it holds in
the end.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from stopgo.bridge.console import Progress
from stopgo.bridge.mavlink.transfer.flow_control import Pace, TransferTimeout
from stopgo.bridge.mavlink.vehicle_link.messages import (
    ack_message,
    count_message,
    item_message,
    list_request,
    of_mission,
)
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.mavlink.enums import MissionResult
from stopgo.mission.mavlink.items import Item
from stopgo.mission.mavlink.telemetry import Message

How = Literal["accepted", "unsure", "refused", "busy", "dropped", "silent", "rebooted"]
"""End of a transfer, as far as the vehicle reports it.

unsure: the last item was sent, and no ACCEPTED came · refused: an item, or their number · busy: it never
began · dropped: the vehicle ended it · silent: no data came any more · rebooted: the vehicle restarted.
"""

CERTAIN_ERRORS = 3
"""Tries with an error that make it certain; fewer may be late answers to what was sent before."""
PROBE_S = 1.0
PROBE_AFTER = 4
"""Time or number of windows without an answer to the last item, after which the list is requested."""
TIME_EACH = 5
"""Number of windows without an answer after which the vehicle's clock is requested again."""
HINTS = frozenset({MissionResult.INVALID_SEQUENCE})
ENDINGS = frozenset({MissionResult.ERROR, MissionResult.DENIED, MissionResult.OPERATION_CANCELLED})
"""Results that report that there is no transfer, not that an item is wrong."""
RECEIVED = ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK", "MISSION_COUNT")


@dataclass(frozen=True)
class TransferEnd:
    how: How
    at: int
    """Number of items known to have arrived; for a refusal, the number of the refused one."""
    result: int = MissionResult.ACCEPTED
    """MAV_MISSION_RESULT that ended it."""


def send_items(
    peer: Peer,
    items: Sequence[Item],
    *,
    window: int,
    patience_s: float | None = None,
    progress: Progress | None = None,
) -> TransferEnd:
    """Send the items as the whole mission; none of them clears it."""
    pace = Pace(window, peer.round_trips)
    return _Sending(peer, items, pace, patience_s or peer.patience_s, progress).run()


class _Sending:
    """One transfer to the vehicle."""

    def __init__(
        self, peer: Peer, items: Sequence[Item], pace: Pace, patience_s: float, progress: Progress | None
    ) -> None:
        self._peer = peer
        self._items = items
        self._pace = pace
        self._silence = TransferTimeout(patience_s)
        self._progress = progress
        self._boots = peer.boots
        self._begun = False
        """True once the vehicle has requested an item."""
        self._base = 0
        """All items before this one have arrived."""
        self._top = 0
        """All items before this one were sent."""
        self._sent_s: dict[int, float] = {}
        """Time when each item was sent last; -1 is the count."""
        self._sent_again: set[int] = set()
        self._moved_s = time.monotonic()
        self._error = False
        """True if the vehicle has reported that no transfer is in progress, since its last request."""
        self._errors = 0
        self._result: int = MissionResult.ACCEPTED
        self._unanswered = 0
        """Number of windows in a row without an answer."""
        self._probed = False
        """True once the list was requested, which the vehicle does not send while it receives one."""

    def run(self) -> TransferEnd:
        with self._peer.waiting(*RECEIVED) as waiting:
            self._send_count()
            while (ended := self._over()) is None:
                message = waiting.get(self._moved_s + self._pace.again_s - time.monotonic())
                if message is None:
                    self._again()
                elif of_mission(message) and (ended := self._take(message)) is not None:
                    return ended
            return ended

    def _over(self) -> TransferEnd | None:
        """End of the transfer, if there is nothing more to wait for."""
        if self._peer.boots != self._boots:
            return TransferEnd("rebooted", self._base)
        if self._errors >= CERTAIN_ERRORS:
            return TransferEnd("dropped" if self._begun else "busy", self._base, self._result)
        if self._silence.over:
            return TransferEnd("unsure" if self._all_sent else "silent", self._base)
        return None

    def _take(self, message: Message) -> TransferEnd | None:
        if message.get_type() == "MISSION_ACK":
            return self._take_ack(message.type)
        if message.get_type() == "MISSION_COUNT":
            return self._take_count(message.count)
        self._take_request(message.seq)
        return None

    @property
    def _all_sent(self) -> bool:
        return self._top == len(self._items) and (self._begun or not self._items)

    def _take_count(self, count: int) -> TransferEnd | None:
        """End a transfer whose count the vehicle reports: it has all items, or had as many before."""
        return TransferEnd("unsure", self._base) if self._probed and count == len(self._items) else None

    def _take_request(self, seq: int) -> None:
        if seq >= len(self._items):
            return
        self._error, self._errors = False, 0
        self._silence.received(went_on=seq > self._base or not self._begun)
        if seq > self._base or not self._begun:
            self._go_on(seq)
        elif seq == self._base:
            self._lacks_base()
        elif self._old_enough(seq):
            self._send(seq)

    def _go_on(self, seq: int) -> None:
        """Go on: the vehicle has all items before `seq`."""
        self._see_round_trip(seq - 1)
        self._begun = True
        self._base = seq
        self._top = max(self._top, seq)
        self._moved_s = time.monotonic()
        self._unanswered = 0
        self._pace.went_on()
        if self._progress is not None:
            self._progress(seq, len(self._items))
        self._push()

    def _see_round_trip(self, seq: int) -> None:
        if seq in self._sent_s:
            see = self._pace.guessed if seq in self._sent_again else self._pace.saw
            see(time.monotonic() - self._sent_s[seq])

    def _lacks_base(self) -> None:
        """Send again the item that the vehicle waits for, if it can have arrived by now."""
        if self._old_enough(self._base):
            self._send_window()
        else:
            self._push()

    def _old_enough(self, seq: int) -> bool:
        return time.monotonic() - self._sent_s.get(seq, 0.0) >= self._pace.soonest_s

    def _take_ack(self, result: int) -> TransferEnd | None:
        self._silence.received(went_on=False)
        if result == MissionResult.ACCEPTED:
            return TransferEnd("accepted", len(self._items)) if self._all_sent else None
        if result in HINTS:
            if self._begun:
                self._lacks_base()
            return None
        if result in ENDINGS:
            return self._take_ending(result)
        return TransferEnd("refused", self._base, result)

    def _take_ending(self, result: int) -> TransferEnd | None:
        """Note that the vehicle reports no transfer: it is over, or it never began."""
        self._error, self._result = True, result
        if self._all_sent and result != MissionResult.DENIED:
            return TransferEnd("unsure", self._base, result)
        return None

    def _again(self) -> None:
        """Send again what may be lost, as nothing came in time."""
        self._pace.waited()
        self._moved_s = time.monotonic()
        self._errors += self._error
        if not self._begun:
            self._error = False
            if self._silence.seconds > PROBE_S:  # the end of a download may have been lost
                self._peer.send(ack_message(MissionResult.ACCEPTED, self._peer.who))
            self._send_count()
            return
        self._unanswered += 1
        if self._unanswered % TIME_EACH == 0:
            self._peer.ask_clock()  # was it restarted?
        self._send_window()
        if self._all_sent and (self._silence.seconds > PROBE_S or self._unanswered >= PROBE_AFTER):
            self._probed = True
            self._peer.send(list_request(self._peer.who))

    def _send_count(self) -> None:
        self._note_sent(-1)
        self._peer.send(count_message(len(self._items), self._peer.who))

    def _push(self) -> None:
        """Send the items in the window that were not sent before."""
        for seq in range(self._top, self._end):
            self._send(seq)
        self._top = max(self._top, self._end)

    def _send_window(self) -> None:
        for seq in range(self._base, self._end):
            self._send(seq)
        self._top = max(self._top, self._end)
        self._moved_s = time.monotonic()

    @property
    def _end(self) -> int:
        """End of the window: later each time nothing came, else a vehicle that has them all would wait."""
        further = min(self._unanswered, self._pace.window) if self._pace.window > 1 else 0
        return min(len(self._items), self._base + self._pace.window + further)

    def _send(self, seq: int) -> None:
        self._note_sent(seq)
        self._peer.send(item_message(self._items[seq], seq, self._peer.who))

    def _note_sent(self, seq: int) -> None:
        if seq in self._sent_s:
            self._sent_again.add(seq)
        self._sent_s[seq] = time.monotonic()
