"""A small site: three stops round a corner, a simulated vehicle that holds their mission, and its logbook."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from stopgo.bridge.mavlink.auto.logbook import Logbook, logbook, remember
from stopgo.bridge.mavlink.auto.vehicle_commands import Consent
from stopgo.bridge.mavlink.auto.vehicle_station import Options, connect
from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_faults import read_vehicle_faults
from stopgo.bridge.mavlink.simulated.vehicle_process import vehicle_on
from stopgo.bridge.mavlink.simulated.vehicle_store import Store
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.station.station import Station
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.items import ItemList
from stopgo.mission.mavlink.read_back import upload_of
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import AnyEvent, Pose
from stopgo.mission.run.states import Run
from tests.mission.mavlink.following.worlds import told, tour
from tests.ports import free_port

SPEED_UP = 5.0
PATIENCE_S = 600.0
"""Of simulated time."""
TUNED = {"px4": {"NAV_ACC_RAD": 0.1}}
"""As PX4 comes, half a metre from a stop is there."""
KINDS = {"strict": "generic", "ardupilot": "ardupilot", "px4": "px4"}
"""The autopilot of each profile of the simulated vehicle."""


def real_tour(**details: Any) -> Mission:
    """The tour for a vehicle that drives as a real one: off its stops, and late to stand still."""
    made = tour(**{"tolerance_m": 0.3, "settle_s": 3.0, **details})
    return with_digest(msgspec.structs.replace(made, robot=msgspec.structs.replace(made.robot, speed=0.5)))


@dataclass
class Site:
    """A vehicle's world; `up` switches the vehicle on, `reached` is a station's process that talks to it."""

    folder: Path
    profile: str = "ardupilot"
    mission: Mission = field(default_factory=real_tour)
    faults: Sequence[str] = ()
    trigger: Any = "auto"
    origin: SiteOrigin | None = None
    at: Pose | None = field(default_factory=lambda: Pose(x=0.0, y=0.0, heading=0.0))
    speed_up: float = SPEED_UP
    seed: int | None = 1
    """It drives as a real one, by chances of this seed; `None`: exactly."""
    changed: Mapping[str, float] = field(default_factory=dict)
    key: bytes | None = None

    def __post_init__(self) -> None:
        self.sent: ItemList = translate(self.mission, KINDS[self.profile], trigger=self.trigger)
        self.url = Url("udpout", "127.0.0.1", free_port())
        self.origin = self.origin or self.mission.georeference
        self.load(self.sent)
        with self.book() as book:
            remember(book, self.mission, self.sent)

    def load(self, sent: ItemList) -> None:
        """Let the vehicle hold this list."""
        vehicle = autopilot_named(sent.autopilot)
        Store(self.folder / "vehicle").update(mission=tuple(vehicle.kept(item) for item in upload_of(sent)))

    @contextmanager
    def up(self) -> Iterator[None]:
        """The vehicle is on."""
        made = read_vehicle_faults(self.faults)
        setup = VehicleSetup(
            PROFILES[self.profile], self.folder / "vehicle", self.origin, self.at, made, self.seed,
            {**TUNED.get(self.profile, {}), **self.changed},
        )  # fmt: skip
        listening = Url("udpin", self.url.host, self.url.number)
        with vehicle_on(listening, setup, speed_up=self.speed_up, signing_key=self.key):
            yield

    @contextmanager
    def book(self) -> Iterator[Logbook]:
        with logbook(self.url, 1, self.folder / "station") as opened:
            yield opened

    @contextmanager
    def reached(
        self, *, arm: bool = True, disarm: bool = False, any_origin: bool = False, **options: Any
    ) -> Iterator[Station]:
        """The vehicle, from a process of its own."""
        given: dict[str, Any] = {"state": self.folder / "station", "timeout_s": 5.0}
        given |= {"commander": "test", "vehicle": 1, "signing_key": self.key}
        consent = Consent(arm, disarm, any_origin)
        with connect(self.url, Options(consent=consent, **(given | options))) as station:
            yield station

    def order(self, verb: Any, *, arm: bool = True, disarm: bool = False, **details: Any) -> Any:
        with self.reached(arm=arm, disarm=disarm) as station:
            return station.command(verb, **details)

    @property
    def run(self) -> Run:
        with self.book() as book:
            return book.run

    @property
    def events(self) -> tuple[AnyEvent, ...]:
        with self.book() as book:
            return book.journal.events()


ALL = [
    "Started",
    *(f"{word} {name}" for name in ("S1", "S2", "S3") for word in ("Arrived", "Settled", "Scanned")),
    "Finished",
]
"""Reports of a run of the tour without faults."""


@contextmanager
def watched(site: Site, **options: Any) -> Iterator[list[Any]]:
    """A watch in a process of its own; the block ends when the run has."""
    seen: list[Any] = []

    def follow() -> None:
        with site.reached(**options) as station:
            ready.set()
            seen.extend(station.reports())

    ready = threading.Event()
    thread = threading.Thread(target=follow, daemon=True)
    thread.start()
    assert ready.wait(PATIENCE_S)
    yield seen
    thread.join(PATIENCE_S)
    assert not thread.is_alive(), told(site.events)


def until(site: Site, seen: Callable[[tuple[AnyEvent, ...], Run], bool]) -> None:
    """Wait until the logbook has come so far, however long that takes within reason."""
    deadline = time.monotonic() + PATIENCE_S
    with site.book() as book:
        while not seen(book.journal.events(), book.run):
            assert time.monotonic() < deadline, (told(book.journal.events()), book.run)
            time.sleep(0.05)
