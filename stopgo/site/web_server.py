"""The site as a running server: its socket, its robots, and the order in which everything ends.

The server listens on this machine unless an address is named. Beyond this machine it speaks TLS only, with a
certificate that is given, or with one that it makes and names by its fingerprint.
"""

from __future__ import annotations

import ipaddress
import os
import socket
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import uvicorn

from stopgo.bridge.link.keys import HeldKeys, now_utc, read_keys
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.mavlink.auto.open_vehicle import OpenVehicle
from stopgo.bridge.mavlink.auto.vehicle_commands import Consent
from stopgo.bridge.mavlink.auto.vehicle_station import Options as VehicleOptions
from stopgo.bridge.mavlink.vehicle_link.wire import read_link
from stopgo.bridge.station.roster import RosterVehicle
from stopgo.bridge.station.station import Station, whoami
from stopgo.mission.comparing.run_collector import RunCollector
from stopgo.mission.console.ports import free_port
from stopgo.mission.console.state_folder import state_folder
from stopgo.mission.errors import InputError
from stopgo.mission.files.file_name import file_name
from stopgo.site.event_feed import EventFeed
from stopgo.site.kept_variants import kept_variants
from stopgo.site.known_missions import KnownMission, KnownMissions
from stopgo.site.live_robot import LiveRobot
from stopgo.site.page_access import PageAccess, read_stored
from stopgo.site.planning import PlanningRoom
from stopgo.site.planning_routes import planning_routes
from stopgo.site.request_checks import SiteAddress
from stopgo.site.robot_orders import RobotOrders
from stopgo.site.run_pages import RunRoom
from stopgo.site.run_routes import run_routes
from stopgo.site.server_certificate import own_certificate
from stopgo.site.site_folder import SiteFiles
from stopgo.site.web_app import SiteParts, web_app
from stopgo.site.web_connections import MOST_CONNECTIONS, PageConnection
from stopgo.site.web_viewer import WebViewer

HERE = "127.0.0.1"
END_S = 5.0
"""Longest wait for a robot's thread when the site ends; the link is closed then."""


@dataclass(frozen=True)
class SiteOptions:
    """Options of `stopgo site`."""

    folder: Path
    endpoint: str
    site: str | None = None
    commander: str | None = None
    keys: Path | None = None
    insecure: bool = False
    timeout_s: float = 5.0
    robots: tuple[str, ...] = ()
    """Robots that are expected, from a roster."""
    vehicles: Mapping[str, RosterVehicle] = field(default_factory=dict)
    """Vehicles that drive their own lists, by name."""
    listen: str = HERE
    port: int | None = None
    certificate: Path | None = None
    certificate_key: Path | None = None


def state_file(options: SiteOptions) -> Path:
    """Return the file with the sessions of a folder's site, in `$XDG_STATE_HOME/stopgo/site`."""
    name = file_name(f"{options.folder.resolve()} {options.listen}")
    return state_folder() / "site" / f"{name}.json"


@contextmanager
def serving_site(
    options: SiteOptions, *, say: Callable[[str], None], link: Link | None = None
) -> Iterator[str]:
    """Yield the address by which the first browser signs in; the site runs until the block ends.

    `link` is to the robots, in place of one to the endpoint.

    Raises
    ------
    InputError
        If the folder, an address, a port or a certificate cannot be used.
    """
    folder = SiteFiles.at(options.folder)
    with ExitStack() as opened:
        listener = opened.enter_context(_listener(options))
        tls = _certificates(options, say)
        port = listener.getsockname()[1]
        address = SiteAddress("https" if tls else "http", _hosts(options.listen, port))
        access = PageAccess(state_file(options), port)
        stopped = threading.Event()
        feed = EventFeed()
        held = None if options.keys is None else read_keys(options.keys, now=now_utc())
        fleet = opened.enter_context(_fleet(options, held, feed, folder, stopped, link))
        parts = SiteParts(
            address=address, access=access, feed=feed, folder=folder, missions=fleet.missions,
            robots=fleet.robots, orders=fleet.orders, commander=fleet.commander,
            may_command=held is None or held.holder.role == "station", ended=stopped.is_set,
        )  # fmt: skip
        opened.enter_context(_more_rooms(parts, state_file(options)))
        opened.callback(feed.close)
        opened.callback(stopped.set)
        opened.enter_context(_running(web_app(parts), listener, tls))
        opened.callback(feed.close)
        opened.callback(stopped.set)
        yield f"{address.url}/#token={access.invite('operator')}"


@contextmanager
def _more_rooms(parts: SiteParts, state: Path) -> Iterator[None]:
    """Add the rooms of planning and of looking back, and end their processes with the block."""
    viewer = WebViewer()

    def look_again() -> None:
        for robot in list(parts.robots.values()):
            robot.look_again()

    with ExitStack() as opened:
        merged = opened.enter_context(TemporaryDirectory(prefix="stopgo-runs-", ignore_cleanup_errors=True))
        kept = opened.enter_context(kept_variants(state.with_suffix(".variants")))
        planning = PlanningRoom(parts.folder, parts.feed, kept, look_again)
        opened.callback(planning.close)
        opened.callback(viewer.close)
        room = RunRoom(parts.folder, Path(merged), planning.files)
        parts.viewer = lambda: viewer.origin
        parts.more += [*planning_routes(planning), *run_routes(room, viewer, parts.address.url)]
        yield


@dataclass
class SiteFleet:
    """Robots of a site on one link, and what follows them."""

    link: Link
    options: SiteOptions
    held: HeldKeys | None
    feed: EventFeed
    folder: SiteFiles
    stopped: threading.Event

    def __post_init__(self) -> None:
        self.commander = self.options.commander or (self.held.holder.name if self.held else whoami())
        self.missions = KnownMissions(self.folder.root)
        self.robots: dict[str, LiveRobot] = {}
        self.orders = RobotOrders(self.robots, self.feed)
        self.threads: list[threading.Thread] = []
        self._lock = threading.Lock()

    def add(self, name: str) -> None:
        """Follow a robot from now on; once."""
        with self._lock:
            if name in self.robots or self.stopped.is_set():
                return
            keys = KeyExpressions(name, self.options.site)
            station = Station(
                self.link, keys, commander=self.commander, timeout_s=self.options.timeout_s, held=self.held
            )
            station.stop_remedy = ""  # the page sends it again itself
            robot = LiveRobot(station, self.feed, self.missions, self.recorder)
            self.robots[name] = robot
        thread = threading.Thread(target=robot.work, args=(self.stopped,), daemon=True)
        self.threads.append(thread)
        thread.start()

    def add_vehicle(self, name: str, entry: RosterVehicle) -> None:
        """Follow a vehicle that drives its own list; raises `InputError` if its URL or key is of no use."""
        options, path = self.options, entry.signing_key
        key = None if path is None else Path(path)
        url, signing_key = read_link(entry.mavlink, key, insecure=options.insecure)
        station = OpenVehicle(
            name, url,
            VehicleOptions(
                vehicle=entry.vehicle, signing_key=signing_key, timeout_s=options.timeout_s,
                commander=self.commander, consent=Consent(entry.arm, False, entry.skip_origin_check),
            ),
            set_origin=entry.set_origin, number=len(self.threads),
        )  # fmt: skip
        robot = self.robots[name] = LiveRobot(station, self.feed, self.missions, self.recorder)
        for work in (
            partial(station.serve, self.stopped, robot.show_trouble),
            partial(robot.work, self.stopped),
        ):
            thread = threading.Thread(target=work, daemon=True)
            self.threads.append(thread)
            thread.start()

    def recorder(
        self, robot: str, run_id: str, known: KnownMission | None
    ) -> AbstractContextManager[RunCollector]:
        """Open the recording of a run; one that is complete already is not made again."""
        path = self.folder.root / "runs" / f"{file_name(f'{robot}-{run_id}')}.rrd"
        return nullcontext(RunCollector()) if path.exists() else _recording(path, known)


@contextmanager
def _recording(path: Path, known: KnownMission | None) -> Iterator[RunCollector]:
    """Record a run at a path, with the floor of its plan if that is known."""
    try:
        from stopgo.recordings.runs.field import FieldRecording
    except ModuleNotFoundError:
        raise InputError('runs are not recorded; pip install "stopgo[record]"') from None
    try:
        path.parent.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{path.parent}: cannot be made ({error.strerror}); the run is not recorded"
        ) from None
    with FieldRecording(path, plan=None if known is None else known.recording) as record:
        yield RunCollector(record)
    if path.exists():  # what a killed site left of this run is in it, too
        for left in path.parent.glob(f"{path.stem}.partial*"):
            left.unlink(missing_ok=True)


@contextmanager
def _fleet(
    options: SiteOptions,
    held: HeldKeys | None,
    feed: EventFeed,
    folder: SiteFiles,
    stopped: threading.Event,
    given: Link | None,
) -> Iterator[SiteFleet]:
    """Open the link to the robots and follow all that are expected, and all that show themselves."""
    from stopgo.bridge.link.zenoh_link import Guard, connecting

    if held is not None and options.commander not in (None, held.holder.name):
        raise InputError(f"--as {options.commander}: the keys belong to {held.holder.name}; leave --as out")
    guard = Guard(held, options.insecure)
    opened = connecting(options.endpoint, guard, open_s=options.timeout_s)
    with opened if given is None else nullcontext(given) as link:
        fleet = SiteFleet(link, options, held, feed, folder, stopped)
        for name, entry in options.vehicles.items():
            fleet.add_vehicle(name, entry)
        for name in options.robots:
            fleet.add(name)
        every = KeyExpressions.of_every_robot(options.site)
        link.watch_presence(
            every.alive, lambda key, alive: _later(fleet.add, every.robot_of(key)) if alive else None
        )
        try:
            yield fleet
        finally:
            stopped.set()
            fleet.orders.close()
            for thread in fleet.threads:
                thread.join(END_S)


def _later(work: Callable[[str], None], name: str) -> None:
    """Call from another thread: a link's callback must not declare anything itself."""
    threading.Thread(target=work, args=(name,), daemon=True).start()


@contextmanager
def _listener(options: SiteOptions) -> Iterator[socket.socket]:
    """Listen at the address; at the port of last time if it is free and none is named."""
    host = _address(options.listen)
    stored = read_stored(state_file(options))
    wished = [options.port] if options.port is not None else [stored.port] if stored else []
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    tried = [*wished, *([] if options.port is not None else [free_port()])]
    for last, port in zip([*[False] * (len(tried) - 1), True], tried, strict=True):
        listener = socket.socket(family)
        try:
            if os.name == "posix":
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind((host, port))
            listener.listen(MOST_CONNECTIONS)
        except (OSError, OverflowError) as error:
            listener.close()
            if last:
                why = getattr(error, "strerror", None) or error
                where = f"--listen {host}" if options.port is None else f"--port {port}"
                raise InputError(f"{where}: cannot listen there ({why}); give a free one") from None
            continue
        with listener:
            yield listener
        return


def _address(listen: str) -> str:
    """Return the numeric address to listen at.

    Raises
    ------
    InputError
        If it is none, or stands for every address of this machine: then no address could be checked.
    """
    try:
        found = ipaddress.ip_address("127.0.0.1" if listen == "localhost" else listen.strip("[]"))
    except ValueError:
        raise InputError(f"--listen {listen}: not an address; give one such as 192.168.1.5") from None
    if found.is_unspecified:
        raise InputError(f"--listen {listen}: names no address; give the one that the others open")
    return str(found)


def _hosts(listen: str, port: int) -> tuple[str, ...]:
    address = _address(listen)
    shown = f"[{address}]" if ":" in address else address
    here = ipaddress.ip_address(address).is_loopback
    return (f"{shown}:{port}", *([f"localhost:{port}"] if here else []))


def _certificates(options: SiteOptions, say: Callable[[str], None]) -> tuple[Path, Path] | None:
    """Return certificate and key for TLS; `None` on this machine alone, where none was given."""
    if (options.certificate is None) != (options.certificate_key is None):
        raise InputError("--certificate and --certificate-key belong together; give both")
    if options.certificate is not None and options.certificate_key is not None:
        for path in (options.certificate, options.certificate_key):
            if not path.is_file():
                raise InputError(f"{path}: no such file; give the certificate and its key as PEM files")
        return options.certificate, options.certificate_key
    address = _address(options.listen)
    if ipaddress.ip_address(address).is_loopback:
        return None
    made = own_certificate(state_file(options).with_suffix(""), address)
    say(f"certificate made for {address}; compare in the browser: SHA-256 {made.fingerprint}")
    return made.certificate, made.key


@contextmanager
def _running(app: Any, listener: socket.socket, tls: tuple[Path, Path] | None) -> Iterator[None]:
    """Run the server on a thread of its own until the block ends."""
    config = uvicorn.Config(
        app, log_config=None, access_log=False, server_header=False, proxy_headers=False, lifespan="off",
        ws="none", http=PageConnection, loop="asyncio", limit_concurrency=MOST_CONNECTIONS,
        timeout_keep_alive=30, timeout_graceful_shutdown=2, h11_max_incomplete_event_size=16 * 1024,
        ssl_certfile=None if tls is None else str(tls[0]), ssl_keyfile=None if tls is None else str(tls[1]),
    )  # fmt: skip
    try:
        config.load()
    except (OSError, ValueError) as error:
        raise InputError(f"--certificate {tls and tls[0]}: cannot be used ({error})") from None
    server = uvicorn.Server(config)
    sockets: Sequence[socket.socket] = [listener]
    thread = threading.Thread(target=server.run, kwargs={"sockets": sockets}, daemon=True)
    thread.start()
    try:
        yield
    finally:
        server.should_exit = True
        thread.join(5.0)
