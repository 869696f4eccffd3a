"""What a station remembers stands in the way of another mission: a run that is not over."""

from __future__ import annotations

from stopgo.bridge.mavlink.auto.logbook import Logbook
from stopgo.bridge.mavlink.line.peer import Peer
from stopgo.bridge.mavlink.line.url import Url
from stopgo.mission.errors import NegativeResult
from stopgo.mission.run.tolerance import stops_outside_text


def check_run_over(peer: Peer, url: Url, book: Logbook, what: str) -> None:
    """Refuses to take the mission from under a run that somebody means to go on with.

    Raises
    ------
    AnswerIsNo
        If the run is not over; `what` is the deed that would end it, as in "a push".
    """
    run, listed = book.run, book.listed
    if run.over or listed is None:
        return
    mission = listed.mission
    outside = stops_outside_text(run.outside, len(run.outside))
    stops = f"{len(run.done)} of {len(mission.stops)} stops done{outside}"
    seen = ", unless stopgo watch sees that it has come to its end" if run.state == "RUNNING" else ""
    raise NegativeResult(
        f"{peer}: run {run.run_id} of {mission.name} ({mission.id[:12]}) is {run.state}, {stops}, and {what}"
        f" would end it; end it first (stopgo abort --mavlink {url}){seen}, or add --while-running;"
        " nothing was sent",
        reason="running",
    )
