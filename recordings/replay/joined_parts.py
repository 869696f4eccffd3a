"""Logs of one run, such as of a robot that was rebooted on the way: one log, with the parts in their order.

Each part is placed in the mission's frame by itself. Parts with dates are ordered by them, others stay in the
given order. Where the clock of a part does not go on from the part before, its times are shifted behind it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import frozen
from stopgo.mission.run.run_log import Track
from stopgo.recordings.logs.field_log import FieldLog, Poses, Sweep
from stopgo.recordings.replay.log_placing import PlacedLog

APART_NS = 10**9
"""Time from the end of a part to the shifted begin of the next; the true time is unknown."""
DATED_NS = 10**18
"""Times from September 2001 on are dates."""

Part = tuple[FieldLog, PlacedLog]


def joined(parts: Sequence[Part]) -> Part:
    """Return the parts of one run as one log, with a restart at the begin of each part but the first.

    Raises
    ------
    InputError
        When they are of several formats, sources of poses, or robots, or a part is given twice.
    """
    _check(parts)
    ordered = _ordered(parts)
    shifts = list(_shifts(ordered))
    begins = [int(placed.track.ns[0]) + shift for (_, placed), shift in zip(ordered, shifts, strict=True)]
    track = _track(ordered, shifts, begins[1:])
    first = ordered[0][1]
    how = f"each of {len(ordered)} logs by itself; the first: {first.alignment.how}"
    if first.by_earth:
        how = f"{first.alignment.how}, each of {len(ordered)} logs by itself"
    source = _source(ordered, shifts, begins[1:])
    truth = None if len(ordered) > 1 else first.truth
    placed = replace(
        first, track=track, alignment=replace(first.alignment, how=how), source=source, truth=truth
    )
    return _log(ordered, shifts), placed


def _check(parts: Sequence[Part]) -> None:
    first, placed = parts[0]
    for log, other in parts[1:]:
        same = (log.format, other.source.source, other.source.robot)
        if same != (first.format, placed.source.source, placed.source.robot):
            raise InputError(
                f"{log.path}: {log.format} with {other.source.source} is no part of the run in {first.path} "
                f"({first.format} with {placed.source.source}); choose with --poses, or replay it alone"
            )
    digests = [log.digest for log, _ in parts]
    for number, (log, _) in enumerate(parts):
        if log.digest in digests[:number]:
            raise InputError(f"{log.path}: is given twice; give each part of the run once")


def _ordered(parts: Sequence[Part]) -> list[Part]:
    dated = all(placed.track.ns[0] > DATED_NS for _, placed in parts)
    return sorted(parts, key=lambda part: int(part[1].track.ns[0])) if dated else list(parts)


def _shifts(parts: Sequence[Part]) -> Iterator[int]:
    """Yield the nanoseconds to add to the times of each part."""
    end: int | None = None
    for _, placed in parts:
        begin = int(placed.track.ns[0])
        shift = 0 if end is None or begin > end else end + APART_NS - begin
        yield shift
        end = int(placed.track.ns[-1]) + shift


def _track(parts: Sequence[Part], shifts: Sequence[int], restarts: Sequence[int]) -> Track:
    tracks = [placed.track for _, placed in parts]
    own = [ns + shift for track, shift in zip(tracks, shifts, strict=True) for ns in track.restarts_ns]
    return Track.of(
        np.concatenate([track.ns + shift for track, shift in zip(tracks, shifts, strict=True)]),
        np.concatenate([track.xy for track in tracks]),
        np.concatenate([track.heading for track in tracks]),
        restarts_ns=sorted({*own, *restarts}),
    )


def _source(parts: Sequence[Part], shifts: Sequence[int], restarts: Sequence[int]) -> Poses:
    """Return the poses of all parts, each still in its own frame; their heights count from one zero."""
    sources = [placed.source for _, placed in parts]
    heights = [np.full(len(one.ns), np.nan) if one.height is None else one.height for one in sources]
    offset = parts[0][1].alignment.time_offset_ns
    ns = np.concatenate([one.ns + shift for one, shift in zip(sources, shifts, strict=True)])
    return replace(
        sources[0],
        ns=frozen(ns, np.int64),
        xy=frozen(np.concatenate([one.xy for one in sources])),
        heading=frozen(np.concatenate([one.heading for one in sources])),
        height=frozen(np.concatenate(heights)),
        oddities=tuple(line for one in sources for line in one.oddities),
        restarts_ns=tuple(ns - offset for ns in restarts),
    )


def _log(parts: Sequence[Part], shifts: Sequence[int]) -> FieldLog:
    """Return what the parts contain besides poses, in the order of time."""
    logs = [log for log, _ in parts]
    moved = list(zip(logs, shifts, strict=True))
    digest = hashlib.sha256("".join(log.digest for log in logs).encode()).hexdigest()

    def sweeps() -> Iterator[Sweep]:
        for log, shift in moved:
            yield from (replace(sweep, ns=sweep.ns + shift) for sweep in log.sweeps())

    return replace(
        logs[0],
        path=" + ".join(log.path for log in logs),
        format=f"{logs[0].format}, {len(logs)} logs",
        digest=digest,
        messages=sum(log.messages for log in logs),
        begin_ns=logs[0].begin_ns,
        end_ns=logs[-1].end_ns + shifts[-1],
        uploads=tuple(replace(item, ns=item.ns + shift) for log, shift in moved for item in log.uploads),
        remarks=tuple(replace(item, ns=item.ns + shift) for log, shift in moved for item in log.remarks),
        battery=tuple((ns + shift, charge) for log, shift in moved for ns, charge in log.battery),
        sweeps=sweeps,
        lost="; ".join(f"{log.path}: {log.lost}" for log in logs if log.lost),
        oddities=tuple(line for log in logs for line in log.oddities),
    )
