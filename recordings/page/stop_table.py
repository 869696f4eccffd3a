"""Why each stop of a plan is there, as a table of the page."""

from __future__ import annotations

from collections.abc import Sequence

from mission.figures import percent
from mission.stop_reasons import LEAST_TOLD, StopReason
from recordings.page.words import grid, number, row, section, shown

HEADER = ("stop", "choice", "sees", "alone", "lost without it", "where", "runners-up")


def stop_table(reasons: Sequence[StopReason]) -> str:
    """A row for each stop, in the order of driving; nothing for plans that do not tell."""
    return section("Why each stop", grid(HEADER, map(_row, reasons))) if reasons else ""


def _row(reason: StopReason) -> str:
    where = [
        f"{room.name} {number(lost)} {reason.unit}{'' if room.met else ', then below what is asked'}"
        for room, lost in zip(reason.rooms, reason.lost, strict=True)
        if lost >= LEAST_TOLD
    ]
    runners = [f"{item.candidate} ({number(item.new)} {reason.unit})" for item in reason.runners]
    return row(
        [
            *(shown(reason.stop), str(reason.step), f"{number(reason.sees)} {reason.unit}"),
            *(f"{number(reason.alone)} {reason.unit}", percent(reason.lost_share)),
            *(shown("; ".join(where)), shown(", ".join(runners))),
        ]
    )
