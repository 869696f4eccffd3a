"""A vehicle of a few lines: answers by the book, except for what a test replaces.

It speaks through our own wire, so that a test is about the uploader; MAVSDK is the stranger in other tests.
"""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Sequence
from typing import Any

from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import Who, Wire, sender, wire
from stopgo.mission.mavlink.telemetry import Message
from tests.ports import free_port

ASK_AGAIN_S = 0.25
VEHICLE = Who(1, dialect.MAV_COMP_ID_AUTOPILOT1)


class Scripted:
    """Listens on a UDP port (`url` is where stations send to) until the block ends."""

    autopilot = dialect.MAV_AUTOPILOT_GENERIC
    type = dialect.MAV_TYPE_GROUND_ROVER
    """Of vehicle."""

    def __init__(
        self, held: Sequence[Message] = (), *, who: Who = VEHICLE, signing_key: bytes | None = None
    ) -> None:
        self.who = who
        self.held = list(held)
        """The mission it holds, as MISSION_ITEM_INT."""
        self.heard: Counter[str] = Counter()
        self.acks: list[int] = []
        """MAV_MISSION_RESULT of every MISSION_ACK that came."""
        self.base_mode = 0
        self.custom_mode = 0
        self.origin: tuple[int, int, int] | None = (470_000_000, 80_000_000, 0)
        self.boot_ms = 60_000
        self.silent = False
        """Neither hears nor says anything, as long as it is set."""
        self._key = signing_key
        self._port = free_port()
        self.url = Url("udpout", "127.0.0.1", self._port)
        self.receiving: list[Message | None] | None = None
        self._source: Who | None = None
        self._asked_s = 0.0
        self._closing = threading.Event()

    def __enter__(self) -> Any:
        self._opened = wire(Url("udpin", "127.0.0.1", self._port), me=self.who, signing_key=self._key)
        self.wire: Wire = self._opened.__enter__()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._closing.set()
        self._thread.join()
        self._opened.__exit__(None, None, None)

    def send(self, message: Message) -> None:
        if not self.silent:
            self.wire.send(message)

    def _work(self) -> None:
        beat_at = 0.0
        with self.wire.waiting() as waiting:
            while not self._closing.is_set():
                if time.monotonic() >= beat_at:
                    beat_at = time.monotonic() + 0.1
                    self.beat()
                self.ask_again()
                message = waiting.get(0.02)
                if message is not None and not self.silent:
                    self.take(message)

    def beat(self) -> None:
        self.boot_ms += 100
        self.send(
            dialect.MAVLink_heartbeat_message(
                self.type, self.autopilot, self.base_mode, self.custom_mode, dialect.MAV_STATE_ACTIVE, 3
            )
        )
        self.send(dialect.MAVLink_system_time_message(0, self.boot_ms))

    def take(self, message: Message) -> None:
        name = message.get_type()
        self.heard[name] += 1
        work = getattr(self, f"on_{name.lower()}", None)
        if work is not None:
            work(message, sender(message))

    # Commands.

    def on_command_long(self, message: Message, to: Who) -> None:
        if message.command == dialect.MAV_CMD_REQUEST_MESSAGE:
            return self.on_request_message(int(message.param1), to)
        self.answer(message.command, dialect.MAV_RESULT_ACCEPTED, to)

    def on_request_message(self, number: int, to: Who) -> None:
        if number == dialect.MAVLINK_MSG_ID_SYSTEM_TIME:
            return self.send(dialect.MAVLink_system_time_message(0, self.boot_ms))
        known = number == dialect.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
        result = dialect.MAV_RESULT_ACCEPTED if known else dialect.MAV_RESULT_UNSUPPORTED
        self.answer(dialect.MAV_CMD_REQUEST_MESSAGE, result, to)
        if known and self.origin is not None:
            self.send(dialect.MAVLink_gps_global_origin_message(*self.origin))

    def on_set_gps_global_origin(self, message: Message, to: Who) -> None:
        if self.origin is None:
            self.origin = (message.latitude, message.longitude, message.altitude)

    def answer(self, command: int, result: int, to: Who) -> None:
        self.send(dialect.MAVLink_command_ack_message(command, result, 0, 0, to.system, to.component))

    # The mission protocol: an upload is kept apart until it is complete.

    def on_mission_ack(self, message: Message, to: Who) -> None:
        self.acks.append(message.type)

    def on_mission_request_list(self, message: Message, to: Who) -> None:
        self.send(dialect.MAVLink_mission_count_message(to.system, to.component, len(self.held), 0))

    def on_mission_request_int(self, message: Message, to: Who) -> None:
        if message.seq < len(self.held):
            item = self.held[message.seq]
            item.target_system, item.target_component = to.system, to.component
            self.send(item)
        else:
            self.ack(dialect.MAV_MISSION_INVALID_SEQUENCE, to)

    def on_mission_count(self, message: Message, to: Who) -> None:
        if self.receiving is not None and self._source != to:
            self.ack(dialect.MAV_MISSION_DENIED, to)
        elif message.count == 0:
            self.held, self.receiving = [], None
            self.ack(dialect.MAV_MISSION_ACCEPTED, to)
        else:
            self.receiving, self._source = [None] * message.count, to
            self.request(0, to)

    def on_mission_item_int(self, message: Message, to: Who) -> None:
        if self.receiving is None:
            return
        if message.seq != self.awaited:
            return
        self.receiving[message.seq] = message
        if None in self.receiving:
            self.request(self.awaited, to)
        else:
            self.held, self.receiving = [item for item in self.receiving if item is not None], None
            self.ack(dialect.MAV_MISSION_ACCEPTED, to)

    @property
    def awaited(self) -> int:
        """Number of the item that the vehicle requests."""
        assert self.receiving is not None
        return self.receiving.index(None)

    def ask_again(self) -> None:
        """As the book says, 250 ms after the last request."""
        if (
            self.receiving is not None
            and self._source is not None
            and time.monotonic() > self._asked_s + 0.25
        ):
            self.request(self.awaited, self._source)

    def request(self, seq: int, to: Who) -> None:
        self._asked_s = time.monotonic()
        self.send(dialect.MAVLink_mission_request_int_message(to.system, to.component, seq, 0))

    def ack(self, result: int, to: Who, mission_type: int = 0) -> None:
        self.send(dialect.MAVLink_mission_ack_message(to.system, to.component, result, mission_type))
