"""Canvas: an open Rerun recording, and the methods by which all drawing functions write to it.

Data. A `Canvas` has three things: the Rerun stream, the local origin, and the number of rows written per
entity. A `Sheet` is known before anything is drawn: recording id, name, origin and extent.

Coordinates. Callers give positions in the drawing's metres, x right and y up. Rerun stores float32, so far
from zero a millimetre is lost. `local` therefore subtracts the local origin in float64 before it converts.
All recordings of a mission have the same local origin (`mission_origin`), so a plan and its runs overlay.
Rerun's 2D views have y down: a transform at PLAN and FIELD flips y once, and every 2D view has its origin
above it. 3D entities below WORLD are not flipped.

Time. A row is either static or has at least one time:

- `show` writes a static row. It is valid at every time of every timeline, and replaces the last one.
- `at` writes one row at the given times. Rerun makes a row without a time static, so `at` refuses that.
- `since` writes a row that is visible from a planning step on, and always on the other plan timelines.
- `columns` writes many rows at once, one per time of its index.
- `copy_chunk` copies rows of another recording; that must have the same local origin.

The timelines are named in `entities`: planning step, candidate, stop, mission time and robot time.

Invariants:

- `counts` has an entry for every entity that was drawn: 1 or more. The recording's last property lists it,
  so a reader finds rows that are missing from a truncated file. Write only through the methods above.
- A property (`describe`) has the same type in every recording: Rerun refuses to merge other types.
- Rerun runs in strict mode: a wrong argument raises an error, and does not only print a warning.
- The recording stays in memory. The caller takes its bytes with `drain` and writes the file. Rerun's own
  file writer may block forever when the disk is full.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import Chunk

from stopgo.mission.document import Mission
from stopgo.mission.geometry import FloatArray
from stopgo.recordings.drawing import entities, palette
from stopgo.recordings.drawing.blueprint import Bounds, blueprint

FAR = 1000.0
"""Limit in metres: Rerun stores float32, so beyond it a millimetre is lost and a local origin is used."""
GRID = 100.0

LocalOrigin = tuple[float, float]


def local_origin(x: float, y: float) -> LocalOrigin:
    """Return the drawing's own origin, or for far coordinates a round point near (x, y)."""
    if max(abs(x), abs(y)) <= FAR:
        return (0.0, 0.0)
    return (round(x / GRID) * GRID, round(y / GRID) * GRID)


def mission_origin(mission: Mission) -> LocalOrigin:
    """Return the local origin of every recording of this mission, so that they overlay."""
    return local_origin(mission.start.x, mission.start.y)


def on_screen(points: float) -> float:
    """Return a radius in points of the screen at any zoom; Rerun takes negative radii as points."""
    return -points


@dataclass(frozen=True)
class Canvas:
    """Open recording that drawing functions write to; positions are in the drawing's metres."""

    stream: rr.RecordingStream
    origin: LocalOrigin
    drawn: rr.BinaryStream
    counts: Counter[str] = field(default_factory=Counter)
    """Rows drawn so far, by entity."""

    def drain(self) -> bytes:
        """Return the bytes drawn since the last call, as a recording in Rerun's format."""
        return self.drawn.read() or b""

    def local(self, xy: FloatArray) -> NDArray[Any]:
        """Return points (…, 2) relative to the local origin, as Rerun stores them."""
        return (np.asarray(xy, dtype=np.float64) - self.origin).astype(np.float32)

    def strips(self, strips: Iterable[FloatArray]) -> Sequence[NDArray[Any]] | NDArray[Any]:
        """Return line strips relative to the local origin; as one array if they are: Rerun takes it whole."""
        if isinstance(strips, np.ndarray):
            return self.local(strips)
        parts = list(strips)
        ends = np.cumsum([len(part) for part in parts]).tolist()
        points = self.local(np.concatenate(parts)) if parts else None
        return [] if points is None else [points[a:b] for a, b in pairwise([0, *ends])]

    def show(self, entity: str, *archetypes: Any) -> None:
        """Draw a static row: it is visible at every time of every timeline."""
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
        """Draw a row at the given times, at least one: Rerun makes a row without a time static."""
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
        """Draw from a planning step on, and always on the other timelines of a plan.

        With `planning_only` not on mission time, where only the result of planning is visible.
        """
        mission_s = None if planning_only else 0.0
        for archetype in archetypes:
            self.at(entity, archetype, step=step, candidate=0, stop=1, mission_s=mission_s)

    def copy_chunk(self, chunk: Chunk) -> None:
        """Copy rows of another recording that has the same local origin."""
        entity = str(chunk.entity_path)
        self.counts[entity] += 0 if chunk.is_static else chunk.num_rows
        self.counts[entity] = max(1, self.counts[entity])
        self.stream.send_chunks([chunk])

    def say(self, text: str, *, level: str = "INFO", step: int = 0) -> None:
        """Write one line of the plan's log, at this planning step and at the mission's start."""
        self.at(entities.LOG_PLAN, rr.TextLog(text, level=level), step=step, mission_s=0.0)

    def describe(self, name: str, values: dict[str, Any]) -> None:
        """Write a property of the recording; a value must have one type in all recordings."""
        self.stream.send_property(name, rr.DynamicArchetype(name, components=values))

    def columns(self, entity: str, index: rr.TimeColumn | Sequence[rr.TimeColumn], *groups: Any) -> None:
        """Draw many rows at once, one per time of `index`, which may be on several timelines."""
        indexes = [index] if isinstance(index, rr.TimeColumn) else list(index)
        self.counts[entity] += len(indexes[0].times)
        self.stream.send_columns(entity, indexes=indexes, columns=[c for group in groups for c in group])


@dataclass(frozen=True)
class KeepingCanvas(Canvas):
    """A canvas that keeps what is drawn by `show`, `at` and `columns`, for canvases of the same origin."""

    kept: list[Callable[[Canvas], None]] = field(default_factory=list)

    @classmethod
    def of(cls, canvas: Canvas) -> KeepingCanvas:
        """Return a canvas that draws into the recording of another."""
        return cls(canvas.stream, canvas.origin, canvas.drawn, canvas.counts)

    def show(self, entity: str, *archetypes: Any) -> None:
        """Draw a static row, and keep it."""
        self.kept.append(lambda canvas: canvas.show(entity, *archetypes))
        super().show(entity, *archetypes)

    def at(self, entity: str, archetype: Any, **times: Any) -> None:
        """Draw a row at the given times, and keep it."""
        self.kept.append(lambda canvas: canvas.at(entity, archetype, **times))
        super().at(entity, archetype, **times)

    def columns(self, entity: str, index: rr.TimeColumn | Sequence[rr.TimeColumn], *groups: Any) -> None:
        """Draw many rows at once, and keep them."""
        self.kept.append(lambda canvas: canvas.columns(entity, index, *groups))
        super().columns(entity, index, *groups)


def arrow_of_lines(lines: NDArray[Any]) -> pa.Array:
    """Return lines (k, 2, 2) as Rerun stores strips; it would look at each line by itself."""
    kind = rr.components.LineStrip2DBatch(np.zeros((1, 2, 2), dtype=np.float32)).as_arrow_array().type
    points = pa.FixedSizeListArray.from_arrays(pa.array(lines.ravel(), pa.float32()), type=kind.value_type)
    ends = pa.array(np.arange(0, 2 * len(lines) + 1, 2), pa.int32())
    return pa.ListArray.from_arrays(ends, points, type=kind)


def arrow_of_classes(rows: Iterable[tuple[int, str, Sequence[int]]]) -> pa.Array:
    """Return classes as Rerun stores them; to convert them it would load 35 ms of Arrow."""
    kind = rr.components.AnnotationContextBatch(None).as_arrow_array().type
    without = {"keypoint_annotations": [], "keypoint_connections": []}
    infos = [
        {"id": number, "label": label, "color": int.from_bytes(colour, "big")}
        for number, label, colour in rows
    ]
    classes = [{"class_id": info["id"], "class_description": {"info": info, **without}} for info in infos]
    return pa.array([classes], kind)


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """Identity and extent of a recording, known before anything is drawn."""

    recording_id: str
    name: str
    origin: LocalOrigin
    extent: Bounds
    """Visible area of 2D views, in the drawing's metres."""
    runs: tuple[str, ...] = ()
    """Runs that are shown together, each with its own colour and report."""

    @property
    def local_extent(self) -> Bounds:
        x, y = self.origin
        return (self.extent[0] - x, self.extent[1] - y, self.extent[2] - x, self.extent[3] - y)


@contextmanager
def open_canvas(sheet: Sheet, *, port: int | None = None) -> Iterator[Canvas]:
    """Open a recording in memory, with the blueprint that all recordings share.

    The caller writes the bytes to a file: Rerun's own writer runs in a thread, and may block forever when the
    disk is full. With a port, viewers on this machine can follow the drawing there. Until the canvas is
    closed, all data stays in memory for viewers that connect later.
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
    """Return the blueprint of a recording, in Rerun's format."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "layout.rbl")
        blueprint(sheet.local_extent, sheet.runs).save(entities.APPLICATION, path)
        return path.read_bytes()


def _prepare(canvas: Canvas) -> None:
    """Draw the flip that makes 2D views y-up, and the classes."""
    flip = rr.Transform3D(scale=[1, -1, 1])
    canvas.show(entities.PLAN, flip)
    canvas.show(entities.FIELD, flip)
    canvas.show(entities.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    canvas.show(entities.ROOT, rr.AnnotationContext(arrow_of_classes(palette.class_rows())))
