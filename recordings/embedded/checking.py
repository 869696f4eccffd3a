"""Check that a recording is complete and does not contradict itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.embedded.reading import Recording


def embed_end(canvas: Canvas) -> None:
    """Write the rows per entity as the last property; rows missing from a repaired file are found by it."""
    counts = sorted(canvas.counts.items())
    canvas.describe(
        entities.PROPERTY_END,
        {"entities": [name for name, _ in counts], "rows": [count for _, count in counts]},
    )


def problems_of(recording: Recording) -> tuple[str, ...]:
    """Return what is missing from a recording or contradicts something else in it, one line each."""
    return tuple((*_missing(recording), *_contradictions(recording)))


def _missing(recording: Recording) -> Iterator[str]:
    contents = recording.contents
    end = contents.properties.get(entities.PROPERTY_END)
    if not contents.complete:
        yield "not closed: its writer was stopped, or the disk was full"
    elif end is None:
        yield "incomplete: its end is missing; it was truncated and repaired, or written by another version"
    if end is not None:
        yield from _missing_rows(end, contents.rows)


def _missing_rows(end: Mapping[str, object], rows: Mapping[str, int]) -> Iterator[str]:
    names, counts = (_listed(end.get(name)) for name in ("entities", "rows"))
    drawn = dict(zip(map(str, names), map(int, counts), strict=False))
    missing = {name: count - rows.get(name, 0) for name, count in drawn.items() if rows.get(name, 0) < count}
    if missing:
        worst = max(missing, key=lambda name: missing[name])
        fraction = f"{sum(missing.values())} of {sum(drawn.values())}"
        yield f"incomplete: {fraction} rows are missing, most of {worst}"


def _listed(value: object) -> list:
    """Return a value that was written as a list; a list of one item is read back as the bare item."""
    return list(value) if isinstance(value, list | tuple) else [] if value is None else [value]


def _contradictions(recording: Recording) -> Iterator[str]:
    digests = {mission.revision: mission.digest for mission in recording.missions}
    for mission in recording.missions:
        if mission.id != recording.mission_id:
            yield f"embedded mission is {mission.id}, the recording is of {recording.mission_id}"
    for sight in recording.sights:
        if digests.get(sight.revision, sight.digest) != sight.digest:
            yield f"visibility of the stops is of another mission than the embedded revision {sight.revision}"
    for name in (entities.PROPERTY_PLAN, entities.PROPERTY_RUN):
        properties = recording.contents.properties.get(name, {})
        revision, digest = properties.get("revision"), properties.get("digest")
        if digest is not None and revision in digests and digests[revision] != digest:
            yield f"its {name} has digest {str(digest)[:12]}…, the embedded revision {revision} has another"
    for log in recording.logs:
        if log.mission_id != recording.mission_id:
            yield f"run {log.run_id} is of mission {log.mission_id}, not {recording.mission_id}"
