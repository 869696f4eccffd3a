"""Table of the page with the reasons for each stop of a plan."""

from __future__ import annotations

from collections.abc import Sequence

from stopgo.mission.stages.figures import percent
from stopgo.mission.stages.stop_reasons import LEAST_PRINTED, StopReason
from stopgo.recordings.page.words import grid, number, row, section, shown


def stop_table(reasons: Sequence[StopReason]) -> str:
    """Return a row for each stop, in the order of driving; an empty string for plans without reasons."""
    if not reasons:
        return ""
    unit = reasons[0].unit
    header = (
        "stop",
        "choice",
        f"sees {unit}",
        f"only it sees {unit}",
        "lost",
        f"where {unit}",
        f"runners-up {unit}",
    )
    return section("Reasons for each stop", grid(header, map(_row, reasons)))


def _row(reason: StopReason) -> str:
    where = [
        f"{room.name} {number(lost)}{'' if room.met else ', then below the requirement'}"
        for room, lost in zip(reason.rooms, reason.lost, strict=True)
        if lost >= LEAST_PRINTED
    ]
    runners = [f"{item.candidate} ({number(item.new)})" for item in reason.runners]
    return row(
        [
            *(shown(reason.stop), str(reason.step), number(reason.sees)),
            *(number(reason.alone), percent(reason.lost_fraction)),
            *(shown("; ".join(where)), shown(", ".join(runners))),
        ]
    )
