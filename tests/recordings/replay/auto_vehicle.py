"""A simulated rover that drives a mission by itself, and the log of a station that hears it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as dialect

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.mavlink.simulated.complete_vehicle import complete_vehicle
from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import Vehicle, VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_faults import read_vehicle_faults
from stopgo.mission.document import Mission
from stopgo.mission.files import mission_json
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.read_back import upload_of
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Pose
from stopgo.recordings.logs import read_log
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.replaying import replay
from tests.mission.mavlink.following.worlds import tour
from tests.recordings.logs.writing import write_telemetry_log

ORIGIN = SiteOrigin(lat=47.3977, lon=8.5456, alt=488.0, heading_deg=0.0)
ROVER, STATION = 1, 255
AUTO_MODE, HOLD_MODE = 10, 4
"""Of ArduPilot."""
BEFORE_S, AFTER_S, STEP_S = 3.0, 60.0, 0.05
"""Before the order to go, from then on, and between two looks of the vehicle at its clock."""
Row = tuple[int, int, Any]
"""A message that a station hears: time, system and message."""


@dataclass(frozen=True)
class FromVehicle:
    """A message that is only in the log, as sent by the vehicle."""

    message: Any


@dataclass(frozen=True)
class FromStation:
    """A message of another station than the one that logs."""

    system: int
    message: Any


def mission(**details: Any) -> Mission:
    """For a vehicle that drives as a real one, and so takes its time to stand still."""
    return msgspec.structs.replace(tour(**{"settle_s": 3.0, **details}), georeference=ORIGIN)


def rover_setting(folder: Path, faults: tuple[str, ...], autopilot: str = "ardupilot") -> VehicleSetup:
    start = Pose(x=0.0, y=0.0, heading=0.0)
    found = read_vehicle_faults(faults)
    return VehicleSetup(PROFILES[autopilot], folder, ORIGIN, start, found, seed=1)


def heard(
    folder: Path,
    plan: Mission,
    *,
    autopilot: str = "ardupilot",
    faults: tuple[str, ...] = (),
    orders: dict[float, Any] | None = None,
    witness: Callable[[Vehicle], None] = lambda vehicle: None,
    seconds: float = AFTER_S,
) -> list[Row]:
    """What a station hears of a rover that is given a mission and drives it; `orders` by seconds from AUTO.

    An order may be several messages. `witness` is given the vehicle before it drives.
    """
    clock, rows = SimulatedClock(), list[Row]()
    vehicle = complete_vehicle(
        rover_setting(folder / "vehicle", faults, autopilot),
        clock=clock, wall=clock,
        send=lambda message: rows.append((clock.now_ns(), ROVER, message)),
    )  # fmt: skip
    witness(vehicle)

    def say(messages: Iterable[Any]) -> None:
        for message in messages:
            _said(message, vehicle, rows, clock.now_ns())

    def drive(until_s: float) -> None:
        for _ in range(round(until_s / STEP_S)):
            clock.wait(STEP_S)
            vehicle.advance()

    drive(BEFORE_S)
    go, past = Orders(plan, autopilot), 0.0
    say((*go.upload(), *go.arm(), *go.auto()))
    for at, order in sorted((orders or {}).items()):
        drive(at - past)
        say(order if isinstance(order, tuple) else (order,))
        past = at
    drive(seconds - past)
    return rows


def _said(message: Any, vehicle: Vehicle, rows: list[Row], now_ns: int) -> None:
    """Put a message into the log, and give it to the vehicle if a station sends it."""
    if isinstance(message, FromVehicle):
        rows.append((now_ns, ROVER, message.message))
        return
    station = STATION
    if isinstance(message, FromStation):
        station, message = message.system, message.message
    rows.append((now_ns, station, message))
    packed = dialect.MAVLink(None, srcSystem=station, srcComponent=190)
    vehicle.receive(packed.decode(bytearray(message.pack(packed))))


_UNDISTURBED: dict[tuple[Any, ...], list[Row]] = {}
"""What a station hears of drives that nobody disturbs, by all that they depend on."""


def logged(
    path: Path, plan: Mission, *, kept: Callable[[int, str], bool] = lambda ns, name: True, **given: Any
) -> Path:
    """A station's log of that. `kept` decides which of the vehicle's messages it hears, by time and name."""
    if {"orders", "witness"}.isdisjoint(given):
        key = (mission_json.encode(plan), *sorted(given.items()))
        if key not in _UNDISTURBED:
            _UNDISTURBED[key] = heard(path.parent, plan, **given)
        rows = _UNDISTURBED[key]
    else:
        rows = heard(path.parent, plan, **given)
    return write_telemetry_log(
        path, [row for row in rows if row[1] != ROVER or kept(row[0], row[2].get_type())]
    )


@dataclass(frozen=True)
class Orders:
    """Messages of a station to a vehicle of one kind that holds a mission."""

    plan: Mission
    autopilot: str = "ardupilot"

    def auto(self) -> tuple[Any, ...]:
        return (self._mode("auto"),)

    def hold(self) -> tuple[Any, ...]:
        return (self._mode("hold"),)

    def arm(self) -> tuple[Any, ...]:
        return (command(Command.COMPONENT_ARM_DISARM, 1),)

    def disarm(self) -> tuple[Any, ...]:
        return (command(Command.COMPONENT_ARM_DISARM, 0),)

    def jump(self, stop: str) -> tuple[Any, ...]:
        """Make a stop's waypoint the current item."""
        return (dialect.MAVLink_mission_set_current_message(1, 1, self.item(stop)),)

    def item(self, stop: str) -> int:
        """Sequence number of a stop's waypoint on the vehicle."""
        sent = translate(self.plan, self.autopilot, trigger="auto")
        index = next(k for k, one in enumerate(sent.placed) if (one.role, one.stop) == ("stop", stop))
        return PROFILES[self.autopilot].sequence(index)

    def upload(self, system: int = STATION) -> tuple[FromStation, ...]:
        """Give the vehicle the mission."""
        return tuple(FromStation(system, message) for message in self._listed(1, 1))

    def read_back(self) -> tuple[FromVehicle, ...]:
        """The vehicle's answers to a station that reads its list."""
        return tuple(FromVehicle(message) for message in self._listed(STATION, 190))

    def _listed(self, system: int, component: int) -> list[Any]:
        items = upload_of(translate(self.plan, self.autopilot, trigger="auto"))
        to = (system, component)
        rows = [
            dialect.MAVLink_mission_item_int_message(
                *to, number, item.frame, item.command, 0, 1, *item.params, item.x, item.y, item.z
            )
            for number, item in enumerate(items)
        ]
        return [dialect.MAVLink_mission_count_message(system, component, len(items)), *rows]

    def _mode(self, name: Any) -> Any:
        mode = PROFILES[self.autopilot].modes.numbers[name]
        return command(Command.DO_SET_MODE, *mode.params)


def command(number: int, *params: float) -> Any:
    given = (*params, *(0.0,) * (7 - len(params)))
    return dialect.MAVLink_command_long_message(1, 1, number, 0, *given)


def in_mode(number: int) -> Any:
    return command(Command.DO_SET_MODE, 1, number)


def item_of(plan: Mission, stop: str) -> int:
    """Sequence number of a stop's waypoint on an ArduPilot vehicle."""
    return Orders(plan).item(stop)


def read_back(plan: Mission) -> tuple[FromVehicle, ...]:
    """The vehicle's answers to a station that reads its list."""
    return Orders(plan).read_back()


def replayed(path: Path, plan: Mission) -> Replay:
    return replay(read_log(path), plan, Placing())
