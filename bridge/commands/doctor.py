"""`stopgo doctor`: checks the prerequisites of commands and recordings, and names a remedy for each fault."""

from __future__ import annotations

import contextlib
import platform
import shutil
import socket
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from stopgo.bridge.commands.bridge_options import (
    DEFAULT_ENDPOINT,
    AnyOrigin,
    AnyRobot,
    Connect,
    Insecure,
    Json,
    KeyFolder,
    MavlinkUrl,
    RosDomain,
    SigningKey,
    SiteName,
    Timeout,
    VehicleId,
)
from stopgo.bridge.commands.checks import Check
from stopgo.bridge.commands.connection import (
    Connection,
    GivenOptions,
    connection_of,
    given_options,
    reached,
    refuse_options,
    with_presets,
)
from stopgo.bridge.commands.ros_checks import ros_checks
from stopgo.bridge.commands.run_control_commands import state_line
from stopgo.bridge.console import print_json, print_line
from stopgo.bridge.link.capabilities import told_of_capabilities
from stopgo.bridge.link.link import endpoints_in
from stopgo.bridge.mavlink.vehicle_link.url import read_url
from stopgo.bridge.profile import effective, profile_files, read_profile
from stopgo.mission import __version__
from stopgo.mission.errors import InputError, StopgoError

if TYPE_CHECKING:
    from stopgo.bridge.link.protocol import Info
    from stopgo.bridge.mavlink.vehicle_link.url import Url

LEAST_FREE = 500_000_000
"""Free bytes that a long run's recording and the robot's journal need."""
CLOCKS_APART_S = 2.0
"""Largest difference of clocks. Commands go by the robot's own clock, which each station asks for."""
EXTRAS = {
    "plan": "shapely", "bim": "ifcopenshell", "record": "rerun", "clouds": "laspy", "prove": "embreex",
}  # fmt: skip
"""One library of each extra; the extra is installed if the library is."""


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
    any_origin: AnyOrigin = False,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    ros2: RosDomain = None,
    json_: Json = False,
) -> int:
    """Print the presets and their sources, and check keys, robot, clock, disk and libraries.

    Of a vehicle (--mavlink): its state, position and parameters, with the value to set for each. Of a robot
    with ROS 2 (--ros2): topics, frames, actions, clock, and what does not fit. Both are only queried.
    Exit code 1: something is wrong, and its line names the remedy. A missing extra is not an error.

    Example: stopgo doctor --robot r1 --connect tcp/127.0.0.1:7447
    """
    given = given_options(context)
    named = {"robot": robot, "connect": connect, "site": site, "keys": keys, "mavlink": mavlink}
    checks = [*_machine_checks(), *_checked("profile", lambda: _profile(given))]
    with contextlib.suppress(InputError):  # the profile's line reports it
        named = with_presets(given, named)
    if named["keys"] is not None:
        checks += _checked("keys", lambda: _keys(Path(str(named["keys"]))))
    if ros2 is not None:
        checks += _checked("ros2", lambda: _ros(given, ros2, connect))
    elif mavlink is not None:
        options = {"insecure": insecure, "any_origin": any_origin}
        checks += _vehicle_checks(given, mavlink, vehicle, signing_key, timeout, **options)
    else:
        checks += _robot_checks(given, named, timeout, insecure=insecure)
    print_checks(checks, as_json=json_)
    return 0 if all(check.ok for check in checks) else 1


def _ros(given: GivenOptions, ros2: str, endpoint: str) -> Iterator[Check]:
    refuse_options(given, "--ros2", "--robot", "--site", "--keys", "--mavlink")
    yield from ros_checks(ros2, endpoint)


def _machine_checks() -> Iterator[Check]:
    yield _system()
    yield from _extras()
    yield _viewer()
    yield _disk(Path())


def _vehicle_checks(
    given: GivenOptions,
    mavlink: str,
    vehicle: int | None,
    signing_key: Path | None,
    timeout_s: float,
    *,
    insecure: bool,
    any_origin: bool,
) -> list[Check]:
    from stopgo.bridge.mavlink.vehicle_link.wire import read_link

    refuse_options(given, "--mavlink", "--robot", "--site", "--keys", "--connect")
    url, key = read_link(mavlink, signing_key, insecure=insecure)
    return _checked(
        "vehicle", lambda: _vehicle(url, vehicle, key, timeout_s=timeout_s, any_origin=any_origin)
    )


def _robot_checks(
    given: GivenOptions, named: dict[str, Any], timeout_s: float, *, insecure: bool
) -> list[Check]:
    """Check the robot, or the endpoint alone if no robot is named."""
    if named["robot"] is None:
        return _checked("port", lambda: _endpoint_only(named, insecure=insecure))
    connection = connection_of(given, **named, timeout=timeout_s, insecure=insecure)
    return [*_ports(connection.endpoint), *_checked("robot", lambda: _robot(connection))]


def _robot(connection: Connection) -> Iterator[Check]:
    with reached(connection) as station:
        yield from robot_checks(station.info(), time.time_ns())


def _vehicle(
    url: Url, vehicle: int | None, key: bytes | None, *, timeout_s: float, any_origin: bool
) -> Iterator[Check]:
    from stopgo.bridge.commands.vehicle_checks import vehicle_checks
    from stopgo.bridge.mavlink.vehicle_link.peer import reached as vehicle_at

    with vehicle_at(url, vehicle=vehicle, signing_key=key, timeout_s=timeout_s) as peer:
        yield from vehicle_checks(peer, any_origin=any_origin)


def _endpoint_only(named: dict[str, Any], *, insecure: bool) -> Iterator[Check]:
    """Check the preset endpoint or URL, without a robot's name."""
    if named["mavlink"] is not None:
        yield Check(
            "port", True, f"{read_url(named['mavlink'])} is a MAVLink URL; the vehicle was not queried"
        )
    elif named["connect"] != DEFAULT_ENDPOINT:
        from stopgo.bridge.link.keys import now_utc, read_keys
        from stopgo.bridge.link.zenoh_link import Guard, check_endpoint

        held = None if named["keys"] is None else read_keys(named["keys"], now=now_utc())
        for endpoint in endpoints_in(named["connect"]):
            check_endpoint(endpoint, Guard(held, insecure), option="--connect")
        yield from _ports(named["connect"])


def print_checks(checks: list[Check], *, as_json: bool) -> None:
    """Print each check as a line, or all of them as one object."""
    if as_json:
        print_json(
            {"ok": all(check.ok for check in checks), "checks": [check.for_json() for check in checks]}
        )
        return
    for check in checks:
        action = f"; {check.action}" if check.action else ""
        print_line(f"{'ok   ' if check.ok else 'WRONG'}  {check.name:8} {check.result}{action}")


def _checked(name: str, look: Callable[[], Iterator[Check]]) -> list[Check]:
    """Return the results of `look`; an error that it raises becomes a check that failed."""
    results: list[Check] = []
    try:
        results.extend(look())
    except StopgoError as error:
        results.append(Check(name, False, str(error)))
    return results


def _system() -> Check:

    where = f"{platform.system()} {platform.machine()}, {sys.prefix}"
    return Check("stopgo", True, f"{__version__}, Python {platform.python_version()}, {where}")


def _extras() -> Iterator[Check]:
    for extra, library in EXTRAS.items():
        if find_spec(library) is None:
            yield Check(extra, True, "not installed", f'if you need it: pip install "stopgo[{extra}]"')
        else:
            yield Check(extra, True, "installed")


def _viewer() -> Check:
    installed = Path(sys.executable).with_name("rerun")
    path = shutil.which("rerun") or (str(installed) if installed.exists() else None)
    if path is None:
        return Check("viewer", True, "not found", 'to look at recordings: pip install "stopgo[record]"')
    return Check("viewer", True, path)


def _disk(folder: Path) -> Check:
    free = shutil.disk_usage(folder).free
    return Check(
        "disk", free >= LEAST_FREE, f"{free / 1e9:.1f} GB free in {folder.resolve()}",
        "" if free >= LEAST_FREE else "free some space; a recording or a journal would stop in the middle",
    )  # fmt: skip


def _profile(given: frozenset[str]) -> Iterator[Check]:
    presets = read_profile()
    for name, preset in presets.items():
        overridden = " (overridden by the option)" if f"--{name}" in given else ""
        yield Check("profile", True, f"{name} = {preset.value}, from {preset.source}{overridden}")
    if not presets:
        yield Check(
            "profile",
            True,
            f"nothing is preset, neither by STOPGO_… nor in {' nor '.join(map(str, profile_files()))}",
        )
    effective(presets, {option.removeprefix("--") for option in given})


def _keys(folder: Path) -> Iterator[Check]:
    from stopgo.bridge.link.keys import now_utc, read_keys

    now = now_utc()
    holder = read_keys(folder, now=now).holder
    days = (holder.not_after - now).days
    result = f"{folder}: of {holder.role} {holder.name}, valid for {days} more days"
    yield Check("keys", True, result, "issue new ones soon" if days < 14 else "")


def _ports(endpoints: str) -> Iterator[Check]:

    for endpoint in endpoints_in(endpoints):
        yield from _port(endpoint)


def _port(endpoint: str) -> Iterator[Check]:
    """Check that a TCP endpoint accepts connections; the robot's line reports a wrong endpoint."""
    kind, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    if kind not in ("tcp", "tls") or not port.isdecimal() or int(port) > 65535:
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=2.0).close()
        yield Check("port", True, f"something listens at {endpoint}")
    except OSError as error:
        result = f"nothing answers at {endpoint} ({error.strerror or error})"
        yield Check("port", False, result, "is the robot's program running there?")


def robot_checks(info: Info, now_ns: int) -> Iterator[Check]:
    """Check the state, capabilities, clock and map that a robot reports."""
    yield Check("robot", True, f"{state_line(info.state)}; stopgo {info.stopgo}")
    yield Check("can", True, told_of_capabilities(info.capabilities))
    difference_s = (info.clock_ns - now_ns) / 1e9
    ok = abs(difference_s) <= CLOCKS_APART_S
    action = (
        "" if ok else "set both clocks by NTP; keys are valid by them, and the times of runs are the robot's"
    )
    yield Check("clock", ok, f"the robot's clock is {difference_s:+.1f} s from this one", action)
    if info.to_map is None:
        yield Check("origin", True, "on the robot's map as each mission says (frame.to_map)")
    else:
        x, y = info.to_map.x, info.to_map.y
        yield Check("origin", True, f"the robot's own --map: shifted by ({x:.3f}, {y:.3f}) m")
