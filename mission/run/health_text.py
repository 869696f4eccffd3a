"""Health of a robot in words: what is not known is unknown, never full or good."""

from __future__ import annotations

from dataclasses import dataclass

from stopgo.mission.run.events import StateReport


def charge_text(charge: float | None) -> str:
    """Return a charge of 0 to 1 in percent."""
    return "unknown" if charge is None else f"{charge:.0%}"


@dataclass(frozen=True)
class HealthWords:
    """Health of a robot at one time, in words."""

    robot_ns: int
    battery: str
    position: str
    fence: str


def health_words(report: StateReport) -> HealthWords:
    """Return the health that a state reports; what it does not report is unknown."""
    lasts = ", its failsafe lasts" if report.battery_ok is False else ""
    return HealthWords(
        report.robot_ns, charge_text(report.charge) + lasts,
        _word(report.position_ok, "lost"), _word(report.fence_ok, "breached"),
    )  # fmt: skip


def health_text(report: StateReport) -> str:
    """Return battery, position estimate and geofence; the latter two only of a robot that reports either."""
    words = health_words(report)
    text = f"battery {words.battery}"
    if (report.battery_ok, report.position_ok, report.fence_ok) != (None, None, None):
        text += f", position estimate {words.position}, geofence {words.fence}"
    return text


def _word(ok: bool | None, bad: str) -> str:
    return "unknown" if ok is None else "ok" if ok else bad
