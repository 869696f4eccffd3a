"""A Rerun stream to draw on: opened strictly, in metres from a local origin, static or at given times."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import Chunk

from stopgo.mission.document import Mission
from stopgo.mission.geometry import FloatArray
from stopgo.recordings.drawing import entities, palette
from stopgo.recordings.drawing.blueprint import Bounds, blueprint

FAR = 1000.0
"""Rerun stores float32; beyond this distance a millimetre is lost, and a local origin is used."""
GRID = 100.0

LocalOrigin = tuple[float, float]


def local_origin(x: float, y: float) -> LocalOrigin:
    """The drawing's own origin, or for far coordinates a round point near (x, y)."""
    if max(abs(x), abs(y)) <= FAR:
        return (0.0, 0.0)
    return (round(x / GRID) * GRID, round(y / GRID) * GRID)


def mission_origin(mission: Mission) -> LocalOrigin:
    """The local origin of every recording of this mission, so that they overlay."""
    return local_origin(mission.start.x, mission.start.y)


def on_screen(points: float) -> float:
    """A radius in points of the screen, whatever the zoom: Rerun tells them from metres by the sign."""
    return -points


@dataclass(frozen=True)
class Canvas:
    """What drawing functions draw on; positions are given in the drawing's metres."""

    stream: rr.RecordingStream
    origin: LocalOrigin
    drawn: rr.BinaryStream
    counts: Counter[str] = field(default_factory=Counter)
    """Rows drawn so far, by entity."""

    def taken(self) -> bytes:
        """All that was drawn since it was last taken, as a recording in Rerun's format."""
        return self.drawn.read() or b""

    def local(self, xy: FloatArray) -> NDArray[Any]:
        """Points (…, 2) relative to the local origin, as Rerun stores them."""
        return (np.asarray(xy, dtype=np.float64) - self.origin).astype(np.float32)

    def strips(self, strips: Iterable[FloatArray]) -> list[NDArray[Any]]:
        """Line strips relative to the local origin."""
        return [self.local(strip) for strip in strips]

    def show(self, entity: str, *archetypes: Any) -> None:
        """Draw at every time of every timeline."""
        self.counts[entity] = max(1, self.counts[entity])
        self.stream.log(entity, *archetypes, static=True)

    def at(
        self,
        entity: str,
        archetype: Any,
        *,
        step: int | None = None,
        candidate: int | None = None,
        stop: int | None = None,
        mission_s: float | None = None,
        robot_ns: int | None = None,
    ) -> None:
        """Draw at the given times, of which there must be one: Rerun makes rows without a time static."""
        if step is candidate is stop is mission_s is robot_ns is None:
            raise ValueError(f"{entity}: no time given")
        self.stream.reset_time()
        if step is not None:
            self.stream.set_time(entities.STEP, sequence=step)
        if candidate is not None:
            self.stream.set_time(entities.CANDIDATE, sequence=candidate)
        if stop is not None:
            self.stream.set_time(entities.STOP_NUMBER, sequence=stop)
        if mission_s is not None:
            self.stream.set_time(entities.MISSION_TIME, duration=mission_s)
        if robot_ns is not None:
            self.stream.set_time(entities.ROBOT_TIME, timestamp=np.datetime64(robot_ns, "ns"))
        self.counts[entity] += 1
        self.stream.log(entity, archetype)

    def since(self, entity: str, *archetypes: Any, step: int, planning_only: bool = False) -> None:
        """Draw from a planning step on, and all the time on the other timelines of a plan.

        With `planning_only` not on the mission's time, where all that planning came to is shown at once.
        """
        mission_s = None if planning_only else 0.0
        for archetype in archetypes:
            self.at(entity, archetype, step=step, candidate=0, stop=1, mission_s=mission_s)

    def take(self, chunk: Chunk) -> None:
        """Take a part of another recording of the same origin as it is."""
        entity = str(chunk.entity_path)
        self.counts[entity] += 0 if chunk.is_static else chunk.num_rows
        self.counts[entity] = max(1, self.counts[entity])
        self.stream.send_chunks([chunk])

    def say(self, text: str, *, level: str = "INFO", step: int = 0) -> None:
        """One line of the plan's log, at this planning step and at the mission's start."""
        self.at(entities.LOG_PLAN, rr.TextLog(text, level=level), step=step, mission_s=0.0)

    def describe(self, name: str, values: dict[str, Any]) -> None:
        """A property of the recording; each value must be of one type wherever this name is used."""
        self.stream.send_property(name, rr.DynamicArchetype(name, components=values))

    def columns(self, entity: str, index: rr.TimeColumn | Sequence[rr.TimeColumn], *groups: Any) -> None:
        """Draw many rows at once, one per time of `index`, which may be on several timelines."""
        indexes = [index] if isinstance(index, rr.TimeColumn) else list(index)
        self.counts[entity] += len(indexes[0].times)
        self.stream.send_columns(entity, indexes=indexes, columns=[c for group in groups for c in group])


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """What a recording is of, known before anything is drawn."""

    recording_id: str
    name: str
    origin: LocalOrigin
    extent: Bounds
    """What 2D views show, in the drawing's metres."""
    runs: tuple[str, ...] = ()
    """Runs that are looked at together, each with a colour and a report of its own."""

    @property
    def local_extent(self) -> Bounds:
        x, y = self.origin
        return (self.extent[0] - x, self.extent[1] - y, self.extent[2] - x, self.extent[3] - y)


@contextmanager
def open_canvas(sheet: Sheet, *, port: int | None = None) -> Iterator[Canvas]:
    """A recording in memory, with the blueprint that all recordings share.

    Who opens it writes it: Rerun's own writers end in a thread of theirs when the disk is full, and whoever
    waits for them waits for ever. With a port, viewers of this machine can follow there what is drawn;
    until it is closed, all of it is kept for those that come later.
    """
    rr.set_strict_mode(True)
    with rr.RecordingStream(
        entities.APPLICATION, recording_id=sheet.recording_id, send_properties=False
    ) as stream:
        drawn = rr.binary_stream(stream)
        viewers = [] if port is None else [rr.GrpcServerSink("127.0.0.1", port)]
        layout = blueprint(sheet.local_extent, sheet.runs)
        stream.set_sinks(drawn, *viewers, default_blueprint=layout)
        stream.set_log_time_enabled(False)
        stream.send_recording_name(sheet.name)
        canvas = Canvas(stream, sheet.origin, drawn)
        _prepare(canvas)
        yield canvas


def layout_alone(sheet: Sheet) -> bytes:
    """The blueprint of a recording, in Rerun's format."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "layout.rbl")
        blueprint(sheet.local_extent, sheet.runs).save(entities.APPLICATION, path)
        return path.read_bytes()


def _prepare(canvas: Canvas) -> None:
    """The flip that makes 2D views y-up, and the classes."""
    flip = rr.Transform3D(scale=[1, -1, 1])
    canvas.show(entities.PLAN, flip)
    canvas.show(entities.FIELD, flip)
    canvas.show(entities.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    canvas.show(entities.ROOT, rr.AnnotationContext(palette.class_rows()))
