"""A replay as a person reads it on a terminal, as one JSON object, and as a table of stops."""

from __future__ import annotations

import csv
import io
import math
from typing import Any

from stopgo.mission.comparing.as_driven import AsDriven
from stopgo.mission.comparing.comparison_text import comparison_json, comparison_table
from stopgo.mission.comparing.measured import Measured
from stopgo.mission.console.table import printable, table
from stopgo.mission.run.run_log import Alignment
from stopgo.mission.stages.figures import percent
from stopgo.recordings.logs.field_log import FieldLog
from stopgo.recordings.replay.drive_verdict import judged
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.path_and_time import lost_times, way_of

MOST_LOST = 5
"""Places where time was lost that are listed on a terminal; --json has all."""


def as_text(replay: Replay) -> str:
    """The stops, the way, the time, and the answer."""
    judgement = judged(replay)
    lines = [
        _head(replay.log),
        f"  poses      {replay.placed.source.source}, {len(replay.placed.track)} of them",
        f"  placed     {alignment_text(replay.run.alignment)}",
        *(f"  note       {line}" for line in notes_of(replay)),
        "",
        *(f"  {line}" for line in comparison_table(replay.comparison).split("\n")),
        "",
        *truth_lines(replay),
        *way_lines(replay),
        *(f"  time lost  {item.seconds:+7.1f} s  {item.where}" for item in lost_times(replay)[:MOST_LOST]),
        *_sight(replay),
        *measured_lines(replay),
        judgement.text,
    ]
    return "\n".join(printable(line) for line in lines)


def _head(log: FieldLog) -> str:
    return f"{log.path}: {log.format}, {log.messages} messages, sha256 {log.digest[:12]}…"


def alignment_text(alignment: Alignment | None) -> str:
    """How the log was brought to the mission's frame, in a line."""
    if alignment is None:
        return "as it is"
    moved = (
        f"turned {math.degrees(alignment.heading):.2f}°, then shifted by "
        f"({alignment.x:.3f}, {alignment.y:.3f}) m; times {alignment.time_offset_ns / 1e9:+.3f} s"
    )
    if alignment.residual_rms_m is None or alignment.residual_max_m is None:
        return f"{alignment.how}: {moved}"
    rest = f"{1000 * alignment.residual_rms_m:.0f} mm rms, {1000 * alignment.residual_max_m:.0f} mm at most"
    return f"{alignment.how}: {moved}; what is left is {rest}"


def notes_of(replay: Replay) -> tuple[str, ...]:
    """What is odd about the log, and how missions in it differ from ours."""
    lost = (f"DAMAGED: {replay.log.lost}",) if replay.log.lost else ()
    turns = (
        () if replay.placed.turns else ("no headings in the log: the direction of driving stands for them",)
    )
    return (*lost, *replay.log.oddities, *replay.placed.source.oddities, *turns, *replay.uploads)


def truth_lines(replay: Replay) -> list[str]:
    """By a simulator's word, where it stood."""
    offsets = [(stop.id, replay.true_offset_m(k)) for k, stop in enumerate(replay.mission.stops)]
    told = [f"{name} {1000 * away:.0f} mm" for name, away in offsets if away is not None]
    return [f"  in truth   {', '.join(told)}"] if told else []


def way_lines(replay: Replay) -> list[str]:
    way = way_of(replay)
    if way.driven_m is None or way.extra_m is None:
        return [f"  way        not in the log; {way.planned_m:.1f} m planned to the last stop visited"]
    lines = [
        f"  way        {way.driven_m:.1f} m driven, {way.planned_m:.1f} m planned to the last stop visited "
        f"({way.extra_m:+.1f} m)"
    ]
    if way.rms_m is not None and way.mean_m is not None:
        lines.append(
            f"  beside     mean {1000 * way.mean_m:+.0f} mm (left positive), rms {1000 * way.rms_m:.0f}, "
            f"median {1000 * (way.median_m or 0):.0f}, 95 % below {1000 * (way.p95_m or 0):.0f}, "
            f"greatest {1000 * (way.greatest_m or 0):.0f} mm at {way.greatest_s or 0:.1f} s"
        )
    return lines


def _sight(replay: Replay) -> list[str]:
    """What was in sight, least seen first, beside the plan."""
    if replay.sight is None:
        return []
    rows = [
        (
            share.name,
            *(
                percent(value).removesuffix(" %")
                for value in (planned.coverage, share.coverage, share.required)
            ),
        )
        for planned, share in replay.sight.pairs
    ]
    lines = table(("in sight", "planned %", "as driven %", "asked %"), rows).split("\n")
    return ["", *(f"  {line}" for line in lines), ""]


def measured_lines(replay: Replay) -> list[str]:
    """What the scans show."""
    found = replay.measured
    if found is None:
        return []
    share = found.shares.whole
    lines = [
        f"  measured   {percent(share.coverage)} of what is visible has points within "
        f"{1000 * found.tolerance_m:.0f} mm ({found.points} points)"
    ]
    worst = sorted(found.deviations, key=lambda item: -abs(item[2]))[:MOST_LOST]
    lines += [
        f"  deviation  {name}: mean {1000 * mean:+.0f} mm, rms {1000 * rms:.0f} mm, {count} points"
        for name, count, mean, rms in worst
    ]
    lines += [
        f"  unplanned  at ({item.middle[0]:.2f}, {item.middle[1]:.2f}), {item.size_m:.1f} m, "
        f"hit in {item.hits} scans"
        for item in found.unplanned
    ]
    return [*lines, ""]


def as_json(replay: Replay) -> dict[str, Any]:
    """Everything, for programs: metres, radians and seconds."""
    judgement, alignment = judged(replay), replay.run.alignment
    return {
        "log": replay.log.path,
        "format": replay.log.format,
        "sha256": replay.log.digest,
        "lost": replay.log.lost,
        "notes": list(notes_of(replay)),
        "poses": {"source": replay.placed.source.source, "count": len(replay.placed.track)},
        "alignment": None if alignment is None else vars(alignment),
        "inferred": replay.inferred,
        "answer": judgement.answer,
        "verdict": judgement.text,
        "way": {**vars(way_of(replay)), "extra_m": way_of(replay).extra_m},
        "time_lost": [vars(item) for item in lost_times(replay)],
        "halts": [_halt_json(replay, k) for k in range(len(replay.matches))],
        "true_offset_m": {stop.id: replay.true_offset_m(k) for k, stop in enumerate(replay.mission.stops)},
        "coverage": None if replay.sight is None else _sight_json(replay.sight),
        "measured": None if replay.measured is None else _measured_json(replay.measured),
        "run": comparison_json(replay.comparison),
    }


def _sight_json(sight: AsDriven) -> dict[str, Any]:
    shares = {
        share.name: {
            "planned": planned.coverage, "as_driven": share.coverage,
            "asked": share.required, "met": share.met,
        }
        for planned, share in sight.pairs
    }  # fmt: skip
    elements = [{"id": item.name, "visible": item.visible, "seen": item.seen} for item in sight.elements]
    return {"shares": shares, "elements": elements}


def _measured_json(found: Measured) -> dict[str, Any]:
    return {
        "tolerance_m": found.tolerance_m,
        "points": found.points,
        "share": found.shares.whole.coverage,
        "elements": [
            {"id": name, "points": count, "mean_m": mean, "rms_m": rms}
            for name, count, mean, rms in found.deviations
        ],
        "histogram_edges_m": found.edges_m.tolist(),
        "histograms": {
            item.id: counts.tolist()
            for item, counts in zip(found.ledger.elements, found.histogram, strict=True)
            if counts.any()
        },
        "unplanned": [
            {"x": item.middle[0], "y": item.middle[1], "size_m": item.size_m, "hits": item.hits,
             "outline": item.outline.exterior.tolist()}
            for item in found.unplanned
        ],
    }  # fmt: skip


def _halt_json(replay: Replay, number: int) -> dict[str, Any]:
    match = replay.matches[number]
    halt, stops = match.standing, replay.mission.stops
    begin, end = replay.run.seconds([halt.begin_ns, halt.end_ns]).tolist()
    return {
        "how": match.how,
        "stop": None if match.stop is None else stops[match.stop].id,
        "nearest": stops[match.near].id,
        "away_m": match.away_m,
        "begin_s": begin,
        "end_s": end,
        "x": halt.x,
        "y": halt.y,
        "heading": halt.heading,
        "moved_m": halt.moved_m,
    }


COLUMNS = (
    *("stop", "outcome", "planned_s", "arrived_s", "late_s", "deviation_m", "along_m", "across_m"),
    *("heading_rad", "tolerance_m", "tries", "reason"),
)


def as_csv(replay: Replay) -> bytes:
    """A row per stop: what was planned and what was, how long the robot stood, and how it moved meanwhile."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*COLUMNS, "stood_s", "moved_m", "true_offset_m"))
    numbers = {stop.id: k for k, stop in enumerate(replay.mission.stops)}
    for item in replay.comparison.asked:
        halts = replay.at(numbers[item.stop])
        stood = (halts[-1].standing.seconds, halts[-1].standing.moved_m) if halts else (None, None)
        cells = (*(getattr(item, name) for name in COLUMNS), *stood, replay.true_offset_m(numbers[item.stop]))
        writer.writerow("" if cell is None else _cell(cell) for cell in cells)
    return text.getvalue().encode()


def _cell(value: object) -> str:
    """Numbers to a tenth of a millimetre; no text that a spreadsheet would take for a formula."""
    if isinstance(value, float):
        return f"{value:.4f}"
    text = printable(str(value))
    return f"'{text}" if text[:1] in ("=", "+", "-", "@") else text
