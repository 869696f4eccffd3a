"""Content of a log, as text and as JSON: for `stopgo replay LOG --list`."""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime
from typing import Any

from stopgo.mission.console.table import counted, duration, table
from stopgo.recordings.logs.field_log import FieldLog, Poses

SHOWN = 12
"""Limit of remarks that are shown."""


def as_text(log: FieldLog) -> str:
    """Return the content for a person."""
    lines = [
        f"{log.path}: {log.format}, {log.messages} messages, {_span(log)}",
        f"  sha256 {log.digest[:16]}…",
    ]
    lines += [f"  LOST: {log.lost}"] if log.lost else []
    lines += [f"  note: {line}" for line in log.oddities]
    lines += _indented(_channels(log))
    lines += _indented(_poses(log)) if log.poses else ["  no poses"]
    lines += [f"  note: {track.source}: {line}" for track in log.poses for line in track.oddities]
    lines += [
        f"  mission of {counted(len(upload.items), 'item')}{'' if upload.complete else ', incomplete,'} at "
        f"{(upload.ns - log.begin_ns) / 1e9:.1f} s"
        for upload in log.uploads
    ]
    lines += _remarks(log)
    return "\n".join(lines)


def _span(log: FieldLog) -> str:
    if log.clock != "wall":
        return f"{duration(log.seconds)} of time {log.clock}"
    began = datetime.fromtimestamp(log.begin_ns / 1e9, UTC)
    return f"{duration(log.seconds)} from {began:%Y-%m-%d %H:%M:%S} UTC"


def _indented(lines: str) -> list[str]:
    return ["", *(f"  {line}" for line in lines.split("\n")), ""]


def _channels(log: FieldLog) -> str:
    rows = [(channel.name, channel.kind, str(channel.count)) for channel in log.channels]
    return table(("messages", "type", "count"), rows)


def _poses(log: FieldLog) -> str:
    rows = [
        (
            track.source, track.frame, track.robot, str(len(track.ns)), f"{track.seconds:.1f}",
            f"{track.metres:.1f}", _remark(track),
        )
        for track in log.poses
    ]  # fmt: skip
    return table(("poses", "frame", "robot", "count", "seconds", "metres", ""), rows)


def _remark(track: Poses) -> str:
    if track.truth:
        return "simulator's truth"
    return "on the earth" if track.origin is not None else ""


def _remarks(log: FieldLog) -> list[str]:
    """Return modes and triggers one by one, and the number of other remarks."""
    shown = [remark for remark in log.remarks if remark.kind in ("mode", "trigger", "reached")]
    lines = [
        f"  {(remark.ns - log.begin_ns) / 1e9:8.1f} s  {remark.kind} {remark.text}"
        for remark in shown[:SHOWN]
    ]
    lines += [f"  … and {len(shown) - SHOWN} more"] if len(shown) > SHOWN else []
    counts = Counter(remark.kind for remark in log.remarks if remark not in shown)
    return lines + [f"  {count} of kind {kind}" for kind, count in sorted(counts.items())]


def as_json(log: FieldLog) -> dict[str, Any]:
    """Return the content for programs."""
    return {
        "log": log.path,
        "format": log.format,
        "sha256": log.digest,
        "messages": log.messages,
        "clock": log.clock,
        "begin_ns": log.begin_ns,
        "end_ns": log.end_ns,
        "lost": log.lost,
        "notes": list(log.oddities),
        "channels": [vars(channel) for channel in log.channels],
        "poses": [
            {
                "source": track.source,
                "frame": track.frame,
                "robot": track.robot,
                "count": len(track.ns),
                "seconds": track.seconds,
                "metres": track.metres,
                "truth": track.truth,
                "on_earth": track.origin is not None,
                "notes": list(track.oddities),
            }
            for track in log.poses
        ],
        "missions": [
            {"at_ns": upload.ns, "items": len(upload.items), "complete": upload.complete}
            for upload in log.uploads
        ],
        "remarks": [vars(remark) for remark in log.remarks],
        "battery": [list(row) for row in log.battery[-1:]],
    }
