"""A simulated vehicle without a socket, on clocks that pass on request, and stations that talk to it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.mavlink.simulated.complete_vehicle import complete_vehicle
from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_faults import read_vehicle_faults
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.wire import Who
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.items import Command, Item, MavFrame
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.run.events import Pose

ORIGIN = SiteOrigin(lat=47.4, lon=8.5, alt=400.0, heading_deg=0.0)
STATION, OTHER = Who(254, 190), Who(253, 190)
HOME = Item(Command.NAV_WAYPOINT, MavFrame.GLOBAL)
ACCEPTED = dialect.MAV_MISSION_ACCEPTED
OBEYED = dialect.MAV_RESULT_ACCEPTED


def waypoint(north_m: float, east_m: float, *, hold: float = 1.0) -> Item:
    """So many metres from the origin, as ArduPilot counts them: a step is 11 mm of latitude."""
    step = 0.011131884502145034
    lat, lon = 474_000_000 + north_m / step, 85_000_000 + east_m / (step * 0.6768752)
    params = (hold, 0.0, 0.0, 0.0)
    return Item(Command.NAV_WAYPOINT, MavFrame.GLOBAL_RELATIVE_ALT_INT, params, round(lat), round(lon))


def delay(seconds: float) -> Item:
    return Item(Command.NAV_DELAY, MavFrame.MISSION, (seconds, -1.0, -1.0, -1.0))


def camera(number: int) -> Item:
    return Item(Command.IMAGE_START_CAPTURE, MavFrame.MISSION, (0.0, 0.0, 1.0, float(number)))


def script(number: int, seconds: float) -> Item:
    return Item(Command.DO_SEND_SCRIPT_MESSAGE, MavFrame.MISSION, (100.0, float(number), seconds, 60.0))


class Bench:
    """One vehicle and everything it has said.

    Without a seed it drives exactly: its places and times are then counted on paper.
    """

    def __init__(
        self, profile: str = "strict", *, state: Path | None = None, origin: SiteOrigin | None = ORIGIN,
        faults: Sequence[str] = (), at: Pose | None = None, seed: int | None = None, **changed: float,
    ) -> None:  # fmt: skip
        self.clock, self.wall = SimulatedClock(), SimulatedClock()
        self.all: list[Message] = []
        made = read_vehicle_faults(faults)
        setup = VehicleSetup(PROFILES[profile], state, origin, at, made, seed, changed)
        self.vehicle = complete_vehicle(setup, clock=self.clock, wall=self.wall, send=self._hear)
        self.first = 1 if self.vehicle.autopilot.home_first else 0
        self._wires = {who: dialect.MAVLink(None, *who) for who in (STATION, OTHER)}
        self._own = dialect.MAVLink(None, 1, 1)

    def _hear(self, message: Message) -> None:
        """Through bytes and back, for what cannot be packed must not be said."""
        self.all += self._own.parse_buffer(message.pack(self._own)) or []

    def say(self, message: Message, who: Who = STATION) -> list[Message]:
        """Answers of the vehicle to a message, without telemetry."""
        before = len(self.all)
        wire = self._wires[who]
        for parsed in wire.parse_buffer(message.pack(wire)) or []:
            self.vehicle.receive(parsed)
        return self.all[before:]

    def said(self, *types: str) -> list[Message]:
        return [message for message in self.all if message.get_type() in types]

    def last(self, kind: str) -> Any:
        return self.said(kind)[-1]

    def results(self) -> list[int]:
        """Of every MISSION_ACK so far."""
        return [message.type for message in self.said("MISSION_ACK")]

    def pass_time(self, seconds: float, *, step_s: float = 0.5) -> None:
        """On both clocks."""
        for _ in range(round(seconds / step_s)):
            self.clock.wait(step_s)
            self.wall.wait(step_s)
            self.vehicle.advance()

    # The mission protocol

    def listed(self, items: Sequence[Item]) -> list[Item]:
        """As they are numbered on the vehicle."""
        return [HOME, *items] if self.first else list(items)

    def count(self, count: int, *, kind: int = 0, who: Who = STATION) -> list[Message]:
        return self.say(dialect.MAVLink_mission_count_message(1, 1, count, kind), who)

    def item(
        self, number: int, item: Item, *, kind: int = 0, who: Who = STATION, current: int = 0
    ) -> list[Message]:
        return self.say(item_message(number, item, kind=kind, current=current), who)

    def upload(self, items: Sequence[Item], *, kind: int = 0) -> int:
        """All items in order, home in front where it belongs; the last ACK, -1 if there was none."""
        listed = self.listed(items) if kind == 0 else list(items)
        self.count(len(listed), kind=kind)
        for number, item in enumerate(listed):
            self.item(number, item, kind=kind)
        return self.results()[-1] if self.results() else -1

    def download(self, *, kind: int = 0, who: Who = STATION) -> list[Message]:
        said = self.say(dialect.MAVLink_mission_request_list_message(1, 1, kind), who)
        count = next(message.count for message in said if message.get_type() == "MISSION_COUNT")
        read = [
            message
            for number in range(count)
            for message in self.say(dialect.MAVLink_mission_request_int_message(1, 1, number, kind), who)
            if message.get_type() == "MISSION_ITEM_INT"
        ]
        self.say(dialect.MAVLink_mission_ack_message(1, 1, ACCEPTED, kind), who)
        return read

    def held(self) -> list[Item]:
        """The mission without home, as it is read back."""
        return [item_of(message) for message in self.download()][self.first :]

    def kept(self, items: Sequence[Item]) -> list[Item]:
        return [self.vehicle.autopilot.kept(item) for item in items]

    # Orders

    def command(self, command: int, *params: float, who: Who = STATION) -> int:
        seven = list(itertools.islice(itertools.chain(params, itertools.repeat(0.0)), 7))
        said = self.say(dialect.MAVLink_command_long_message(1, 1, command, 0, *seven), who)
        return next((message.result for message in said if message.get_type() == "COMMAND_ACK"), -1)

    def arm(self) -> int:
        return self.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def mode(self, name: str) -> int:
        mode = self.vehicle.autopilot.modes.numbers[name]  # type: ignore[index]
        return self.command(dialect.MAV_CMD_DO_SET_MODE, *mode.params)

    def start(self) -> None:
        assert (self.arm(), self.mode("auto")) == (OBEYED, OBEYED)

    def reached(self) -> list[int]:
        """Items reported as reached, repeats left out, counted without home."""
        numbers = [message.seq - self.first for message in self.said("MISSION_ITEM_REACHED")]
        return [number for number, _ in itertools.groupby(numbers)]

    def at(self) -> tuple[float, float]:
        """Metres north and east."""
        message = self.say(request_message(dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED))[-1]
        return message.x, message.y


def request_message(number: int) -> Message:
    return dialect.MAVLink_command_long_message(
        1, 1, dialect.MAV_CMD_REQUEST_MESSAGE, 0, number, 0, 0, 0, 0, 0, 0
    )


def item_message(number: int, item: Item, *, kind: int = 0, current: int = 0) -> Message:
    return dialect.MAVLink_mission_item_int_message(
        1, 1, number, item.frame, item.command, current, int(item.autocontinue), *item.params,
        item.x, item.y, item.z, kind,
    )  # fmt: skip


def item_of(message: Message) -> Item:
    return Item(
        message.command, message.frame, (message.param1, message.param2, message.param3, message.param4),
        message.x, message.y, message.z, autocontinue=bool(message.autocontinue),
    )  # fmt: skip


def many(count: int) -> list[Item]:
    return [replace(delay(1.0), params=(float(number), -1.0, -1.0, -1.0)) for number in range(count)]
