"""Check for an unfinished run, which another mission on the vehicle would end."""

from __future__ import annotations

from stopgo.bridge.mavlink.auto.logbook import Logbook
from stopgo.mission.errors import NegativeResult
from stopgo.mission.run.tolerance import stops_outside_text


def check_run_over(vehicle: str, book: Logbook, what: str) -> None:
    """Refuse to replace the mission of a run that somebody may want to go on with.

    Raises
    ------
    AnswerIsNo
        If the run is not over; `what` is the action that would end it, as in "a push".
    """
    run, listed = book.run, book.listed
    if run.over or listed is None:
        return
    mission = listed.mission
    outside = stops_outside_text(run.outside, len(run.outside))
    stops = f"{len(run.done)} of {len(mission.stops)} stops done{outside}"
    seen = ", unless stopgo watch shows that it has ended" if run.state == "RUNNING" else ""
    raise NegativeResult(
        f"{vehicle}: run {run.run_id} of {mission.name} ({mission.id[:12]}) is {run.state}, {stops},"
        f" and {what} would end it; end it first (stopgo abort{book.address}){seen}, or add --while-running;"
        " nothing was sent",
        reason="running",
    )
