"""Every robot of a site at one moment: those that answer, and those that are known and do not."""

from __future__ import annotations

import time
from collections.abc import Iterable
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
"""Once one robot of a fleet has shown itself, the others get this long."""
MOST_ASKED = 16
"""Robots of a fleet that are asked at the same time."""


@dataclass(frozen=True)
class FleetMember:
    """One robot of a site, as it answered or did not."""

    robot: str
    state: StateReport | None
    """`None` if it is silent."""
    trouble: str = ""
    """Why it is not well, though it may have answered."""


def fleet(
    endpoint: str,
    *,
    site: str | None = None,
    timeout_s: float = 5.0,
    insecure: bool = False,
    keys: Path | None = None,
    known: Iterable[str] = (),
) -> tuple[FleetMember, ...]:
    """Every robot of the site that shows itself through `endpoint`, and the `known` that do not, by name.

    Raises
    ------
    RobotUnreachable
        If not a single robot showed itself within `timeout_s`, and none is known.
    """
    from stopgo.bridge.link.zenoh_link import Guard, connecting

    held = None if keys is None else read_keys(keys, now=now_utc())
    every, names = KeyExpressions.of_every_robot(site), set(known)
    with connecting(endpoint, Guard(held, insecure), open_s=timeout_s) as link:
        station = Station(link, every, commander=whoami(), timeout_s=timeout_s)
        shown: set[str] = set()
        link.watch_presence(every.alive, lambda key, alive: shown.add(every.robot_of(key)) if alive else None)
        try:
            station.reach(endpoint, why=lambda: why_no_link(endpoint, held))
        except RobotUnreachable as error:
            if not names:
                raise
            return tuple(FleetMember(name, None, str(error)) for name in sorted(names))
        time.sleep(GATHER_S)
        with ThreadPoolExecutor(max_workers=MOST_ASKED) as pool:
            asked = pool.map(lambda name: _member(link, KeyExpressions(name, site), timeout_s, held), shown)
            found = (*asked, *(FleetMember(name, None, "does not show itself") for name in names - shown))
    return tuple(sorted(found, key=lambda member: member.robot))


def _member(link: Link, keys: KeyExpressions, timeout_s: float, held: HeldKeys | None) -> FleetMember:
    station = Station(link, keys, commander=whoami(), timeout_s=timeout_s, held=held)
    try:
        return FleetMember(keys.robot, station.status())
    except OutcomeUnknown as silent:
        return FleetMember(keys.robot, None, f"shows itself, but {silent}")
    except (NegativeResult, InputError) as no:
        return FleetMember(keys.robot, None, str(no))
