"""Drawing of one run: pose and driven path, events at stops, state, battery, cross-track error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import msgspec
import numpy as np
import rerun as rr

from stopgo.mission.comparing.delayed_deviation import DelayedDeviation
from stopgo.mission.document import Mission, Stop
from stopgo.mission.geometry import FloatArray, IntArray, frozen
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
    ReportsMissing,
    RevisionDropped,
    RevisionTaken,
    RevisionWaits,
    Scanned,
    Skipped,
    StateReport,
    Unconfirmed,
)
from stopgo.mission.run.health_text import health_text, health_words
from stopgo.mission.run.run_log import Track
from stopgo.mission.run.tolerance import StopErrors, deviation
from stopgo.mission.stages.sight import Sight, required_of
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.canvas import Canvas, on_screen
from stopgo.recordings.drawing.pens import ORDER, Pen, style
from stopgo.recordings.drawing.robot import Draw, draw_robot, quaternions
from stopgo.recordings.plan.mission import ABOVE_FLOOR, state_colours
from stopgo.recordings.runs.acquired_drawing import AcquiredDrawing
from stopgo.recordings.runs.report import StopRecord, run_report
from stopgo.recordings.runs.revision import change_between, draw_change
from stopgo.recordings.runs.trail import Thinner, Trail, TrailGap

DASH_M = 0.15
"""Length in metres of a dash, and of the space after it."""
SOLID_S = 0.5
"""Interval in seconds of the robot's poses in 3D."""
WARNINGS = (Skipped, Failed, Unconfirmed, Held, LinkLost, Aborted)
"""Events that need attention."""
MARKS: dict[type[object], tuple[str, palette.Meaning, float]] = {
    Arrived: (entities.ARRIVED, palette.ARRIVED, ORDER["arrival"]),
    Scanned: (entities.SCANNED, palette.SCANNED, ORDER["scan"]),
    Skipped: (entities.SKIPPED, palette.SKIPPED, ORDER["scan"]),
    Failed: (entities.FAILED, palette.FAILED, ORDER["scan"]),
}
"""Entity, class and drawing order of an event's mark on the plan."""


class RunDrawing:
    """Entities of one run id on a canvas; it grows with each report of the robot."""

    def __init__(self, canvas: Canvas, run_id: str, mission: Mission, sights: Sequence[Sight] = ()) -> None:
        self.canvas = canvas
        self.run_id = run_id
        self.names = entities.RunEntities(run_id)
        self.mission = mission
        self.revisions = [mission]
        self._errors = StopErrors(mission)
        self.records: dict[str, StopRecord] = {}
        self._began_ns: int | None = None
        self._last_xy: FloatArray | None = None
        self._boot_id = ""
        self._acquired = AcquiredDrawing(required_of(sights[-1], mission)) if sights else None
        self._thinner, self._trail, self._cross_track = Thinner(), Trail(), DelayedDeviation(mission)
        self._stops: dict[str, bool | None] = {}
        self._vehicle_health: tuple[bool | None, ...] | None = None
        self._style()
        self._describe()

    def follow(
        self,
        mission: Mission,
        report: StateReport | PoseReport | AnyEvent | PosesMissing | ReportsMissing | Health,
    ) -> None:
        """Continue with another revision of the mission from `report` on, and draw its changes."""
        self.read_start_time(report)
        change, names = change_between(self.mission, mission), self.names.revision(mission.revision)
        draw_change(self.canvas, change, names, partial(self._at, robot_ns=report.robot_ns))
        self.mission = mission
        self.revisions.append(mission)
        self._errors = StopErrors(mission)
        self._describe()

    def poses(self, track: Track, boot_id: str = "") -> None:
        """Move the robot, and extend its path. `measure` plots what depends on later events.

        All poses are of one boot; no path joins the poses of two.
        """
        if boot_id != self._boot_id:
            self._end_path()
            self._boot_id = boot_id
        self._draw_poses(self._thinner.thin(track))

    def _end_path(self) -> None:
        """Draw the newest pose, even if nothing moved; no path joins it and the next one."""
        self._draw_poses(self._thinner.held())
        self._trail.end()

    def _draw_poses(self, poses: Track) -> None:
        if not len(poses):
            return
        if self._last_xy is None:
            draw = partial(self._at, robot_ns=int(poses.ns[0]))
            robots = (self.names.flat(entities.ROBOT), self.names.solid(entities.ROBOT))
            draw_robot(draw, *robots, radius=self.mission.robot.radius, colour=palette.DRIVEN)
        self._move(poses)
        self._extend_path(poses)
        self._cross_track.poses(poses, self._boot_id)
        self._last_xy = poses.xy[-1]

    def states(self, reports: Sequence[StateReport]) -> None:
        """Draw the robot's and the stop's states on their lanes, and the battery on its plot."""
        if not reports:
            return
        if self._cross_track.knows(reports[-1].last_event):
            self.measure(reports[-1].robot_ns)
        lanes = {
            entities.STATE: [report.state for report in reports],
            entities.STOP_STATE: [report.stop_state or "" for report in reports],
            entities.STOP: [report.stop or "" for report in reports],
        }
        ns = frozen([report.robot_ns for report in reports], np.int64)
        for lane, states in lanes.items():
            self._columns(self.names.flat(lane), ns, rr.StateChange.columns(state=states))
        charges = [(report.robot_ns, report.charge * 100) for report in reports if report.charge is not None]
        if charges:
            ns, percent = zip(*charges, strict=True)
            battery = rr.Scalars.columns(scalars=percent)
            self._columns(self.names.metric(entities.METRIC_BATTERY), frozen(ns, np.int64), battery)
        for report in reports:
            self._note_vehicle_health(report)

    def _note_vehicle_health(self, report: StateReport) -> None:
        """Write the vehicle's health at the begin, whenever it changes and at the end; log the changes."""
        before, health = self._vehicle_health, (report.battery_ok, report.position_ok, report.fence_ok)
        if health == before and report.state not in ("FINISHED", "ABORTED"):
            return
        self._vehicle_health = health
        words = health_words(report)
        values = {
            "charge": report.battery, "battery": words.battery,
            "position_estimate": words.position, "geofence": words.fence,
        }  # fmt: skip
        archetype = rr.DynamicArchetype("VehicleHealth", components=values)
        self._at(self.names.vehicle_health, archetype, report.robot_ns)
        if health == (before or (None, None, None)):
            return
        level = "WARN" if False in health else "INFO"
        self._at(self.names.log, rr.TextLog(health_text(report), level=level), report.robot_ns)

    def missing(self, gap: PosesMissing) -> None:
        """Log how long the robot's position was unknown; its path ends before, and begins again after."""
        self.read_start_time(gap)
        self._end_path()
        line = rr.TextLog(gap.words, level="WARN")
        self._at(self.names.log, line, gap.robot_ns)

    def incomplete(self, report: ReportsMissing) -> None:
        """Log which topics do not arrive, and the age of the newest state."""
        line = rr.TextLog(report.words, level="WARN" if report.topics else "INFO")
        self._at(self.names.log, line, report.robot_ns)

    def health(self, report: Health) -> None:
        """Write the base's health, and log each change of a value that stops a robot."""
        values = {"battery": report.charge} | {name: getattr(report, name) for name in HEALTH_FIELDS}
        known = {name: value for name, value in values.items() if value is not None}
        self._at(self.names.health, rr.DynamicArchetype("Health", components=known), report.robot_ns)
        stops = {name: getattr(report, name) for name in HEALTH_FIELDS[1:]}
        changed = {name for name, value in stops.items() if bool(value) != bool(self._stops.get(name))}
        self._stops = stops
        for name in sorted(changed):
            words = f"{name.replace('_', ' ')}: {'yes' if stops[name] else 'no'}"
            self._at(
                self.names.log, rr.TextLog(words, level="WARN" if stops[name] else "INFO"), report.robot_ns
            )

    def event(self, event: AnyEvent) -> None:
        """Write the whole event, mark it on the plan, and update the report."""
        self.read_start_time(event)
        self._cross_track.event(event, self.mission)
        fields = {name: value for name, value in msgspec.to_builtins(event).items() if name in EVENT_FIELDS}
        fields["body"] = msgspec.json.encode(event).decode()
        self._at(self.names.events, rr.DynamicArchetype("Event", components=fields), event.robot_ns)
        stop = self._errors.stops.get(getattr(event, "stop", ""))
        off_stop = self._errors.text(event)
        level = "WARN" if isinstance(event, WARNINGS) or off_stop else "INFO"
        line = rr.TextLog(f"{type(event).__name__} {_details(event, off_stop)}".rstrip(), level=level)
        self._at(self.names.log, line, event.robot_ns)
        if isinstance(event, Arrived):
            self._plot_deviation(event.deviation_m, stop, event.robot_ns)
        elif isinstance(event, Scanned) and stop is not None and off_stop:
            self._plot_deviation(deviation(event.pose, stop), stop, event.robot_ns)
        self._mark(event)
        if self._acquired is not None:
            self._acquired.draw_event(
                event, canvas=self.canvas, names=self.names, draw=self._at_time(event.robot_ns)
            )
        self._report(event)

    def _style(self) -> None:
        """Set the looks that stay the same for the whole run."""
        canvas, names = self.canvas, self.names
        states = state_colours()
        for lane in (entities.STATE, entities.STOP_STATE):
            canvas.show(names.flat(lane), states)
        for name, points in ((entities.DRIVEN, 1.5), (entities.UNSEEN, 0.75)):
            style(canvas, names.flat(name), Pen(palette.DRIVEN, "robot", on_screen(points)))
            solid = rr.LineStrips3D.from_fields(colors=palette.DRIVEN, radii=0.02 * points)
            canvas.show(names.solid(name), solid)
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
        """Write the run's mission and origin as a property."""
        about = {
            "run_id": self.run_id,
            "mission_id": self.mission.id,
            "mission_name": self.mission.name,
            "revision": self.mission.revision,
            "digest": self.mission.digest,
            "floor": self.mission.origin.floor,
            "floor_digest": self.mission.origin.floor_digest,
            "planned_stops": len(self.mission.stops),
            "local_origin": list(self.canvas.origin),
        }
        self.canvas.describe(entities.PROPERTY_RUN, about)

    def _move(self, poses: Track) -> None:
        """Move the robot to its poses, and write them as exact values: Rerun draws in float32."""
        rotation = quaternions(poses.heading)
        positions = strokes.level(self.canvas.local(poses.xy), 0.0)
        exact: dict[str, Any] = {"x": poses.xy[:, 0], "y": poses.xy[:, 1], "heading": poses.heading}
        boots = {"boot_id": [self._boot_id] * len(poses)}
        moves = rr.Transform3D.columns(translation=positions, quaternion=rotation)
        values = rr.DynamicArchetype.columns(archetype="Pose", components=exact | boots)
        self._columns(self.names.flat(entities.ROBOT), poses.ns, moves, values)
        thinned = self._thinned_for_3d(poses.ns)
        self._columns(
            self.names.solid(entities.ROBOT),
            poses.ns[thinned],
            rr.Transform3D.columns(translation=positions[thinned], quaternion=rotation[thinned]),
        )

    def _thinned_for_3d(self, ns: IntArray) -> IntArray:
        """Return indices of poses for 3D: the first, the last, and one every SOLID_S."""
        ticks = np.flatnonzero(np.diff(ns // round(SOLID_S * 1e9)) > 0) + 1
        return np.unique(np.concatenate([[0], ticks, [len(ns) - 1]]))

    def _extend_path(self, poses: Track) -> None:
        """Add the path driven since the last poses."""
        ns, strips = self._trail.extended(poses)
        if strips:
            flat = self.canvas.strips(strips)
            self._columns(self.names.flat(entities.DRIVEN), ns, rr.LineStrips2D.columns(strips=flat))
            raised = [strokes.level(strip, 2 * ABOVE_FLOOR) for strip in flat]
            self._columns(self.names.solid(entities.DRIVEN), ns, rr.LineStrips3D.columns(strips=raised))
        gaps, self._trail.unseen = self._trail.unseen, []
        for gap in gaps:
            self._draw_gap(gap)

    def _draw_gap(self, gap: TrailGap) -> None:
        """Draw a gap dashed between its ends, with its duration and their distance."""
        dashes = strokes.dashes(gap.ends, DASH_M)
        if not len(dashes):
            return
        seconds = f" for {gap.seconds:.1f} s" if gap.seconds > 0 else ""
        label = f"no poses{seconds}; {math.dist(*gap.ends):.1f} m apart"
        flat = self.canvas.strips(dashes)
        lines = rr.LineStrips2D(flat, labels=[label, *[""] * (len(flat) - 1)], show_labels=len(flat) > 1)
        self._at(self.names.flat(entities.UNSEEN), lines, gap.end_ns)
        raised = [strokes.level(strip, 2 * ABOVE_FLOOR) for strip in flat]
        self._at(self.names.solid(entities.UNSEEN), rr.LineStrips3D(raised), gap.end_ns)

    def measure(self, until_ns: int | None = None) -> None:
        """Plot the cross-track error, up to a time until which all events are known, or of all poses."""
        if until_ns is None:
            self._draw_poses(self._thinner.held())
        ns, errors_m = self._cross_track.measured(until_ns)
        known = np.isfinite(errors_m)
        if known.any():
            values = rr.Scalars.columns(scalars=errors_m[known] * 1000)
            self._columns(self.names.metric(entities.METRIC_CROSS_TRACK), ns[known], values)

    def _mark(self, event: AnyEvent) -> None:
        stop = self._errors.stops.get(getattr(event, "stop", ""))
        if type(event) not in MARKS or stop is None:
            return
        name, meaning, order = MARKS[type(event)]
        position = getattr(event, "pose", None) or stop
        mark = rr.Points2D(
            [self.canvas.local(np.array([position.x, position.y]))],
            class_ids=meaning.number,
            radii=on_screen(3),
            labels=[f"{type(event).__name__} {_details(event, self._errors.text(event))}"],
            show_labels=False,
            draw_order=order,
        )
        self._at(self.names.flat(name), mark, event.robot_ns)

    def _plot_deviation(self, away_m: float, stop: Stop | None, robot_ns: int) -> None:
        """Plot the deviation in millimetres, with the stop's tolerance, also for both sides of the route."""
        self._at(self.names.metric(entities.METRIC_DEVIATION), rr.Scalars(away_m * 1000), robot_ns)
        if stop is not None:
            limit = stop.tolerance_m * 1000
            for metric, limits in _LIMITED.items():
                values = rr.Scalars([sign * limit for sign in limits])
                self._at(self.names.tolerance(metric), values, robot_ns)

    def _report(self, event: AnyEvent) -> None:
        stop = getattr(event, "stop", None)
        if stop is not None:
            planned, error = self._errors.stops.get(stop), self._errors.text(event)
            self.records[stop] = self.records.get(stop, StopRecord()).after(event, planned, error)
        coverage = "" if self._acquired is None else self._acquired.sentence()
        text = run_report(self.revisions, self.run_id, self.records, event, coverage)
        document = rr.TextDocument(text, media_type="text/markdown")
        for entity in (self.names.flat(entities.RUN_REPORT), entities.LATEST_REPORT):
            self._at(entity, document, event.robot_ns)

    def read_start_time(
        self, report: StateReport | PoseReport | AnyEvent | PosesMissing | ReportsMissing | Health
    ) -> None:
        """Read the mission's start time from a report that contains mission time."""
        seconds = getattr(report, "mission_time_s", None)
        if seconds is not None:
            self._began_ns = report.robot_ns - round(seconds * 1e9)

    def _at(self, entity: str, archetype: object, robot_ns: int) -> None:
        """Draw at the robot's time, and at mission time once the mission's start is known."""
        mission_s = None if self._began_ns is None else (robot_ns - self._began_ns) / 1e9
        self.canvas.at(entity, archetype, mission_s=mission_s, robot_ns=robot_ns)

    def _at_time(self, robot_ns: int) -> Draw:
        return partial(self._at, robot_ns=robot_ns)

    def _columns(self, entity: str, ns: IntArray, *groups: Any) -> None:
        """Draw many rows, one at each time."""
        indexes = [rr.TimeColumn(entities.ROBOT_TIME, timestamp=np.asarray(ns).astype("datetime64[ns]"))]
        if self._began_ns is not None:
            since = (np.asarray(ns) - self._began_ns).astype("timedelta64[ns]")
            indexes.append(rr.TimeColumn(entities.MISSION_TIME, duration=since))
        self.canvas.columns(entity, indexes, *groups)


HEALTH_FIELDS = ("localisation", "emergency_stop", "safety_field")
EVENT_FIELDS = (
    *("event", "number", "revision", "stop", "reason", "deviation_m", "commander"),
    *("file", "size", "sha256", "points"),
)
"""Fields of an event that are written as values; each has one type in all events."""

_PLOTTED = {
    entities.METRIC_CROSS_TRACK: "distance from the route",
    entities.METRIC_BATTERY: "battery",
}


_LIMITED = {entities.METRIC_DEVIATION: (1,), entities.METRIC_CROSS_TRACK: (-1, 1)}
"""Metrics with a tolerance, and the sides that it applies to."""


def _details(event: AnyEvent, error: str) -> str:
    """Return the event's details in a few words; `error` is what is outside tolerance."""
    words = [getattr(event, name, "") for name in ("stop", "reason", "commander", "kind")]
    words.append(error)
    if isinstance(event, Arrived):
        words.append(f"{event.deviation_m * 1000:.0f} mm deviation")
    if isinstance(event, Scanned):
        words.append(f"{event.file}, {event.points} points")
    if isinstance(event, RevisionTaken):
        words.append(f"revision {event.revision} after {event.before}")
    if isinstance(event, RevisionWaits | RevisionDropped):
        words.append(f"revision {event.waiting}")
    return " ".join(word for word in words if word)
