"""The smallest worlds the tests of this folder need, built by hand."""

from __future__ import annotations

import math

from mission.document import (
    Frame,
    Mission,
    Origin,
    Policy,
    RobotSpec,
    Scan,
    ScannerSpec,
    Sees,
    SiteOrigin,
    Start,
    Stop,
    sealed,
)
from mission.settings import Settings


def stop(name: str, *approach: tuple[float, float], heading: float = 0.0, units: int = 10) -> Stop:
    """A stop at the end of `approach`."""
    x, y = approach[-1]
    return Stop(
        id=name, x=x, y=y, heading=heading, doorway=False, tolerance_m=0.05, settle_s=2.0,
        scan=Scan(profile="default", duration_s=60.0, timeout_s=120.0),
        on_failure="ask", retries=1, approach=approach, sees=Sees(units=units, new_units=units),
    )  # fmt: skip


def mission_of(*stops: Stop, back: tuple[tuple[float, float], ...] | None = None) -> Mission:
    """A mission over `stops` from (0, 0), facing +x: 1 m/s, 1 m/s², 90° a second."""
    return sealed(Mission(
        id="0123456789abcdef0123456789abcdef", revision=1, name="room", digest="",
        frame=Frame(name="room"), georeference=SiteOrigin(lat=51.5, lon=7.5, alt=100.0, heading_deg=0.0),
        robot=RobotSpec(radius=0.35, speed=1.0, turn_rate=math.pi / 2, acceleration=1.0),
        scanner=ScannerSpec(profile="default", range=5.0),
        start=Start(x=0.0, y=0.0, heading=0.0, reason="given"),
        stops=stops, return_=back,
        policy=Policy(link_loss="continue", link_loss_after_s=30.0, battery_min=0.15),
        origin=Origin(floor="room.dxf", floor_digest="0" * 64, parameters=Settings(), stopgo="0.1.0"),
    ))  # fmt: skip


def square_tour() -> Mission:
    """Two stops, 4 m ahead and then 3 m to the left of that, and straight back: a 3-4-5 triangle."""
    return mission_of(
        stop("S1", (0.0, 0.0), (4.0, 0.0)),
        stop("S2", (4.0, 0.0), (4.0, 3.0), heading=math.pi / 2),
        back=((4.0, 3.0), (0.0, 0.0)),
    )
