"""The simulated vehicle on a link: one thread receives, lets time pass, and sends."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from stopgo.bridge.link.clock import WallClock
from stopgo.bridge.mavlink.simulated.command_handlers import NORTHMOST
from stopgo.bridge.mavlink.simulated.complete_vehicle import complete_vehicle
from stopgo.bridge.mavlink.simulated.lossy_line import on_line
from stopgo.bridge.mavlink.simulated.profiles import profile_named
from stopgo.bridge.mavlink.simulated.rover import to_east
from stopgo.bridge.mavlink.simulated.tuning import Tuning
from stopgo.bridge.mavlink.simulated.vehicle import Vehicle, VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_faults import read_vehicle_faults
from stopgo.bridge.mavlink.vehicle_link.transport import open_transport
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import MessageQueue, Who, Wire, read_link
from stopgo.mission.console.process import wait_for
from stopgo.mission.errors import InputError
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.enums import Component
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.run.events import Pose

OF_CAMERA = ("CAMERA_IMAGE_CAPTURED", "CAMERA_INFORMATION")
OPTION = "--mavlink"
VEHICLE = Who(1, 1)


@dataclass(frozen=True)
class VehicleOptions:
    """Options of the command line."""

    url: str
    profile: str = "strict"
    state: Path | None = None
    speed_up: float = 1.0
    signing_key: Path | None = None
    insecure: bool = False
    origin: str | None = None
    at: Pose | None = None
    """In the site's frame, whose +y has the bearing that the origin gives."""
    faults: tuple[str, ...] = field(default=())
    seed: int | None = 1
    """As in `VehicleSetup`."""
    parameters: tuple[str, ...] = field(default=())
    """NAME=VALUE each."""


def run_vehicle(options: VehicleOptions, ready: Callable[[Url], None]) -> None:
    """Run a vehicle until SIGTERM or Ctrl-C; `ready` is called once it can be reached."""
    signal.signal(signal.SIGTERM, _leave)
    url, key = read_link(options.url, options.signing_key, insecure=options.insecure, option=OPTION)
    with vehicle_on(url, setup_of(options), speed_up=options.speed_up, signing_key=key) as stopped:
        ready(url)
        wait_for(stopped)
    if stopped.error is not None:
        raise stopped.error
    raise SystemExit(1)  # its thread has printed why


class ForVehicle(MessageQueue):
    """Messages for the vehicle, also those for its camera."""

    overhears = True

    def wants(self, message: Message) -> bool:
        system, component = (getattr(message, f"target_{part}", 0) for part in ("system", "component"))
        return system in (0, VEHICLE.system) and component in (0, VEHICLE.component, Component.CAMERA)


class Stopped(threading.Event):
    """Set when a vehicle has stopped, by itself or on command."""

    error: OSError | None = None
    """Error of the disk when the vehicle's state could not be saved."""


@contextmanager
def vehicle_on(
    url: Url, setup: VehicleSetup, *, speed_up: float = 1.0, signing_key: bytes | None = None
) -> Iterator[Stopped]:
    """A vehicle at `url` while the block runs; the event is set when it has stopped by itself.

    Raises
    ------
    InputError
        If it cannot be opened there.
    """
    signs = setup.faults.any("unsigned") is None
    line = on_line(open_transport(url), setup.faults)
    with closing(Wire(line, me=VEHICLE, signing_key=signing_key, signs=signs)) as wire:
        apart = setup.faults.any("camera") is not None

        def send(message: Message) -> None:
            of_camera = apart and message.get_type() in OF_CAMERA
            wire.send(message, component=Component.CAMERA if of_camera else None)

        vehicle = complete_vehicle(setup, clock=WallClock(speed_up=speed_up), wall=WallClock(), send=send)
        stop, stopped = threading.Event(), Stopped()
        thread = threading.Thread(target=_live, args=(vehicle, wire, stop, stopped), daemon=True)
        thread.start()
        try:
            yield stopped
        finally:
            stop.set()
            thread.join()


def _live(vehicle: Vehicle, wire: Wire, stop: threading.Event, stopped: Stopped) -> None:
    try:
        with wire.filling(ForVehicle()) as waiting:
            while not stop.is_set():
                message = waiting.get(vehicle.wait_s)
                if message is None:
                    vehicle.advance()
                else:
                    vehicle.receive(message)
        vehicle.save_pose()
    except OSError as error:
        stopped.error = error
    finally:
        stopped.set()


def setup_of(options: VehicleOptions) -> VehicleSetup:
    """Setup of the vehicle by these options.

    Raises
    ------
    InputError
        Naming the option.
    """
    origin = None if options.origin is None else read_origin(options.origin)
    heading = 0.0 if origin is None else origin.heading_deg
    level = (
        None if origin is None else SiteOrigin(lat=origin.lat, lon=origin.lon, alt=origin.alt, heading_deg=0)
    )
    autopilot = profile_named(options.profile)
    return VehicleSetup(
        autopilot=autopilot,
        state=options.state,
        origin=level,
        at=None if options.at is None else to_east(options.at, heading),
        faults=read_vehicle_faults(options.faults),
        seed=options.seed,
        changed=dict(_read_parameter(autopilot.name, text) for text in options.parameters),
    )


def _read_parameter(kind: str, text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        raise InputError(f"--param {text}: write NAME=VALUE, as WP_RADIUS=0.1") from None
    if not Tuning(kind).set(name, number):
        known = ", ".join(sorted(Tuning(kind).values))
        raise InputError(f"--param {text}: not an allowed value; its parameters are {known}")
    return name, number


def read_origin(text: str) -> SiteOrigin:
    """LAT,LON,ALT or LAT,LON,ALT,HEADING: degrees, metres, and the bearing of the site's +y."""
    numbers = text.split(",")
    try:
        lat, lon, alt, heading = (float(number) for number in (*numbers, "0")[:4])
    except ValueError:
        lat = float("nan")
    if not (len(numbers) in (3, 4) and abs(lat) <= NORTHMOST and abs(lon) <= 180 and abs(alt) < 1e5):
        raise InputError(
            f"--origin {text}: write LAT,LON,ALT or LAT,LON,ALT,HEADING in degrees and metres, as 47,8,400"
        )
    return SiteOrigin(lat=lat, lon=lon, alt=alt, heading_deg=heading)


def _leave(signum: int, frame: object) -> None:
    raise SystemExit(0)
