"""Replay as text for a terminal, as one JSON object, and as a table of stops."""

from __future__ import annotations

import csv
import io
import math
from typing import Any

import numpy as np

from stopgo.mission.comparing.as_driven import AsDriven
from stopgo.mission.comparing.comparison_text import comparison_json, comparison_table
from stopgo.mission.comparing.measured import Absent, Measured
from stopgo.mission.console.table import counted, printable, table
from stopgo.mission.stages.figures import pair_cells, percent
from stopgo.recordings.logs.field_log import FieldLog
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.path_and_time import driven_path, lost_times
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.stop_evidence import StopEvidence, stop_evidence

MOST_LOST = 5
"""Limit of listed causes of lost time on a terminal; --json has all."""


def as_text(replay: Replay) -> str:
    """Return the stops, the path, the time, and the verdict."""
    judgement = drive_verdict(replay)
    lines = [
        _head(replay.log),
        f"  poses      {replay.placed.source.source}, {len(replay.placed.track)} of them",
        f"  placed     {replay.run.alignment.text if replay.run.alignment else 'unchanged'}",
        *(f"  note       {line}" for line in notes_of(replay)),
        "",
        *(f"  {line}" for line in comparison_table(replay.comparison).split("\n")),
        "",
        *truth_lines(replay),
        *uncertainty_lines(replay),
        *path_lines(replay),
        *(f"  time lost  {item.seconds:+7.1f} s  {item.where}" for item in lost_times(replay)[:MOST_LOST]),
        *_sight(replay),
        *measured_lines(replay),
        judgement.text,
    ]
    return "\n".join(printable(line) for line in lines)


def _head(log: FieldLog) -> str:
    return f"{log.path}: {log.format}, {log.messages} messages, sha256 {log.digest[:12]}…"


def notes_of(replay: Replay) -> tuple[str, ...]:
    """Return anomalies of the log, and differences between missions in it and ours."""
    lost = (f"DAMAGED: {replay.log.lost}",) if replay.log.lost else ()
    headings_note = (
        ()
        if replay.placed.turns
        else ("no headings in the log: the direction of driving is used, and no laser scan",)
    )
    return (*lost, *replay.log.oddities, *replay.placed.source.oddities, *headings_note, *replay.uploads)


def truth_lines(replay: Replay) -> list[str]:
    """Return the true position errors, if the log is from a simulator."""
    offsets = [(stop.id, replay.true_offset_m(k)) for k, stop in enumerate(replay.mission.stops)]
    errors = [f"{name} {1000 * away:.0f} mm" for name, away in offsets if away is not None]
    return [f"  true error {', '.join(errors)}"] if errors else []


def uncertainty_lines(replay: Replay) -> list[str]:
    """Return the uncertainty of the position errors: one for most stops, and the stops with a greater one."""
    known = [(one.item.stop, one.unsure_m) for one in stop_evidence(replay) if one.unsure_m is not None]
    if not known:
        return []
    usual = float(np.median([unsure_m for _, unsure_m in known]))
    worse = [(stop, unsure_m) for stop, unsure_m in known if unsure_m > max(2 * usual, usual + LEAST_WORSE_M)]
    others = ", ".join(f"{stop} {_plus_minus(unsure_m)}" for stop, unsure_m in worse[:MOST_LOST])
    rest = f", and {len(worse) - MOST_LOST} more" if len(worse) > MOST_LOST else ""
    return [f"  uncertain  position errors {_plus_minus(usual)}" + (f"; {others}{rest}" if others else "")]


LEAST_WORSE_M = 0.005


def _plus_minus(metres: float) -> str:
    return f"± {max(1.0, 1000 * metres):.0f} mm" if math.isfinite(metres) else "without a limit"


def path_lines(replay: Replay) -> list[str]:
    path = driven_path(replay)
    if path.driven_m is None or path.extra_m is None:
        return [f"  path       not in the log; {path.planned_m:.1f} m planned to the last stop visited"]
    lines = [
        f"  path       {path.driven_m:.1f} m driven, {path.planned_m:.1f} m planned to the last stop visited "
        f"({path.extra_m:+.1f} m)"
    ]
    seen = "≤ " if replay.comparison.sighted.gaps else ""
    if path.rms_m is not None and path.mean_m is not None:
        lines.append(
            f"  off route  mean {1000 * path.mean_m:+.0f} mm (left positive), rms {1000 * path.rms_m:.0f}, "
            f"median {1000 * (path.median_m or 0):.0f}, 95 % below {1000 * (path.p95_m or 0):.0f}, "
            f"greatest {seen}{1000 * (path.greatest_m or 0):.0f} mm at {path.greatest_s or 0:.1f} s"
            + (f", {replay.comparison.sighted.limits}" if seen else "")
        )
    return lines


def _sight(replay: Replay) -> list[str]:
    """Return the visible fractions, lowest first, next to those planned."""
    if replay.sight is None:
        return []
    rows = [pair_cells(planned, group) for planned, group in replay.sight.pairs]
    lines = table(("visible", "planned %", "as driven %", "required %"), rows).split("\n")
    return ["", *(f"  {line}" for line in lines), ""]


def measured_lines(replay: Replay) -> list[str]:
    """Return the measurements of the scans."""
    found = replay.measured
    if found is None:
        return []
    whole = found.coverage.whole
    lines = [
        f"  measured   {percent(whole.coverage)} of what is visible has points within "
        f"{1000 * found.tolerance_m:.0f} mm ({found.points} points)"
    ]
    worst = sorted(found.deviations, key=lambda item: -abs(item[2]))[:MOST_LOST]
    lines += [
        f"  deviation  {name}: mean {1000 * mean:+.0f} mm, rms {1000 * rms:.0f} mm, {counted(count, 'point')}"
        for name, count, mean, rms in worst
    ]
    lines += [
        f"  unplanned  at ({item.middle[0]:.2f}, {item.middle[1]:.2f}), {item.size_m:.1f} m, "
        f"hit in {item.hits} of {item.sweeps} scans ({percent(item.hits / item.sweeps)})"
        for item in found.unplanned
    ]
    lines += [
        f"  absent     {item.id}: no point on {percent(item.empty)} of its visible part; "
        f"{percent(item.visible)} of it was visible"
        for item in absent_of(replay)
    ]
    return [*lines, ""]


def absent_of(replay: Replay) -> tuple[Absent, ...]:
    """Return the elements that the scanner's clouds hardly show, though they were visible."""
    found = replay.measured
    if found is None or replay.sight is None or not found.decides or found.placing_text:
        return ()
    return found.absent(replay.sight.driven)


def as_json(replay: Replay) -> dict[str, Any]:
    """Return everything, for programs: metres, radians and seconds."""
    judgement, alignment = drive_verdict(replay), replay.run.alignment
    return {
        "log": replay.log.path,
        "format": replay.log.format,
        "sha256": replay.log.digest,
        "lost": replay.log.lost,
        "notes": list(notes_of(replay)),
        "poses": {"source": replay.placed.source.source, "count": len(replay.placed.track)},
        "alignment": None if alignment is None else vars(alignment),
        "inferred": replay.inferred,
        "evidence": [_evidence_json(one) for one in stop_evidence(replay)],
        "answer": judgement.answer,
        "verdict": judgement.text,
        "way": {**vars(driven_path(replay)), "extra_m": driven_path(replay).extra_m},
        "time_lost": [vars(item) for item in lost_times(replay)],
        "halts": [_standstill_json(replay, k) for k in range(len(replay.matches))],
        "true_offset_m": {stop.id: replay.true_offset_m(k) for k, stop in enumerate(replay.mission.stops)},
        "coverage": None if replay.sight is None else _sight_json(replay.sight),
        "measured": None if replay.measured is None else _measured_json(replay, replay.measured),
        "run": comparison_json(replay.comparison),
    }


def _evidence_json(one: StopEvidence) -> dict[str, Any]:
    """Return a stop's answer; `unsure_m` is None without a position, or where nothing limits it."""
    limited = one.unsure_m is not None and math.isfinite(one.unsure_m)
    unsure_m = one.unsure_m if limited else None
    return {"stop": one.item.stop, "answer": one.answer, "why": one.why, "unsure_m": unsure_m}


def _sight_json(sight: AsDriven) -> dict[str, Any]:
    groups = {
        group.name: {
            "planned": planned.coverage, "as_driven": group.coverage,
            "asked": group.required, "met": group.met,
        }
        for planned, group in sight.pairs
    }  # fmt: skip
    elements = [{"id": item.name, "visible": item.visible, "seen": item.seen} for item in sight.elements]
    return {"shares": groups, "elements": elements}


def _measured_json(replay: Replay, found: Measured) -> dict[str, Any]:
    return {
        "tolerance_m": found.tolerance_m,
        "points": found.points,
        "share": found.coverage.whole.coverage,
        "required": found.coverage.whole.required if found.decides else None,
        "misplaced_m": [round(away, 3) if math.isfinite(away) else None for away in found.misplaced_m or ()],
        "elements": [
            {"id": name, "points": count, "mean_m": mean, "rms_m": rms}
            for name, count, mean, rms in found.deviations
        ],
        "histogram_edges_m": found.edges_m.tolist(),
        "histograms": {
            item.id: counts.tolist()
            for item, counts in zip(found.totals.elements, found.histogram, strict=True)
            if counts.any()
        },
        "unplanned": [
            {"x": item.middle[0], "y": item.middle[1], "size_m": item.size_m, "hits": item.hits,
             "scans": item.sweeps, "outline": item.outline.exterior.tolist()}
            for item in found.unplanned
        ],
        "absent": [vars(item) for item in absent_of(replay)],
    }  # fmt: skip


def _standstill_json(replay: Replay, number: int) -> dict[str, Any]:
    match = replay.matches[number]
    standstill, stops = match.standstill, replay.mission.stops
    begin, end = replay.run.seconds([standstill.begin_ns, standstill.end_ns]).tolist()
    return {
        "how": match.how,
        "stop": None if match.stop is None else stops[match.stop].id,
        "nearest": stops[match.near].id,
        "away_m": match.away_m,
        "begin_s": begin,
        "end_s": end,
        "x": standstill.x,
        "y": standstill.y,
        "heading": standstill.heading,
        "moved_m": standstill.moved_m,
    }


COLUMNS = (
    *("stop", "outcome", "planned_s", "arrived_s", "late_s", "deviation_m", "along_m", "across_m"),
    *("heading_rad", "tolerance_m", "tries", "reason"),
)


def as_csv(replay: Replay) -> bytes:
    """Return a row per stop: plan and result, dwell time, and movement during it."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*COLUMNS, "stood_s", "moved_m", "true_offset_m", "unsure_m", "answer"))
    evidence = {one.item.stop: one for one in stop_evidence(replay)}
    numbers = {stop.id: k for k, stop in enumerate(replay.mission.stops)}
    for item in replay.comparison.asked:
        standstills = replay.at(numbers[item.stop])
        dwell = (
            (standstills[-1].standstill.seconds, standstills[-1].standstill.moved_m)
            if standstills
            else (None, None)
        )
        one = evidence[item.stop]
        cells = (
            *(getattr(item, name) for name in COLUMNS), *dwell, replay.true_offset_m(numbers[item.stop]),
            one.unsure_m, one.answer,
        )  # fmt: skip
        writer.writerow("" if cell is None else _cell(cell) for cell in cells)
    return text.getvalue().encode()


def _cell(value: object) -> str:
    """Return numbers to a tenth of a millimetre, and texts that no spreadsheet reads as a formula."""
    if isinstance(value, float):
        return f"{value:.4f}"
    text = printable(str(value))
    return f"'{text}" if text[:1] in ("=", "+", "-", "@") else text
