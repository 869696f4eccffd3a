"""State of every robot of a site at one moment, also of expected robots that do not answer."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from stopgo.bridge.link.keys import HeldKeys, now_utc, read_keys
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.link.tls_probe import why_no_link
from stopgo.bridge.station.station import Station, whoami
from stopgo.mission.errors import InputError, NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.run.events import StateReport

GATHER_S = 0.3
"""Time for the other robots of a fleet to be found, after the first was found."""
MOST_QUERIED = 16
"""Robots of a fleet that are queried at the same time."""


@dataclass(frozen=True)
class FleetMember:
    """Robot of a site, and its answer."""

    robot: str
    state: StateReport | None
    """`None` if the robot did not answer."""
    trouble: str = ""
    """Reason why there is no state; empty if there is one."""


def fleet(
    endpoint: str,
    *,
    site: str | None = None,
    timeout_s: float = 5.0,
    insecure: bool = False,
    keys: Path | None = None,
    known: Iterable[str] = (),
) -> tuple[FleetMember, ...]:
    """Return every robot of the site that is found through `endpoint`, and the `known` ones, by name.

    Raises
    ------
    RobotUnreachable
        If no robot was found within `timeout_s`, and none is known.
    """
    from stopgo.bridge.link.zenoh_link import Guard, connecting

    held = None if keys is None else read_keys(keys, now=now_utc())
    every, names = KeyExpressions.of_every_robot(site), set(known)
    with connecting(endpoint, Guard(held, insecure), open_s=timeout_s) as link:
        station = Station(link, every, commander=whoami(), timeout_s=timeout_s)
        present: set[str] = set()
        link.watch_presence(
            every.alive, lambda key, alive: present.add(every.robot_of(key)) if alive else None
        )
        try:
            station.reach(endpoint, why=lambda: why_no_link(endpoint, held))
        except RobotUnreachable as error:
            if not names:
                raise
            return tuple(FleetMember(name, None, str(error)) for name in sorted(names))
        time.sleep(GATHER_S)
        found = _queried(present, lambda name: _member(link, KeyExpressions(name, site), timeout_s, held))
    found |= {name: FleetMember(name, None, "not found") for name in names - found.keys()}
    return tuple(found[name] for name in sorted(found))


def _queried(present: set[str], member: Callable[[str], FleetMember]) -> dict[str, FleetMember]:
    """Query every robot that is present, also those that the link finds meanwhile and adds to the set."""
    found: dict[str, FleetMember] = {}
    with ThreadPoolExecutor(max_workers=MOST_QUERIED) as pool:
        while new := set(present) - found.keys():
            found |= zip(new, pool.map(member, new), strict=True)
    return found


def _member(link: Link, keys: KeyExpressions, timeout_s: float, held: HeldKeys | None) -> FleetMember:
    station = Station(link, keys, commander=whoami(), timeout_s=timeout_s, held=held)
    try:
        return FleetMember(keys.robot, station.status())
    except OutcomeUnknown as silent:
        return FleetMember(keys.robot, None, f"found, but {silent}")
    except (NegativeResult, InputError) as no:
        return FleetMember(keys.robot, None, str(no))
