"""Small mission for a robot under test: a few stops just ahead of its pose, and back."""

from __future__ import annotations

import math

from stopgo.mission.document import (
    Frame,
    Mission,
    Origin,
    Policy,
    RobotSpec,
    Scan,
    ScannerSpec,
    Sees,
    Start,
    Stop,
    with_digest,
)
from stopgo.mission.run.events import Pose

REACH_M = 0.5
"""Distance of the last stop of a mission that is driven."""
TOLERANCE_M = 0.1


def trial_mission(
    mission_id: str,
    revision: int,
    pose: Pose,
    *,
    stops: int = 2,
    reach_m: float = REACH_M,
    profile: str = "default",
    scan_s: float = 1.0,
    stopgo: str = "conform",
) -> Mission:
    """Make a mission of stops on a line ahead of `pose`, the last `reach_m` metres away, and a return leg."""
    positions = [_ahead(pose, reach_m * (index + 1) / stops) for index in range(stops)]
    here = (pose.x, pose.y)
    return with_digest(
        Mission(
            id=mission_id, revision=revision, name=f"conformance {mission_id}", digest="",
            frame=Frame(name="site"), georeference=None,
            robot=RobotSpec(radius=0.35, speed=0.2, turn_rate=math.radians(30), acceleration=0.2),
            scanner=ScannerSpec(profile=profile, range=5.0),
            start=Start(x=pose.x, y=pose.y, heading=pose.heading, reason="given"),
            stops=tuple(
                _stop(index, before, position, pose.heading, profile, scan_s)
                for index, (before, position) in enumerate(zip([here, *positions], positions, strict=False))
            ),
            return_=(positions[-1], here),
            policy=Policy(link_loss="hold", link_loss_after_s=30.0, battery_min=0.05),
            origin=Origin(floor="conformance", floor_digest="0" * 64, parameters={}, stopgo=stopgo),
        )
    )  # fmt: skip


def _ahead(pose: Pose, metres: float) -> tuple[float, float]:
    return pose.x + metres * math.cos(pose.heading), pose.y + metres * math.sin(pose.heading)


def _stop(
    index: int,
    before: tuple[float, float],
    position: tuple[float, float],
    heading: float,
    profile: str,
    scan_s: float,
) -> Stop:
    return Stop(
        id=f"c{index + 1}", x=position[0], y=position[1], heading=heading, doorway=False,
        tolerance_m=TOLERANCE_M, settle_s=0.5,
        scan=Scan(profile=profile, duration_s=scan_s, timeout_s=scan_s + 30.0),
        on_failure="ask", retries=1, approach=(before, position), sees=Sees(units=1, new_units=0),
    )  # fmt: skip
