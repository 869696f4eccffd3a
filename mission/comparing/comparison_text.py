"""Text of a comparison for a terminal, and the same as one JSON object."""

from __future__ import annotations

from typing import Any

from stopgo.mission.comparing.acquired import Acquired
from stopgo.mission.comparing.comparison import COLUMNS, Comparison
from stopgo.mission.comparing.run_verdict import judge
from stopgo.mission.console.table import counted, duration, printable, table
from stopgo.mission.run.events import JUMPED_OVER, Aborted, Finished
from stopgo.mission.stages.figures import GroupCoverage, pair_cells
from stopgo.mission.stages.network import apart_in_words, network_of

FOLLOW_UP = "stopgo replay RECORDING --mission mission.json --floor FLOOR --top-up next.json"
MOST_ROOMS = 12
"""Rooms listed on a terminal; --json has all."""


def comparison_text(comparison: Comparison) -> str:
    """Return the table of stops, the acquired coverage, and the verdict."""
    lines = [comparison_table(comparison), ""]
    if comparison.acquired is not None:
        lines += [*_coverage_lines(comparison.acquired), ""]
    return "\n".join([*lines, *_totals(comparison), printable(judge(comparison).text)])


def comparison_table(comparison: Comparison) -> str:
    """Return the table of stops."""
    return table(COLUMNS, [tuple(item.cells.values()) for item in comparison.stops])


def _totals(comparison: Comparison) -> list[str]:
    position, cross_track = comparison.greatest_deviation_m, comparison.cross_track.greatest_m
    driven = "not ended" if comparison.driven_s is None else duration(comparison.driven_s)
    paused_s, seen = comparison.seconds_in("PAUSED", "HELD"), comparison.sighted
    revisions = [str(mission.revision) for mission in comparison.missions]
    several = [f"revisions {', '.join(revisions)} of the mission, one after another"]
    return [
        *(several if len(revisions) > 1 else []),
        *([printable(apart)] if (apart := apart_in_words(comparison.mission, _expected(comparison))) else []),
        f"run {printable(comparison.run_id or 'without a name')}: {comparison.scanned} of "
        f"{len(comparison.asked)} stops scanned; planned {duration(comparison.planned_s)}, driven {driven}"
        + (f", of which paused or held {duration(paused_s)}" if paused_s else ""),
        f"greatest position error {_millimetres(position)}, cross-track error "
        + (f"≤ {_millimetres(cross_track)} {seen.limits}" if seen.gaps else _millimetres(cross_track)),
        *seen.lines,
        *_jumped_lines(comparison),
    ]


def _jumped_lines(comparison: Comparison) -> list[str]:
    """Name the stops that somebody jumped over, with the command that plans a mission for them."""
    skipped = [item for item in comparison.stops if item.outcome == "skipped"]
    jumped = [printable(item.stop) for item in skipped if JUMPED_OVER in item.reason]
    if not jumped:
        return []
    return [
        f"not scanned, {JUMPED_OVER} somebody: {', '.join(jumped)}; for a follow-up mission: {FOLLOW_UP};"
        " to drive the whole mission again: stopgo start --again"
    ]


def _expected(comparison: Comparison) -> list[str]:
    """Return the stops that are scanned, or may still be scanned."""
    ended = _ended(comparison) is not None
    lost = {"skipped", "failed", "withdrawn", *(("arrived", "not reached") if ended else ())}
    return [item.stop for item in comparison.stops if item.outcome not in lost]


def _millimetres(metres: float | None) -> str:
    return "-" if metres is None else f"{1000 * metres:.1f} mm"


def _coverage_lines(acquired: Acquired) -> list[str]:
    whole = (acquired.planned.whole, acquired.coverage.whole)
    pairs = [whole, *acquired.kinds, *acquired.rooms[:MOST_ROOMS]]
    rows = [(*pair_cells(planned, group), "" if group.met else "too little") for planned, group in pairs]
    lines = [table(("coverage", "planned %", "acquired %", "required %", ""), rows)]
    rest = len(acquired.rooms) - MOST_ROOMS
    return [*lines, f"and {counted(rest, 'more room')}, with higher coverage"] if rest > 0 else lines


def comparison_json(comparison: Comparison) -> dict[str, Any]:
    """Return the same and more, for programs: metres, radians and seconds; fractions from 0 to 1."""
    judgement = judge(comparison)
    return {
        "run_id": comparison.run_id,
        "robot": comparison.log.robot,
        "revisions": [mission.revision for mission in comparison.missions],
        "ended": _ended(comparison),
        "answer": judgement.answer,
        "verdict": judgement.text,
        "scanned": comparison.scanned,
        "asked": len(comparison.asked),
        "planned_s": comparison.planned_s,
        "driven_s": comparison.driven_s,
        "paused_s": comparison.seconds_in("PAUSED"),
        "held_s": comparison.seconds_in("HELD"),
        "greatest_deviation_m": comparison.greatest_deviation_m,
        "greatest_beside_route_m": comparison.cross_track.greatest_m,
        "travelled_m": comparison.log.poses.length_m if len(comparison.log.poses) else None,
        **_seen_json(comparison),
        "pieces": _pieces(comparison),
        "coverage": None if comparison.acquired is None else _acquired_json(comparison.acquired),
        "stops": [item.as_json() for item in comparison.stops],
        "states": [
            {"state": span.state, "begin_s": span.begin_s, "end_s": span.end_s, "why": span.why}
            for span in comparison.spans
        ],
    }


def _seen_json(comparison: Comparison) -> dict[str, Any]:
    """Return the seen fraction of the path (None without poses), and the gaps in the poses."""
    seen = comparison.sighted
    return {
        "seen": seen.fraction if len(comparison.log.poses) else None,
        "unseen_s": seen.unseen_s,
        "unseen_m": seen.unseen_m,
        "gaps": [
            {
                "begin_s": gap.begin_s,
                "end_s": gap.end_s,
                "begin": gap.begin,
                "end": gap.end,
                "unseen_m": gap.metres,
                "restarted": gap.restarted,
            }
            for gap in seen.gaps
        ],
    }


def _ended(comparison: Comparison) -> str | None:
    """Return the name of the event that ended the run."""
    ends = [type(event).__name__ for event in comparison.log.events if isinstance(event, Finished | Aborted)]
    return ends[-1] if ends else None


def _pieces(comparison: Comparison) -> list[list[str]] | None:
    """Return the connected scans, with those that may still be made; None if no network was planned."""
    network = network_of(comparison.mission)
    return None if network is None else [list(piece) for piece in network.among(_expected(comparison)).pieces]


def _acquired_json(acquired: Acquired) -> dict[str, Any]:
    return {
        "rule": acquired.sight.totals.rule,
        "asked": acquired.coverage.whole.required,
        "planned": acquired.planned.whole.coverage,
        "acquired": acquired.coverage.whole.coverage,
        "unknown_stops": list(acquired.unknown),
        "rooms": [_pair_json(*pair) for pair in acquired.rooms],
        "kinds": [_pair_json(*pair) for pair in acquired.kinds],
        "elements": [
            {"id": item.name, "visible": item.visible, "seen": item.seen} for item in acquired.elements
        ],
    }


def _pair_json(planned: GroupCoverage, group: GroupCoverage) -> dict[str, Any]:
    seen = {"visible": group.visible, "seen": group.seen, "acquired": group.coverage}
    return {
        "name": group.name,
        **seen,
        "planned": planned.coverage,
        "asked": group.required,
        "met": group.met,
    }
