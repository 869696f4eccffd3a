"""`stopgo doctor`: looks at what orders and recordings need, and says what to do about what is wrong."""

from __future__ import annotations

import contextlib
import platform
import shutil
import socket
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stopgo.bridge.commands.checks import Check
from stopgo.bridge.commands.connection import (
    DEFAULT_ENDPOINT,
    AnyRobot,
    Connect,
    Connection,
    Insecure,
    KeyFolder,
    MavlinkUrl,
    SigningKey,
    SiteName,
    Timeout,
    VehicleId,
    alone,
    connection_of,
    given_in,
    reached,
    with_presets,
)
from stopgo.bridge.commands.order_commands import Json, state_line
from stopgo.bridge.console import print_json, tell
from stopgo.bridge.link.capabilities import told_of_capabilities
from stopgo.bridge.profile import counting, files, read_profile
from stopgo.mission.errors import InputError, StopgoError

if TYPE_CHECKING:
    from stopgo.bridge.link.protocol import Info
    from stopgo.bridge.mavlink.vehicle_link.url import Url

Satellites = Annotated[
    bool, typer.Option("--any-origin", help="With --mavlink: it finds its place by satellites, not indoors.")
]
LEAST_FREE = 500_000_000
"""Bytes: a long run recorded with its poses, and room for the robot's journal."""
CLOCKS_APART_S = 2.0
"""Orders are valid for some seconds on the robot's clock."""
EXTRAS = {
    "plan": "shapely", "bim": "ifcopenshell", "record": "rerun", "clouds": "laspy", "prove": "embreex",
}  # fmt: skip
"""A library of each extra."""


def doctor(
    context: typer.Context,
    *,
    robot: AnyRobot = None,
    connect: Connect = DEFAULT_ENDPOINT,
    site: SiteName = None,
    keys: KeyFolder = None,
    mavlink: MavlinkUrl = None,
    vehicle: VehicleId = None,
    signing_key: SigningKey = None,
    any_origin: Satellites = False,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    json_: Json = False,
) -> int:
    """Tell what is preset and where, and whether keys, robot, clock, disk and libraries are as they must be.

    Of a vehicle (--mavlink): what stands between it and a mission, each with the value to set. It is only
    asked, nothing of it is changed.

    Exit code 1: something is wrong, and its line says what to do. An extra that is missing is not.

    Example: stopgo doctor --robot r1 --connect tcp/127.0.0.1:7447
    """
    given = given_in(context)
    told: dict[str, Any] = {"robot": robot, "connect": connect, "site": site, "keys": keys}
    told["mavlink"] = mavlink
    checks = [_system(), *_extras(), _viewer(), _disk(Path()), *_checked("profile", lambda: _profile(given))]
    with contextlib.suppress(InputError):  # which the profile's line tells
        told = with_presets(given, told)
    if told["keys"] is not None:
        checks += _checked("keys", lambda: _keys(told["keys"]))
    if mavlink is not None:
        from stopgo.bridge.mavlink.vehicle_link.wire import read_link

        alone(given, "--mavlink", "--robot", "--site", "--keys", "--connect")
        url, key = read_link(mavlink, signing_key, insecure=insecure)
        checks += _checked(
            "vehicle", lambda: _vehicle(url, vehicle, key, timeout_s=timeout, any_origin=any_origin)
        )
    elif told["robot"] is not None:
        connection = connection_of(given, **told, timeout=timeout, insecure=insecure)
        checks += [*_ports(connection.endpoint), *_checked("robot", lambda: _asked(connection))]
    else:
        checks += _checked("port", lambda: _unasked(told, insecure=insecure))
    say_checks(checks, as_json=json_)
    return 0 if all(check.ok for check in checks) else 1


def _asked(connection: Connection) -> Iterator[Check]:
    with reached(connection) as station:
        yield from robot_checks(station.info(), time.time_ns())


def _vehicle(
    url: Url, vehicle: int | None, key: bytes | None, *, timeout_s: float, any_origin: bool
) -> Iterator[Check]:
    from stopgo.bridge.commands.vehicle_checks import vehicle_checks
    from stopgo.bridge.mavlink.vehicle_link.peer import reached as vehicle_at

    with vehicle_at(url, vehicle=vehicle, signing_key=key, timeout_s=timeout_s) as peer:
        yield from vehicle_checks(peer, any_origin=any_origin)


def _unasked(told: dict[str, Any], *, insecure: bool) -> Iterator[Check]:
    """What can be told of where to connect while nobody says to which robot."""
    if told["mavlink"] is not None:
        from stopgo.bridge.mavlink.vehicle_link.url import read_url

        yield Check("port", True, f"{read_url(told['mavlink'])} is a MAVLink URL; nobody was asked there")
    elif told["connect"] != DEFAULT_ENDPOINT:
        from stopgo.bridge.link.keys import now_utc, read_keys
        from stopgo.bridge.link.link import endpoints_in
        from stopgo.bridge.link.zenoh_link import Guard, check_endpoint

        held = None if told["keys"] is None else read_keys(told["keys"], now=now_utc())
        for endpoint in endpoints_in(told["connect"]):
            check_endpoint(endpoint, Guard(held, insecure), option="--connect")
        yield from _ports(told["connect"])


def say_checks(checks: list[Check], *, as_json: bool) -> None:
    """Each check as a line, or all of them as one object."""
    if as_json:
        print_json({"ok": all(check.ok for check in checks), "checks": [asdict(check) for check in checks]})
        return
    for check in checks:
        todo = f"; {check.do}" if check.do else ""
        tell(f"{'ok   ' if check.ok else 'WRONG'}  {check.name:8} {check.told}{todo}")


def _checked(name: str, look: Callable[[], Iterator[Check]]) -> list[Check]:
    """What was found; an error on the way is what is wrong."""
    found: list[Check] = []
    try:
        found.extend(look())
    except StopgoError as error:
        found.append(Check(name, False, str(error)))
    return found


def _system() -> Check:
    from stopgo.mission import __version__

    where = f"{platform.system()} {platform.machine()}, {sys.prefix}"
    return Check("stopgo", True, f"{__version__}, Python {platform.python_version()}, {where}")


def _extras() -> Iterator[Check]:
    for extra, library in EXTRAS.items():
        if find_spec(library) is None:
            yield Check(extra, True, "not installed", f'if you need it: pip install "stopgo[{extra}]"')
        else:
            yield Check(extra, True, "installed")


def _viewer() -> Check:
    beside = Path(sys.executable).with_name("rerun")
    found = shutil.which("rerun") or (str(beside) if beside.exists() else None)
    if found is None:
        return Check("viewer", True, "not found", 'to look at recordings: pip install "stopgo[record]"')
    return Check("viewer", True, found)


def _disk(folder: Path) -> Check:
    free = shutil.disk_usage(folder).free
    return Check(
        "disk", free >= LEAST_FREE, f"{free / 1e9:.1f} GB free in {folder.resolve()}",
        "" if free >= LEAST_FREE else "make room: a recording or a journal would stop in the middle",
    )  # fmt: skip


def _profile(given: frozenset[str]) -> Iterator[Check]:
    presets = read_profile()
    for name, preset in presets.items():
        over = " (an option counts more here)" if f"--{name}" in given else ""
        yield Check("profile", True, f"{name} = {preset.value}, from {preset.source}{over}")
    if not presets:
        yield Check(
            "profile",
            True,
            f"nothing is preset, neither by STOPGO_… nor in {' nor '.join(map(str, files()))}",
        )
    counting(presets, {option.removeprefix("--") for option in given})


def _keys(folder: Path) -> Iterator[Check]:
    from stopgo.bridge.link.keys import now_utc, read_keys

    now = now_utc()
    holder = read_keys(folder, now=now).holder
    days = (holder.not_after - now).days
    told = f"{folder}: of {holder.role} {holder.name}, valid for {days} more days"
    yield Check("keys", True, told, "issue new ones soon" if days < 14 else "")


def _ports(endpoints: str) -> Iterator[Check]:
    from stopgo.bridge.link.link import endpoints_in

    for endpoint in endpoints_in(endpoints):
        yield from _port(endpoint)


def _port(endpoint: str) -> Iterator[Check]:
    """Whether anything listens at a TCP endpoint; what is no endpoint, the robot's line tells."""
    kind, _, place = endpoint.partition("/")
    host, _, port = place.rpartition(":")
    if kind not in ("tcp", "tls") or not port.isdecimal() or int(port) > 65535:
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=2.0).close()
        yield Check("port", True, f"something listens at {endpoint}")
    except OSError as error:
        told = f"nothing answers at {endpoint} ({error.strerror or error})"
        yield Check("port", False, told, "is the robot's program running there?")


def robot_checks(info: Info, now_ns: int) -> Iterator[Check]:
    """What a robot tells of itself, and its clock beside this one."""
    yield Check("robot", True, f"{state_line(info.state)}; stopgo {info.stopgo}")
    yield Check("can", True, told_of_capabilities(info.capabilities))
    apart = (info.clock_ns - now_ns) / 1e9
    ok = abs(apart) <= CLOCKS_APART_S
    todo = "" if ok else "set both clocks by NTP: orders are refused as too old or too early"
    yield Check("clock", ok, f"the robot's clock is {apart:+.1f} s from this one", todo)
    if info.to_map is None:
        yield Check("origin", True, "on the robot's map as each mission says (frame.to_map)")
    else:
        x, y = info.to_map.x, info.to_map.y
        yield Check("origin", True, f"the robot's own --map: shifted by ({x:.3f}, {y:.3f}) m")
