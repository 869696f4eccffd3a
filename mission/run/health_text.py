"""Health of a robot in words: what is not known is unknown, never full or good."""

from __future__ import annotations

from stopgo.mission.run.events import StateReport


def charge_text(charge: float | None) -> str:
    """Return a charge of 0 to 1 in percent."""
    return "unknown" if charge is None else f"{charge:.0%}"


def health_text(report: StateReport) -> str:
    """Return battery, position estimate and geofence; the latter two only of a robot that reports either."""
    failed = ", its failsafe lasts" if report.battery_ok is False else ""
    words = [f"battery {charge_text(report.charge)}{failed}"]
    if (report.battery_ok, report.position_ok, report.fence_ok) != (None, None, None):
        words.append(f"position estimate {_word(report.position_ok, 'lost')}")
        words.append(f"geofence {_word(report.fence_ok, 'breached')}")
    return ", ".join(words)


def _word(ok: bool | None, bad: str) -> str:
    return "unknown" if ok is None else "ok" if ok else bad
