"""Whether a recording is whole, and agrees with itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.embedded.reading import Recording


def carry_end(canvas: Canvas) -> None:
    """At the very end: how many rows were drawn, by which a file that was cut and mended is known."""
    counts = sorted(canvas.counts.items())
    canvas.describe(
        entities.PROPERTY_END,
        {"entities": [name for name, _ in counts], "rows": [count for _, count in counts]},
    )


def problems_of(recording: Recording) -> tuple[str, ...]:
    """What is missing from a recording, or contradicts something else in it; a line each."""
    return tuple((*_missing(recording), *_contradictions(recording)))


def _missing(recording: Recording) -> Iterator[str]:
    held = recording.contents
    end = held.properties.get(entities.PROPERTY_END)
    if not held.complete:
        yield "not closed: its writer was stopped, or had no room on the disk"
    elif end is None:
        yield "incomplete: it was cut and mended, or written by another version; its end is missing"
    if end is not None:
        yield from _fewer(end, held.rows)


def _fewer(end: Mapping[str, object], rows: Mapping[str, int]) -> Iterator[str]:
    names, counts = (_listed(end.get(name)) for name in ("entities", "rows"))
    drawn = dict(zip(map(str, names), map(int, counts), strict=False))
    lost = {name: count - rows.get(name, 0) for name, count in drawn.items() if rows.get(name, 0) < count}
    if lost:
        worst = max(lost, key=lambda name: lost[name])
        yield f"incomplete: {sum(lost.values())} of {sum(drawn.values())} rows are missing, most of {worst}"


def _listed(value: object) -> list:
    """A value that was written as a list; one that had a single item was read bare."""
    return list(value) if isinstance(value, list | tuple) else [] if value is None else [value]


def _contradictions(recording: Recording) -> Iterator[str]:
    digests = {mission.revision: mission.digest for mission in recording.missions}
    for mission in recording.missions:
        if mission.id != recording.mission_id:
            yield f"the mission in it is {mission.id}, the recording's is {recording.mission_id}"
    for sight in recording.sights:
        if digests.get(sight.revision, sight.digest) != sight.digest:
            yield f"what stops see is of another mission than revision {sight.revision} in it"
    for name in (entities.PROPERTY_PLAN, entities.PROPERTY_RUN):
        told = recording.contents.properties.get(name, {})
        revision, digest = told.get("revision"), told.get("digest")
        if digest is not None and revision in digests and digests[revision] != digest:
            yield f"its {name} is of digest {str(digest)[:12]}…, revision {revision} in it has another"
    for log in recording.logs:
        if log.mission_id != recording.mission_id:
            yield f"run {log.run_id} is of mission {log.mission_id}, the recording of {recording.mission_id}"
