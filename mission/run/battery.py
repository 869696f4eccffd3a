"""Battery check: does a robot's charge last to the end of a mission, as far as the robot reports it?"""

from __future__ import annotations

from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule


def battery_shortfall(
    mission: Mission, *, battery: float | None, endurance_s: float | None, first: int = 0
) -> str:
    """Return why the battery does not last from stop `first` to the end of the mission; empty if it does.

    No answer is possible for a robot whose charge or `endurance_s` (seconds on a full battery) is `None`.
    """
    if endurance_s is None or battery is None:
        return ""
    least = mission.policy.battery_min
    needed_s, lasts_s = time_left(mission, first), max(0.0, battery - least) * endurance_s
    if needed_s <= lasts_s:
        return ""
    return (
        f"the mission takes {needed_s / 3600:.1f} h as planned; the battery, at {battery:.0%}, lasts"
        f" {lasts_s / 3600:.1f} h until {least:.0%}: charge it, or plan fewer stops"
    )


def time_left(mission: Mission, first: int) -> float:
    """Seconds that the mission takes from leaving for stop `first` on, if nothing goes wrong."""
    plan = schedule(mission)
    if first == 0:
        return plan.total_s
    if first >= len(mission.stops):
        return 0.0
    before = mission.stops[first - 1]
    return plan.total_s - plan.arrival_s[first - 1] - before.settle_s - before.scan.duration_s
