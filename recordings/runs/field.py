"""A run as a recording: what the robot tells while it drives a mission, beside what was planned."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

from stopgo.mission.comparing.run_collector import track_of
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import must_be_writable
from stopgo.mission.run.events import (
    Aborted,
    AnyEvent,
    Finished,
    Health,
    PoseReport,
    PosesMissing,
    Report,
    StateReport,
)
from stopgo.recordings.drawing.canvas import Canvas, Sheet, mission_origin, open_canvas
from stopgo.recordings.embedded.checking import carry_end
from stopgo.recordings.embedded.missions import carry_mission
from stopgo.recordings.embedded.plan import carry_plan, planned_extent
from stopgo.recordings.embedded.reading import Recording
from stopgo.recordings.plan.mission import draw_mission, mission_extent
from stopgo.recordings.rrd.compact import compact
from stopgo.recordings.rrd.segment_file import Pieces
from stopgo.recordings.runs.drawing import RunDrawing

Taken = Report | Health | PosesMissing
"""What is drawn of a run."""
MOST_POSES = 1000
"""Poses that wait to be drawn together; a state comes each second and lets them be drawn."""


class FieldRecording:
    """Draws the runs of one mission as they are told; leaving the block, however, closes the file.

    A field run cannot be repeated, so what was told is kept: it is written to `NAME.partial.rrd`, which
    `rerun` opens too and which remains when the writer is killed, and gets its name when it is closed.
    On a full disk the run goes on: what finds no room waits in memory, which `say` is told once; what has
    found none at the end is lost, and the file keeps its partial name.
    With the recording of its plan, it shows the floor and carries what the stops see.
    Reports wait for the mission, because it gives the recording id and the local origin; reports of no
    run are left out, as is everything when no mission came. What is told of a new revision waits for that
    too: the plan stays as it was drawn first, and each run shows what revisions changed, when they did.
    """

    def __init__(
        self,
        path: Path,
        mission: Mission | None = None,
        *,
        plan: Recording | None = None,
        say: Callable[[str], None] = lambda line: None,
    ) -> None:
        self.path = path
        self._say = say
        self._waiting: list[Taken] = []
        self._poses: list[PoseReport] = []
        self._told_end = False
        self._runs: dict[str, RunDrawing] = {}
        self._first: Mission | None = None
        self._newest: Mission | None = None
        self._canvas: Canvas | None = None
        self._pieces: Pieces | None = None
        self._port: int | None = None
        self._given = mission
        self._plan = plan
        self._open = ExitStack()

    def __enter__(self) -> FieldRecording:
        must_be_writable(self.path)
        if self._given is not None:
            self.mission(self._given)
        return self

    def serve(self, port: int) -> None:
        """Let viewers of this machine follow the recording at a port, once it has begun."""
        self._port = port

    def mission(self, mission: Mission) -> None:
        """Take the mission that is driven, or a new revision of it."""
        if self._first is not None and self._first.id != mission.id:
            raise InputError(
                f"{self.path}: is of mission {self._first.id}, not {mission.id}: use another file"
            )
        if self._first is None:
            self._first = mission
            self._begin(mission)
        elif self._newest is not None and mission.revision != self._newest.revision:
            carry_mission(self.canvas, mission)
        self._newest = mission
        waiting, self._waiting = self._waiting, []
        for report in waiting:
            self._take(report)

    def state(self, report: StateReport) -> None:
        """Take a snapshot of the robot's state."""
        self._take(report)
        self._save()

    def pose(self, report: PoseReport) -> None:
        """Take a pose of the robot."""
        self._take(report)

    def health(self, told: Health) -> None:
        """Take how the robot's base was."""
        self._take(told)

    def missing(self, gap: PosesMissing) -> None:
        """Take that nobody knows where the robot was for a time: no path is drawn through it."""
        self._take(gap)

    def event(self, event: AnyEvent) -> None:
        """Take a line of the robot's journal; what was told before it is on disk then."""
        self._take(event)
        self._told_end = isinstance(event, Finished | Aborted) and not self._waiting
        if self._told_end and event.run_id in self._runs:
            self._runs[event.run_id].measure()
        if self._told_end:  # now and not when it is closed: the disk may be full then
            carry_end(self.canvas)
        self._save()

    @property
    def canvas(self) -> Canvas:
        assert self._canvas is not None
        return self._canvas

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._canvas is not None:
            for report in self._waiting:
                self._draw(report)
            self._draw_poses()
            for run in self._runs.values():
                run.measure()
            if not self._told_end:
                carry_end(self._canvas)
            self._save()
        self._open.close()
        fault = None if self._pieces is None else self._closed(self._pieces)
        if fault is not None and error is None:
            raise InputError(fault)
        if fault is not None:  # what ended the run is told as well, and decides how the command ends
            self._say(fault)

    def _closed(self, pieces: Pieces) -> str | None:
        """Give the file its name; what is wrong with it, if it cannot have it."""
        pieces.close()
        if pieces.fault is not None:
            kept = f"what could be is in {pieces.path}" if pieces.path.exists() else "nothing is kept"
            return f"{self.path}: could not be written whole ({pieces.fault}); {kept}"
        try:
            compact(pieces.path, self.path)
        except InputError as error:
            return str(error)
        return None

    def _save(self) -> None:
        """Hand over to the disk what was drawn."""
        if self._canvas is not None and self._pieces is not None:
            self._pieces.add(self._canvas.taken())

    def _begin(self, mission: Mission) -> None:
        self._pieces = Pieces(_free_name(self.path), self._say)
        sheet = Sheet(
            recording_id=mission.id,
            name=mission.name,
            origin=mission_origin(mission),
            extent=planned_extent(self._plan) or mission_extent(mission),
        )
        self._canvas = self._open.enter_context(open_canvas(sheet, port=self._port))
        draw_mission(self._canvas, mission)
        carry_mission(self._canvas, mission)
        if self._plan is not None:
            carry_plan(self._canvas, self._plan, mission)
        self._save()

    def _take(self, report: Taken) -> None:
        """Draw the report, or let it and all after it wait for the mission it is told of."""
        if self._newest is None or self._waiting or _revision(report) > self._newest.revision:
            self._waiting.append(report)
        else:
            self._draw(report)

    def _draw(self, report: Taken) -> None:
        """Draw a report; poses wait for others, and are drawn before what is told after them."""
        assert self._newest is not None
        if report.run_id is None:
            return
        run = self._runs.get(report.run_id) or self._start(report.run_id)
        if isinstance(report, PoseReport):
            self._poses.append(report)
            if len(self._poses) >= MOST_POSES:
                self._draw_poses()
            return
        self._draw_poses()
        if run.mission.revision < min(_revision(report), self._newest.revision):
            run.follow(self._newest, report)
        _DRAW[type(report)](run, report)

    def _draw_poses(self) -> None:
        """Draw the poses that wait, run by run."""
        poses, self._poses = self._poses, []
        for run_id in dict.fromkeys(item.run_id for item in poses):
            mine = [item for item in poses if item.run_id == run_id]
            run = self._runs[str(run_id)]
            run.tell_time(mine[-1])
            run.poses(track_of(mine))

    def _start(self, run_id: str) -> RunDrawing:
        assert self._first is not None
        sights = () if self._plan is None or self._plan.mission_id != self._first.id else self._plan.sights
        self._runs[run_id] = RunDrawing(self.canvas, run_id, self._first, sights)
        return self._runs[run_id]


def _revision(report: Taken) -> int:
    """The revision that a report is told of; poses are of any."""
    return getattr(report, "revision", None) or 0


class _Draw(dict[type, Callable[[RunDrawing, Any], None]]):
    """How each report is drawn; what has no line here is an event; poses are drawn together."""

    def __missing__(self, kind: type) -> Callable[[RunDrawing, Any], None]:
        return RunDrawing.event


_DRAW = _Draw({StateReport: RunDrawing.state, Health: RunDrawing.health, PosesMissing: RunDrawing.missing})


def _free_name(path: Path) -> Path:
    """A name beside `path` that is not taken: a partial file of a run before is not overwritten."""
    partial = path.with_name(f"{path.stem}.partial.rrd")
    number = 2
    while partial.exists():
        partial = path.with_name(f"{path.stem}.partial-{number}.rrd")
        number += 1
    return partial
