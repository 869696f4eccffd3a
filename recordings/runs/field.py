"""Field recording: the robot's reports while it drives a mission, next to what was planned."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from secrets import token_hex
from types import TracebackType
from typing import Any

from stopgo.mission.comparing.run_collector import track_of
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import must_be_writable
from stopgo.mission.run.events import (
    Aborted,
    AnyEvent,
    Event,
    Finished,
    Health,
    PoseReport,
    PosesMissing,
    Report,
    ReportsMissing,
    StateReport,
)
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas, Sheet, mission_origin, open_canvas
from stopgo.recordings.embedded.checking import embed_end
from stopgo.recordings.embedded.missions import embed_mission
from stopgo.recordings.embedded.plan import embed_plan, planned_extent
from stopgo.recordings.embedded.reading import Recording
from stopgo.recordings.plan.mission import draw_mission, mission_extent
from stopgo.recordings.rrd.compact import compact
from stopgo.recordings.rrd.segment_file import SegmentFile
from stopgo.recordings.runs.drawing import RunDrawing
from stopgo.recordings.runs.stop_results import draw_stop_results

DrawnReport = Report | Health | PosesMissing | ReportsMissing
"""Reports of a run that are drawn."""
MOST_COLLECTED = 1000
"""Most poses and states that are collected, to be drawn together."""
COLLECTED_NS = 30 * 10**9
"""Most time of the robot over which they are collected.

Events draw what is collected, and each state where a viewer follows. What a killed writer has not drawn is
still in the robot's record of its run.
"""


class FieldRecording:
    """Draws the runs of one mission as reports arrive; leaving the block always closes the file.

    A field run cannot be repeated, so received reports are saved. They are written to `NAME.partial.rrd`,
    which `rerun` opens too and which remains when the writer is killed. The file gets its name when it is
    closed.

    If the disk is full, the run continues: data that finds no room waits in memory, and `say` reports it
    once. Data that still finds no room at the end is lost, and the file keeps its partial name.

    With the recording of its plan, it also contains the floor and what the stops see.

    Reports wait for the mission, which gives the local origin. The file begins with the first report of a
    run, which gives the recording id; while a viewer follows, it begins with the mission. Reports without a
    run are left out, as are all reports if no mission comes. Reports of a new revision wait for it: the plan
    stays as it was drawn first, and each run shows the changes of a revision at their time.
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
        self._waiting: list[DrawnReport] = []
        self._collected: list[PoseReport | StateReport] = []
        """Reports of one run and boot that are drawn next."""
        self._events: dict[str, dict[int, AnyEvent]] = {}
        """Events of each run by their number, until its results are written."""
        self._end_written = False
        self._runs: dict[str, RunDrawing] = {}
        self._first: Mission | None = None
        self._newest: Mission | None = None
        self._revisions: dict[int, Mission] = {}
        self._canvas: Canvas | None = None
        self._segments: SegmentFile | None = None
        self._port: int | None = None
        self._initial_mission = mission
        self._plan = plan
        self._open = ExitStack()
        self._replaces = False
        """True if a file was at the path at the begin."""

    def __enter__(self) -> FieldRecording:
        must_be_writable(self.path)
        self._replaces = self.path.exists()
        if self._initial_mission is not None:
            self.mission(self._initial_mission)
        return self

    def serve(self, port: int) -> None:
        """Let viewers of this machine follow the recording at a port, once it has begun."""
        self._port = port

    def mission(self, mission: Mission) -> None:
        """Add the driven mission, or a new revision of it."""
        if self._first is not None and self._first.id != mission.id:
            raise InputError(
                f"{self.path}: is of mission {self._first.id}, not {mission.id}; use another file"
            )
        if self._first is None:
            self._first = mission
            if self._port is not None:
                self._begin(mission, token_hex(6))
        elif self._canvas is not None and self._newest and mission.revision != self._newest.revision:
            embed_mission(self._canvas, mission)
        self._revisions[mission.revision] = mission
        self._newest = mission
        waiting, self._waiting = self._waiting, []
        for report in waiting:
            self._accept(report)

    def state(self, report: StateReport) -> None:
        """Draw a snapshot of the robot's state, at once where a viewer follows or the run has ended."""
        self._accept(report)
        if self._port is not None or self._end_written:
            self._draw_collected()
            self._save()

    def pose(self, report: PoseReport) -> None:
        """Draw a pose of the robot."""
        self._accept(report)

    def health(self, health: Health) -> None:
        """Draw the health of the robot's base."""
        self._accept(health)

    def missing(self, gap: PosesMissing) -> None:
        """Draw a gap in the poses: no path is drawn through it."""
        self._accept(gap)

    def incomplete(self, report: ReportsMissing) -> None:
        """Log that topics of the robot do not arrive, with the age of its newest state."""
        if report.changed:
            self._accept(report)
            self._save()

    def event(self, event: AnyEvent) -> None:
        """Draw an event of the robot's journal; afterwards, all earlier reports are on disk."""
        self._accept(event)
        self._end_written = isinstance(event, Finished | Aborted) and not self._waiting
        if self._end_written and event.run_id in self._runs:
            self._runs[event.run_id].measure()
            self._draw_results(event.run_id)
        if self._end_written:  # now, because the disk may be full when the file is closed
            embed_end(self.canvas)
        self._save()

    @property
    def canvas(self) -> Canvas:
        assert self._canvas is not None
        return self._canvas

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._first is not None:
            for report in self._waiting:
                self._draw(report)
            self._draw_collected()
            if self._canvas is None:
                self._begin(self._first)
            assert self._canvas is not None
            for run_id, run in self._runs.items():
                run.measure()
                self._draw_results(run_id)
            if not self._end_written:
                embed_end(self._canvas)
            self._save()
        self._open.close()
        fault = None if self._segments is None else self._finish_file(self._segments)
        if fault is not None and error is None:
            raise InputError(fault)
        if fault is not None:  # the error that ended the run decides the exit code
            self._say(fault)

    def _finish_file(self, segments: SegmentFile) -> str | None:
        """Give the file its final name; return the reason if that is not possible."""
        segments.close()
        if segments.fault is not None:
            saved = (
                f"the saved part is in {segments.path}"
                if segments.path.exists()
                else "the file was not saved"
            )
            return f"{self.path}: could not be written completely ({segments.fault}); {saved}"
        try:
            compact(segments.path, self.path)
        except (InputError, FileNotFoundError) as error:
            if self.path.exists() and not self._replaces and not segments.path.exists():
                return None  # another recorder of this run has saved it, and removed what was left
            return str(error)
        return None

    def _save(self) -> None:
        """Write the new drawings to disk."""
        if self._canvas is not None and self._segments is not None:
            self._segments.add(self._canvas.drain())

    def _begin(self, mission: Mission, run_id: str = "") -> None:
        """Open the file; it has the id of its first run, so that a catalog holds the runs side by side."""
        self._segments = SegmentFile(self.path.with_name(f"{self.path.stem}.partial"), self._say)
        sheet = Sheet(
            recording_id=entities.recording_id(mission.id, run_id),
            name=mission.name,
            origin=mission_origin(mission),
            extent=planned_extent(self._plan) or mission_extent(mission),
        )
        self._canvas = self._open.enter_context(open_canvas(sheet, port=self._port))
        draw_mission(self._canvas, mission)
        for revision in (self._revisions or {mission.revision: mission}).values():
            embed_mission(self._canvas, revision)
        if self._plan is not None:
            embed_plan(self._canvas, self._plan, mission)
        self._save()

    def _accept(self, report: DrawnReport) -> None:
        """Draw the report, or queue it and all later ones until their revision arrives."""
        if self._newest is None or self._waiting or _revision(report) > self._newest.revision:
            self._waiting.append(report)
        else:
            self._draw(report)

    def _draw(self, report: DrawnReport) -> None:
        """Draw a report; poses and states are collected, and drawn before the next report of another kind."""
        assert self._newest is not None
        if report.run_id is None:
            return
        run = self._runs.get(report.run_id) or self._start(report.run_id)
        is_collected = isinstance(report, PoseReport | StateReport)
        is_revised = run.mission.revision < min(_revision(report), self._newest.revision)
        if is_revised or not is_collected:
            self._draw_collected()
        if is_revised:
            run.follow(self._newest, report)
        if is_collected:
            self._collect(report)
            return
        if isinstance(report, Event):
            self._events.setdefault(report.run_id, {})[report.number] = report
        _DRAW[type(report)](run, report)

    def _collect(self, report: PoseReport | StateReport) -> None:
        """Collect a report; those before it are drawn and saved first if it does not go with them."""
        if self._collected and not self._goes_with_collected(report):
            self._draw_collected()
            self._save()
        self._collected.append(report)

    def _goes_with_collected(self, report: PoseReport | StateReport) -> bool:
        """True if a report is of the run and boot that the collected ones are of, and soon after them."""
        first, is_full = self._collected[0], len(self._collected) >= MOST_COLLECTED
        is_alike = (report.run_id, report.boot_id) == (first.run_id, first.boot_id)
        return is_alike and not is_full and abs(report.robot_ns - first.robot_ns) <= COLLECTED_NS

    def _draw_collected(self) -> None:
        """Draw the collected poses and states."""
        collected, self._collected = self._collected, []
        if not collected:
            return
        run = self._runs[str(collected[0].run_id)]
        poses = [item for item in collected if isinstance(item, PoseReport)]
        if poses:
            run.read_start_time(poses[-1])
            run.poses(track_of(poses), poses[0].boot_id)
        run.states([item for item in collected if isinstance(item, StateReport)])

    def _draw_results(self, run_id: str) -> None:
        """Write the results of a run's stops once, when it has ended or the file is closed."""
        events = self._events.pop(run_id, {})
        if events:
            ordered = [events[number] for number in sorted(events)]
            draw_stop_results(self.canvas, ordered, list(self._revisions.values()))

    def _start(self, run_id: str) -> RunDrawing:
        assert self._first is not None
        if self._canvas is None:
            self._begin(self._first, run_id)
        sights = () if self._plan is None or self._plan.mission_id != self._first.id else self._plan.sights
        self._runs[run_id] = RunDrawing(self.canvas, run_id, self._first, sights)
        return self._runs[run_id]


def _revision(report: DrawnReport) -> int:
    """Return the revision of a report; poses have none."""
    return getattr(report, "revision", None) or 0


class _Draw(dict[type, Callable[[RunDrawing, Any], None]]):
    """Method for each type of report that is drawn alone; types not listed are events."""

    def __missing__(self, kind: type) -> Callable[[RunDrawing, Any], None]:
        return RunDrawing.event


_DRAW = _Draw(
    {
        Health: RunDrawing.health,
        PosesMissing: RunDrawing.missing,
        ReportsMissing: RunDrawing.incomplete,
    }
)
