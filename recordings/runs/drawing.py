"""One run as it is drawn: pose and driven path, events at stops, state, battery, distance from the route."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import rerun as rr

from mission.document import Mission, Stop
from mission.events import (
    AnyEvent,
    Arrived,
    Failed,
    Pose,
    PoseReport,
    Scanned,
    Skipped,
    StateReport,
)
from mission.geometry import FloatArray
from recordings import entities, palette, strokes
from recordings.canvas import Canvas, on_screen
from recordings.entities import of_run
from recordings.pens import ORDER
from recordings.robot import draw_robot, quaternions
from recordings.runs.cross_track import cross_track
from recordings.runs.report import StopRecord, run_report
from recordings.stages.mission import ABOVE_FLOOR

PIECE_M = 0.05
"""The driven path grows by pieces of at least this length, each a row of its own."""
SAME_M, SAME_RAD, SAME_S = 0.001, math.radians(0.1), 1.0
"""A pose this near to the last one is left out, but for one each second."""
MARKS = {Arrived: palette.ARRIVED, Scanned: palette.SCANNED, Skipped: palette.SKIPPED, Failed: palette.FAILED}


class RunDrawing:
    """The entities of one run id on a canvas; grows as the robot tells more."""

    def __init__(self, canvas: Canvas, run_id: str, mission: Mission) -> None:
        self.canvas = canvas
        self.run_id = run_id
        self.mission = mission
        self.stops = {stop.id: stop for stop in mission.stops}
        self.records: dict[str, StopRecord] = {}
        self._began_ns: int | None = None
        self._last: PoseReport | None = None
        self._drawn: Pose | None = None
        self._towards: Stop | None = None
        self._prepare()

    def pose(self, report: PoseReport) -> None:
        """Move the robot, lengthen its path, and measure its distance from the leg it drives."""
        if report.mission_time_s is not None:
            self._began_ns = report.robot_ns - round(report.mission_time_s * 1e9)
        if self._last is not None and _same(self._last, report):
            return
        self._last = report
        pose = report.pose
        place = self.canvas.local(np.array([pose.x, pose.y]))
        turn = quaternions(np.array(pose.heading))
        for robot in (self._flat("robot"), self._solid("robot")):
            moved = rr.Transform3D(translation=[*place, 0.0], quaternion=rr.Quaternion(xyzw=turn))
            self._at(robot, moved, report.robot_ns)
        self._lengthen(pose, report.robot_ns)
        self._measure(pose, report.robot_ns)

    def state(self, report: StateReport) -> None:
        """Put the robot's and the stop's state on their lanes, and the battery on its plot."""
        self._towards = self.stops.get(report.stop or "")
        self._at(self._flat("state"), rr.StateChange(state=report.state), report.robot_ns)
        stop_state = "" if report.stop_state is None else report.stop_state
        self._at(self._flat("stop_state"), rr.StateChange(state=stop_state), report.robot_ns)
        self._at(self._flat("stop"), rr.StateChange(state=report.stop or ""), report.robot_ns)
        self._at(self._metric(entities.METRIC_BATTERY), rr.Scalars(report.battery * 100), report.robot_ns)

    def event(self, event: AnyEvent) -> None:
        """Write the event down whole, mark it on the plan, and bring the report up to date."""
        self._began_ns = event.robot_ns - round(event.mission_time_s * 1e9)
        told = {name: value for name, value in msgspec.to_builtins(event).items() if name in EVENT_FIELDS}
        self._at(
            entities.events_of_run(self.run_id), rr.DynamicArchetype("Event", components=told), event.robot_ns
        )
        level = "WARN" if isinstance(event, Skipped | Failed) else "INFO"
        line = rr.TextLog(f"{type(event).__name__} {_about(event)}".rstrip(), level=level)
        self._at(of_run(entities.LOG_FIELD, self.run_id), line, event.robot_ns)
        if isinstance(event, Arrived):
            self._plot_deviation(event)
        self._mark(event)
        self._report(event)

    def _prepare(self) -> None:
        """What stays the same for the whole run: shapes, styles, and what the run is of."""
        canvas, radius = self.canvas, self.mission.robot.radius
        draw_robot(canvas, self._flat("robot"), self._solid("robot"), radius, palette.DRIVEN)
        states = rr.StateConfiguration(
            values=list(palette.STATE_COLOURS), colors=list(palette.STATE_COLOURS.values())
        )
        for lane in ("state", "stop_state"):
            canvas.show(self._flat(lane), states)
        for metric, name in _NAMES.items():
            line = rr.SeriesLines(colors=palette.DRIVEN, names=name, widths=1.5)
            canvas.show(self._metric(metric), line)
        dots = rr.SeriesPoints(
            colors=palette.ARRIVED.colour, markers="circle", marker_sizes=4, names="deviation"
        )
        canvas.show(self._metric(entities.METRIC_DEVIATION), dots)
        limit = rr.SeriesLines(colors=palette.FAILED.colour, names="tolerance", widths=1)
        canvas.show(self._metric(entities.METRIC_DEVIATION, "tolerance"), limit)
        about = {
            "run_id": self.run_id,
            "mission_id": self.mission.id,
            "mission_name": self.mission.name,
            "revision": self.mission.revision,
            "digest": self.mission.digest,
            "planned_stops": len(self.mission.stops),
            "local_origin": list(canvas.origin),
        }
        canvas.describe(entities.PROPERTY_RUN, about)

    def _lengthen(self, pose: Pose, robot_ns: int) -> None:
        """Add the piece from the last drawn pose, once it is long enough to be seen."""
        before, self._drawn = self._drawn or pose, self._drawn or pose
        if math.dist((before.x, before.y), (pose.x, pose.y)) < PIECE_M:
            return
        piece = self.canvas.local(np.array([(before.x, before.y), (pose.x, pose.y)]))
        flat = rr.LineStrips2D(
            [piece], colors=palette.DRIVEN, radii=on_screen(1.5), draw_order=ORDER["robot"]
        )
        raised = strokes.level(piece, 2 * ABOVE_FLOOR)
        self._at(self._flat("driven"), flat, robot_ns)
        self._at(
            self._solid("driven"), rr.LineStrips3D([raised], colors=palette.DRIVEN, radii=0.03), robot_ns
        )
        self._drawn = pose

    def _measure(self, pose: Pose, robot_ns: int) -> None:
        legs = [self._towards] if self._towards is not None else list(self.mission.stops)
        ways: list[FloatArray] = [np.array(stop.approach) for stop in legs if len(stop.approach) > 1]
        if ways:
            distance = cross_track(ways, x=pose.x, y=pose.y)
            self._at(self._metric(entities.METRIC_CROSS_TRACK), rr.Scalars(distance * 1000), robot_ns)

    def _mark(self, event: AnyEvent) -> None:
        meaning = MARKS.get(type(event))
        stop = self.stops.get(getattr(event, "stop", ""))
        if meaning is None or stop is None:
            return
        place = getattr(event, "pose", None) or stop
        label = f"{stop.id}: {_about(event)}" if isinstance(event, Arrived) else ""
        mark = rr.Points2D(
            [self.canvas.local(np.array([place.x, place.y]))],
            class_ids=meaning.number,
            radii=on_screen(3),
            labels=[label] if label else None,
            show_labels=False,
            draw_order=ORDER["robot"] + (isinstance(event, Scanned) * 0.5),
        )
        self._at(self._flat(meaning.label), mark, event.robot_ns)

    def _plot_deviation(self, event: Arrived) -> None:
        """The deviation in millimetres, and what the mission tolerates there."""
        deviation = rr.Scalars(event.deviation_m * 1000)
        self._at(self._metric(entities.METRIC_DEVIATION), deviation, event.robot_ns)
        stop = self.stops.get(event.stop)
        if stop is not None:
            tolerance = rr.Scalars(stop.tolerance_m * 1000)
            self._at(self._metric(entities.METRIC_DEVIATION, "tolerance"), tolerance, event.robot_ns)

    def _report(self, event: AnyEvent) -> None:
        stop = getattr(event, "stop", None)
        if stop is not None:
            self.records[stop] = self.records.get(stop, StopRecord()).after(event)
        text = run_report(self.mission, self.run_id, self.records, event)
        document = rr.TextDocument(text, media_type="text/markdown")
        self._at(self._flat("report"), document, event.robot_ns)

    def _at(self, entity: str, archetype: object, robot_ns: int) -> None:
        """At the robot's time, and at mission time once it is known when the mission began."""
        mission_s = None if self._began_ns is None else (robot_ns - self._began_ns) / 1e9
        self.canvas.at(entity, archetype, mission_s=mission_s, robot_ns=robot_ns)

    def _flat(self, name: str) -> str:
        return of_run(entities.FIELD, self.run_id, name)

    def _solid(self, name: str) -> str:
        return of_run(entities.WORLD_FIELD, self.run_id, name)

    def _metric(self, metric: str, *names: str) -> str:
        return of_run(metric, self.run_id, *names)


EVENT_FIELDS = (
    *("event", "number", "stop", "reason", "deviation_m", "commander"),
    *("file", "size", "sha256", "points"),
)
"""What is kept of an event as values, each of one type in all events."""

_NAMES = {
    entities.METRIC_CROSS_TRACK: "distance from the route",
    entities.METRIC_BATTERY: "battery",
}


def _same(a: PoseReport, b: PoseReport) -> bool:
    moved = math.dist((a.pose.x, a.pose.y), (b.pose.x, b.pose.y))
    turned = abs(math.remainder(a.pose.heading - b.pose.heading, math.tau))
    return moved < SAME_M and turned < SAME_RAD and b.robot_ns - a.robot_ns < SAME_S * 1e9


def _about(event: AnyEvent) -> str:
    """The event's particulars in a few words."""
    words = [getattr(event, name, "") for name in ("stop", "reason", "commander")]
    if isinstance(event, Arrived):
        words.append(f"{event.deviation_m * 1000:.0f} mm beside")
    if isinstance(event, Scanned):
        words.append(f"{event.file}, {event.points} points")
    return " ".join(word for word in words if word)
