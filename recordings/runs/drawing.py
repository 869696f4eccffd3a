"""One run as it is drawn: pose and driven path, events at stops, state, battery, distance from the route."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import msgspec
import numpy as np
import rerun as rr

from stopgo.mission.comparing.delayed_deviation import DelayedDeviation
from stopgo.mission.document import Mission, Stop
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.run.events import (
    Aborted,
    AnyEvent,
    Arrived,
    Failed,
    Health,
    Held,
    LinkLost,
    PoseReport,
    PosesMissing,
    RevisionDropped,
    RevisionTaken,
    RevisionWaits,
    Scanned,
    Skipped,
    StateReport,
    Unconfirmed,
)
from stopgo.mission.run.run_log import Track
from stopgo.mission.run.tolerance import deviation, outside_tolerance_text
from stopgo.mission.stages.sight import Sight
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.canvas import Canvas, on_screen
from stopgo.recordings.drawing.pens import ORDER, Pen, style
from stopgo.recordings.drawing.robot import Draw, draw_robot, quaternions
from stopgo.recordings.plan.mission import ABOVE_FLOOR, state_colours
from stopgo.recordings.runs.acquired_drawing import AcquiredDrawing
from stopgo.recordings.runs.report import StopRecord, run_report
from stopgo.recordings.runs.revision import change_between, draw_change
from stopgo.recordings.runs.trail import Thinner, Trail

SOLID_S = 0.5
"""How often the robot moves in 3D."""
WARNINGS = (Skipped, Failed, Unconfirmed, Held, LinkLost, Aborted)
"""Events that somebody should look at."""
MARKS = {
    Arrived: (entities.ARRIVED, palette.ARRIVED, ORDER["arrival"]),
    Scanned: (entities.SCANNED, palette.SCANNED, ORDER["scan"]),
    Skipped: (entities.SKIPPED, palette.SKIPPED, ORDER["scan"]),
    Failed: (entities.FAILED, palette.FAILED, ORDER["scan"]),
}
"""Where, as what, and above what an event is marked on the plan."""


class RunDrawing:
    """The entities of one run id on a canvas; grows as the robot tells more."""

    def __init__(self, canvas: Canvas, run_id: str, mission: Mission, sights: Sequence[Sight] = ()) -> None:
        self.canvas = canvas
        self.run_id = run_id
        self.names = entities.RunEntities(run_id)
        self.mission = mission
        self.revisions = [mission]
        self.stops = {stop.id: stop for stop in mission.stops}
        self.records: dict[str, StopRecord] = {}
        self._began_ns: int | None = None
        self._place: FloatArray | None = None
        self._growth = AcquiredDrawing(sights[-1]) if sights else None
        self._thinner, self._trail, self._way = Thinner(), Trail(), DelayedDeviation(mission)
        self._stops: dict[str, bool | None] = {}
        self._style()
        self._describe()

    def follow(
        self, mission: Mission, report: StateReport | PoseReport | AnyEvent | PosesMissing | Health
    ) -> None:
        """Go on by another revision of the mission from `report` on, and draw what it changes."""
        self.tell_time(report)
        change, names = change_between(self.mission, mission), self.names.revision(mission.revision)
        draw_change(self.canvas, change, names, partial(self._at, robot_ns=report.robot_ns))
        self.mission = mission
        self.revisions.append(mission)
        self.stops = {stop.id: stop for stop in mission.stops}
        self._describe()

    def poses(self, told: Track) -> None:
        """Move the robot, and lengthen its path; what waits for events is plotted by `measure`."""
        poses = self._thinner.thin(told)
        if not len(poses):
            return
        if self._place is None:
            draw = partial(self._at, robot_ns=int(poses.ns[0]))
            robots = (self.names.flat(entities.ROBOT), self.names.solid(entities.ROBOT))
            draw_robot(draw, *robots, radius=self.mission.robot.radius, colour=palette.DRIVEN)
        self._move(poses)
        self._lengthen(poses)
        self._way.poses(poses)
        self._place = poses.xy[-1]

    def state(self, report: StateReport) -> None:
        """Put the robot's and the stop's state on their lanes, and the battery on its plot."""
        if self._way.knows(report.last_event):
            self.measure(report.robot_ns)
        self._at(self.names.flat(entities.STATE), rr.StateChange(state=report.state), report.robot_ns)
        stop_state = "" if report.stop_state is None else report.stop_state
        self._at(self.names.flat(entities.STOP_STATE), rr.StateChange(state=stop_state), report.robot_ns)
        self._at(self.names.flat(entities.STOP), rr.StateChange(state=report.stop or ""), report.robot_ns)
        battery = rr.Scalars(report.battery * 100)
        self._at(self.names.metric(entities.METRIC_BATTERY), battery, report.robot_ns)

    def missing(self, gap: PosesMissing) -> None:
        """Say for how long nobody knows where the robot was; its path ends before that, and begins anew."""
        self.tell_time(gap)
        self._trail.end()
        line = rr.TextLog(gap.words, level="WARN")
        self._at(self.names.log, line, gap.robot_ns)

    def health(self, told: Health) -> None:
        """Keep how the base was, and say what of it stops a robot, when that changes."""
        known = {name: value for name in HEALTH_FIELDS if (value := getattr(told, name)) is not None}
        self._at(self.names.health, rr.DynamicArchetype("Health", components=known), told.robot_ns)
        stops = {name: getattr(told, name) for name in HEALTH_FIELDS[2:]}
        changed = {name for name, value in stops.items() if bool(value) != bool(self._stops.get(name))}
        self._stops = stops
        for name in sorted(changed):
            words = f"{name.replace('_', ' ')}: {'yes' if stops[name] else 'no'}"
            self._at(
                self.names.log, rr.TextLog(words, level="WARN" if stops[name] else "INFO"), told.robot_ns
            )

    def event(self, event: AnyEvent) -> None:
        """Write the event down whole, mark it on the plan, and bring the report up to date."""
        self.tell_time(event)
        self._way.event(event, self.mission)
        told = {name: value for name, value in msgspec.to_builtins(event).items() if name in EVENT_FIELDS}
        told["body"] = msgspec.json.encode(event).decode()
        self._at(self.names.events, rr.DynamicArchetype("Event", components=told), event.robot_ns)
        stop = self.stops.get(getattr(event, "stop", ""))
        beside = outside_tolerance_text(event, stop)
        level = "WARN" if isinstance(event, WARNINGS) or beside else "INFO"
        line = rr.TextLog(f"{type(event).__name__} {_about(event, stop)}".rstrip(), level=level)
        self._at(self.names.log, line, event.robot_ns)
        if isinstance(event, Arrived):
            self._plot_deviation(event.deviation_m, stop, event.robot_ns)
        elif isinstance(event, Scanned) and stop is not None and beside:
            self._plot_deviation(deviation(event.pose, stop), stop, event.robot_ns)
        self._mark(event)
        if self._growth is not None:
            self._growth.tell(event, canvas=self.canvas, names=self.names, draw=self._at_time(event.robot_ns))
        self._report(event)

    def _style(self) -> None:
        """What things look like, which stays the same for the whole run."""
        canvas, names = self.canvas, self.names
        states = state_colours()
        for lane in (entities.STATE, entities.STOP_STATE):
            canvas.show(names.flat(lane), states)
        style(canvas, names.flat(entities.DRIVEN), Pen(palette.DRIVEN, "robot", on_screen(1.5)))
        solid = rr.LineStrips3D.from_fields(colors=palette.DRIVEN, radii=0.03)
        canvas.show(names.solid(entities.DRIVEN), solid)
        for metric, name in _PLOTTED.items():
            canvas.show(names.metric(metric), rr.SeriesLines(colors=palette.DRIVEN, names=name, widths=1.5))
        dots = rr.SeriesPoints(colors=palette.ARRIVED.colour, marker_sizes=4, names="deviation")
        canvas.show(names.metric(entities.METRIC_DEVIATION), dots)
        for metric, limits in _LIMITED.items():
            count = len(limits)
            colours, texts = [palette.FAILED.colour] * count, ["tolerance"] * count
            lines = rr.SeriesLines(colors=colours, names=texts, widths=[1.0] * count)
            canvas.show(names.tolerance(metric), lines)

    def _describe(self) -> None:
        """What the run is of, as a property."""
        about = {
            "run_id": self.run_id,
            "mission_id": self.mission.id,
            "mission_name": self.mission.name,
            "revision": self.mission.revision,
            "digest": self.mission.digest,
            "planned_stops": len(self.mission.stops),
            "local_origin": list(self.canvas.origin),
        }
        self.canvas.describe(entities.PROPERTY_RUN, about)

    def _move(self, poses: Track) -> None:
        """Put the robot at its poses; they are kept whole beside what Rerun draws, which is less exact."""
        turn = quaternions(poses.heading)
        places = strokes.level(self.canvas.local(poses.xy), 0.0)
        told = {"x": poses.xy[:, 0], "y": poses.xy[:, 1], "heading": poses.heading}
        moves = rr.Transform3D.columns(translation=places, quaternion=turn)
        kept = rr.DynamicArchetype.columns(archetype="Pose", components=told)
        self._columns(self.names.flat(entities.ROBOT), poses.ns, moves, kept)
        seldom = self._seldom(poses.ns)
        self._columns(
            self.names.solid(entities.ROBOT),
            poses.ns[seldom],
            rr.Transform3D.columns(translation=places[seldom], quaternion=turn[seldom]),
        )

    def _seldom(self, ns: IntArray) -> IntArray:
        """Indices of poses for 3D: the first, the last, and one each SOLID_S."""
        beat = np.flatnonzero(np.diff(ns // round(SOLID_S * 1e9)) > 0) + 1
        return np.unique(np.concatenate([[0], beat, [len(ns) - 1]]))

    def _lengthen(self, poses: Track) -> None:
        """Add what the robot has driven since it was last told of."""
        ns, strips = self._trail.lengthened(poses)
        if strips:
            flat = self.canvas.strips(strips)
            self._columns(self.names.flat(entities.DRIVEN), ns, rr.LineStrips2D.columns(strips=flat))
            raised = [strokes.level(strip, 2 * ABOVE_FLOOR) for strip in flat]
            self._columns(self.names.solid(entities.DRIVEN), ns, rr.LineStrips3D.columns(strips=raised))

    def measure(self, until_ns: int | None = None) -> None:
        """Plot how far beside the way the robot was; up to a time until which all events are known."""
        ns, beside = self._way.measured(until_ns)
        known = np.isfinite(beside)
        if known.any():
            values = rr.Scalars.columns(scalars=beside[known] * 1000)
            self._columns(self.names.metric(entities.METRIC_CROSS_TRACK), ns[known], values)

    def _mark(self, event: AnyEvent) -> None:
        stop = self.stops.get(getattr(event, "stop", ""))
        if type(event) not in MARKS or stop is None:
            return
        name, meaning, order = MARKS[type(event)]
        place = getattr(event, "pose", None) or stop
        mark = rr.Points2D(
            [self.canvas.local(np.array([place.x, place.y]))],
            class_ids=meaning.number,
            radii=on_screen(3),
            labels=[f"{type(event).__name__} {_about(event, stop)}"],
            show_labels=False,
            draw_order=order,
        )
        self._at(self.names.flat(name), mark, event.robot_ns)

    def _plot_deviation(self, away_m: float, stop: Stop | None, robot_ns: int) -> None:
        """In millimetres, with what the mission tolerates at this stop, to both sides of the route too."""
        self._at(self.names.metric(entities.METRIC_DEVIATION), rr.Scalars(away_m * 1000), robot_ns)
        if stop is not None:
            limit = stop.tolerance_m * 1000
            for metric, limits in _LIMITED.items():
                values = rr.Scalars([sign * limit for sign in limits])
                self._at(self.names.tolerance(metric), values, robot_ns)

    def _report(self, event: AnyEvent) -> None:
        stop = getattr(event, "stop", None)
        if stop is not None:
            self.records[stop] = self.records.get(stop, StopRecord()).after(event, self.stops.get(stop))
        coverage = "" if self._growth is None else self._growth.in_words()
        text = run_report(self.revisions, self.run_id, self.records, event, coverage)
        document = rr.TextDocument(text, media_type="text/markdown")
        for entity in (self.names.flat(entities.RUN_REPORT), entities.LATEST_REPORT):
            self._at(entity, document, event.robot_ns)

    def tell_time(self, report: StateReport | PoseReport | AnyEvent | PosesMissing | Health) -> None:
        """Learn when the mission began, from a report that tells."""
        seconds = getattr(report, "mission_time_s", None)
        if seconds is not None:
            self._began_ns = report.robot_ns - round(seconds * 1e9)

    def _at(self, entity: str, archetype: object, robot_ns: int) -> None:
        """At the robot's time, and at mission time once it is known when the mission began."""
        mission_s = None if self._began_ns is None else (robot_ns - self._began_ns) / 1e9
        self.canvas.at(entity, archetype, mission_s=mission_s, robot_ns=robot_ns)

    def _at_time(self, robot_ns: int) -> Draw:
        return partial(self._at, robot_ns=robot_ns)

    def _columns(self, entity: str, ns: IntArray, *groups: Any) -> None:
        """The same for many rows, one at each time."""
        indexes = [rr.TimeColumn(entities.ROBOT_TIME, timestamp=np.asarray(ns).astype("datetime64[ns]"))]
        if self._began_ns is not None:
            since = (np.asarray(ns) - self._began_ns).astype("timedelta64[ns]")
            indexes.append(rr.TimeColumn(entities.MISSION_TIME, duration=since))
        self.canvas.columns(entity, indexes, *groups)


HEALTH_FIELDS = ("battery", "localisation", "emergency_stop", "safety_field")
EVENT_FIELDS = (
    *("event", "number", "revision", "stop", "reason", "deviation_m", "commander"),
    *("file", "size", "sha256", "points"),
)
"""What is kept of an event as values, each of one type in all events."""

_PLOTTED = {
    entities.METRIC_CROSS_TRACK: "distance from the route",
    entities.METRIC_BATTERY: "battery",
}


_LIMITED = {entities.METRIC_DEVIATION: (1,), entities.METRIC_CROSS_TRACK: (-1, 1)}
"""Metrics with a tolerance, and on which sides."""


def _about(event: AnyEvent, stop: Stop | None) -> str:
    """The event's particulars in a few words; `stop` is the one it is of."""
    words = [getattr(event, name, "") for name in ("stop", "reason", "commander", "kind")]
    words.append(outside_tolerance_text(event, stop))
    if isinstance(event, Arrived):
        words.append(f"{event.deviation_m * 1000:.0f} mm beside")
    if isinstance(event, Scanned):
        words.append(f"{event.file}, {event.points} points")
    if isinstance(event, RevisionTaken):
        words.append(f"revision {event.revision} after {event.before}")
    if isinstance(event, RevisionWaits | RevisionDropped):
        words.append(f"revision {event.waiting}")
    return " ".join(word for word in words if word)
