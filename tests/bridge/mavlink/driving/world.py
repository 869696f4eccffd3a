"""A robot's end that drives a simulated vehicle: all in this process, joined by UDP and a link in memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec

from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.mavlink.driving.autopilot_body import AutopilotBody
from stopgo.bridge.mavlink.simulated.profiles import profile_named
from stopgo.bridge.mavlink.simulated.rover import to_east
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFaults
from stopgo.bridge.mavlink.simulated.vehicle_process import vehicle_on
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, reached
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.robot.program import RobotOptions, robot_on
from stopgo.bridge.robot.simulated_faults import NO_FAULTS
from stopgo.bridge.station.follow import Report
from stopgo.bridge.station.station import Station
from stopgo.mission.document import Mission, Scan, with_digest
from stopgo.mission.errors import NegativeResult
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.run.events import AnyEvent, Pose, PoseReport, Scanned, StateReport
from tests.bridge.world import corridor, pose_of
from tests.ports import free_port

SITE = SiteOrigin(lat=47.4, lon=8.5, alt=400.0, heading_deg=30.0)
"""+y bears 30°, so +x, along the corridor, bears 120°."""
ON_HOLD = dialect.MAVLINK_MSG_ID_HEARTBEAT


def site_mission(*, site: SiteOrigin | None = SITE, **details: Any) -> Mission:
    """Two stops along a corridor that has its place on the earth; each scan takes two seconds."""
    scan = Scan(profile="default", duration_s=2.0, timeout_s=20.0)
    made = corridor(**{"stops": 2, "closed": False, "settle_s": 0.2, "scan": scan, **details})
    return with_digest(msgspec.structs.replace(made, georeference=site))


def cornered_mission(*, speed: float = 0.5, **details: Any) -> Mission:
    """Five stops after legs of 3 m, at corners of 90°, as of the Rover whose log is in `../shared`."""
    places = [(0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (6.0, 3.0), (6.0, 0.0), (9.0, 0.0)]
    made = site_mission(stops=5, **details)
    robot = msgspec.structs.replace(made.robot, speed=speed)
    stops = tuple(
        msgspec.structs.replace(stop, x=x, y=y, approach=(before, (x, y)))
        for stop, before, (x, y) in zip(made.stops, places, places[1:], strict=False)
    )
    return with_digest(msgspec.structs.replace(made, stops=stops, robot=robot))


def site_pose(pose: Pose) -> Pose:
    """Pose on the site of a vehicle there, x to the east and y to the north of the origin."""
    return to_east(pose, -SITE.heading_deg)


class Rover:
    """A simulated vehicle that can be switched off and on, and to which an operator has a line of his own."""

    def __init__(
        self,
        state: Path,
        profile: str,
        *,
        faults: VehicleFaults = NO_FAULTS,
        origin: SiteOrigin | None = SITE,
        signing_key: bytes | None = None,
        seed: int = 1,
        changed: Mapping[str, float] | None = None,
    ) -> None:
        self._key = signing_key
        start = site_mission().start
        level = None if origin is None else msgspec.structs.replace(origin, heading_deg=0.0)
        self.profile = profile
        self.url = Url("udpout", "127.0.0.1", free_port())
        self._first = VehicleSetup(
            autopilot=profile_named(profile), state=state, origin=level, faults=faults,
            at=to_east(pose_of(start), SITE.heading_deg), seed=seed, changed=changed or {},
        )  # fmt: skip
        self.setup = replace(self._first, at=None, faults=NO_FAULTS)
        self._life = ExitStack()
        self.on(self._first)

    def on(self, setup: VehicleSetup | None = None) -> None:
        """Switch it on; it stands where it stood."""
        url = Url("udpin", self.url.host, self.url.number)
        self._life.enter_context(vehicle_on(url, setup or self.setup, signing_key=self._key))

    def off(self) -> None:
        self._life.close()

    @contextmanager
    def operator(self) -> Iterator[Operator]:
        with reached(self.url, vehicle=1, signing_key=self._key) as peer:
            yield Operator(peer, self.profile)


class Operator:
    """Somebody with a remote control."""

    def __init__(self, peer: Peer, profile: str) -> None:
        self.peer = peer
        self.autopilot = profile_named(profile)

    def hold(self) -> None:
        self.peer.order(dialect.MAV_CMD_DO_SET_MODE, *self.autopilot.modes.hold.params)

    def manual(self) -> None:
        self.peer.order(dialect.MAV_CMD_DO_SET_MODE, *self.autopilot.modes.numbers["manual"].params)

    def arm(self) -> None:
        self.peer.order(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def disarm(self) -> None:
        self.peer.order(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)

    def mode(self) -> str:
        """The mode that the vehicle is in now."""
        beat = self.peer.ask(dialect.MAVLINK_MSG_ID_HEARTBEAT)
        assert beat is not None
        return self.autopilot.modes.name(self.autopilot.mode_of(beat))

    def place(self) -> tuple[float, float]:
        """Metres north and east of its origin."""
        told = self.peer.ask(dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
        assert told is not None
        return (told.x, told.y)


@contextmanager
def rover(tmp_path: Path, profile: str, **details: Any) -> Iterator[tuple[Rover, Operator]]:
    """A vehicle on hold at the mission's start, and its operator."""
    made = Rover(tmp_path / "vehicle", profile, **details)
    try:
        with made.operator() as operator:
            operator.hold()
            yield made, operator
    finally:
        made.off()


@contextmanager
def gateway(tmp_path: Path, url: Url, **details: Any) -> Iterator[Station]:
    """A robot's end that drives the vehicle at `url`, and a station that commands it."""
    board, keys = Switchboard(), KeyExpressions("r1")
    body = AutopilotBody(str(url), **{"arm": True, "vehicle": 1, **details})
    options = RobotOptions(name="r1", listen="", state=tmp_path / "robot", body=body)
    with robot_on(board.link(), keys, options):
        yield Station(board.link(), keys, commander="test", timeout_s=5.0)


def until(reports: Iterable[Report], fits: Callable[[Any], bool]) -> Any:
    """The first report that fits; later ones are left for the next call."""
    return next(report for report in reports if fits(report))


def is_state(*states: str) -> Callable[[Any], bool]:
    return lambda report: isinstance(report, StateReport) and report.state in states


def is_driving(metres: float) -> Callable[[Any], bool]:
    """A pose on the way, so many metres along the corridor."""
    return lambda report: isinstance(report, PoseReport) and report.speed > 0.1 and report.pose.x > metres


def events_of(station: Station) -> list[AnyEvent]:
    return list(station.log())


def scanned(station: Station) -> list[str]:
    return [event.stop for event in events_of(station) if isinstance(event, Scanned)]


def bearing_of_corridor() -> tuple[float, float]:
    """North and east of a metre along the corridor."""
    return math.cos(math.radians(120)), math.sin(math.radians(120))


def retried(station: Station) -> bool:
    """True once the robot knows that the vehicle is handed over."""
    try:
        return station.command("retry").outcome == "ok"
    except NegativeResult:
        return False
