"""Blueprint of every recording: the viewer's layout for a plan, a field run, or both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from stopgo.recordings.drawing import entities as at
from stopgo.recordings.drawing import palette
from stopgo.recordings.drawing.entities import under
from stopgo.recordings.drawing.palette import Colour

BACKGROUND = (18, 20, 26, 255)


Bounds = tuple[float, float, float, float]
"""Least x, least y, greatest x, greatest y in local metres; y points up."""
STEPS_PER_SECOND = 4.0
"""Playback speed of the candidates and of the selection."""
MARGIN = 0.04
"""Empty space around the drawing, as a fraction of its size."""


def blueprint(bounds: Bounds | None = None, runs: Sequence[str] = ()) -> rrb.Blueprint:
    """Return tabs for the mission, its planning stages, the run, and the log; 2D views show `bounds`.

    Plans and runs have the same blueprint, so the order of opening them does not matter. Views show the
    newest moment: a live run while it goes on, a recorded run at its end. `runs` names the runs that are
    shown together; each gets its own colour and report.
    """
    return rrb.Blueprint(
        rrb.Tabs(
            _mission(bounds, runs),
            _story(bounds),
            _stops(bounds),
            _candidates(bounds),
            _run(runs),
            _log(),
            active_tab=0,
        ),
        rrb.TimePanel(
            timeline=at.MISSION_TIME,
            play_state="following",
            state="collapsed",
            fps=STEPS_PER_SECOND,
        ),
        auto_views=False,
        auto_layout=False,
        collapse_panels=True,
    )


def _mission(bounds: Bounds | None, runs: Sequence[str]) -> rrb.Horizontal:
    plan = _flat(
        "Plan and run",
        _visible(bounds),
        *(at.FLOOR, at.COVERAGE, at.ROUTE, at.STOPS, at.PLANNED_ROBOT, at.PROVED, at.FIELD),
        time_ranges=_so_far(),
        overrides=_run_colours(runs),
    )
    reports = rrb.Tabs(
        rrb.TextDocumentView(origin=at.LATEST_REPORT, name="Report"),
        *(_run_report(run) for run in runs),
        rrb.TextDocumentView(origin=at.REPORT, name="Plan report"),
        active_tab=0,
    )
    return rrb.Horizontal(
        plan,
        rrb.Vertical(_solid(bounds), reports),
        column_shares=[3, 2],
        name="Mission",
    )


def _run_report(run: str) -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=at.RunEntities(run).flat(at.RUN_REPORT), name=f"Run {run}")


def _run_colours(runs: Sequence[str]) -> Any:
    """Return a colour for the driven path of each of several runs."""
    if len(runs) < 2:
        return {}
    return {
        at.RunEntities(run).flat(at.DRIVEN): rr.LineStrips2D.from_fields(colors=_colour(k))
        for k, run in enumerate(runs)
    }


def _metric_colours(metric: str, runs: Sequence[str]) -> Any:
    if len(runs) < 2:
        return {}
    return {
        at.RunEntities(run).metric(metric): rr.SeriesLines.from_fields(colors=_colour(k), names=f"run {run}")
        for k, run in enumerate(runs)
    }


def _colour(number: int) -> Colour:
    return palette.RUNS[number % len(palette.RUNS)]


def _story(bounds: Bounds | None) -> rrb.Horizontal:
    """Show in one view how the plan was made; on mission time, show the result."""
    adding = {entity: _rows_so_far() for entity in (at.SELECTION_SEEN, at.SELECTION_STOPS)}
    contents = (at.FLOOR, at.NAVIGABLE, at.TARGETS, at.CANDIDATES, at.SELECTION)
    return rrb.Horizontal(
        _flat("Step by step (timeline: stage_step)", _visible(bounds), *contents, overrides=adding),
        rrb.Vertical(
            rrb.TextDocumentView(origin=at.STORY, name="This step (timeline: stage_step)"),
            _plot("Coverage, % (timeline: stage_step)", at.METRIC_COVERAGE),
        ),
        column_shares=[3, 2],
        name="Planning",
    )


def _rows_so_far() -> rrb.VisibleTimeRanges:
    """All rows up to now, for entities that accumulate along the planning steps."""
    return rrb.VisibleTimeRanges([_until_now(timeline) for timeline in (at.STEP, at.MISSION_TIME)])


def _stops(bounds: Bounds | None) -> rrb.Horizontal:
    return rrb.Horizontal(
        _flat("Why this stop (timeline: stop)", _visible(bounds), at.FLOOR, at.STOPS, at.WHY),
        rrb.TextDocumentView(origin=at.STOP_STORY, name="In words (timeline: stop)"),
        column_shares=[3, 2],
        name="Stops",
    )


def _candidates(bounds: Bounds | None) -> rrb.Horizontal:
    area = _visible(bounds)
    return rrb.Horizontal(
        _flat("Navigable space and candidates", area, at.FLOOR, at.NAVIGABLE, at.TARGETS, at.CANDIDATES),
        _flat("What a candidate sees (timeline: candidate)", area, at.FLOOR, at.VISIBILITY),
        name="Candidates",
    )


def _run(runs: Sequence[str]) -> rrb.Vertical:
    states = [under(at.FIELD), under(at.PLANNED_STATE)]
    return rrb.Vertical(
        rrb.StateTimelineView(origin=at.ROOT, contents=states, name="States", time_view=_whole()),
        _plot("Distance from the route, mm (left positive)", at.METRIC_CROSS_TRACK, runs=runs),
        _plot("Deviation at each stop, mm", at.METRIC_DEVIATION),
        _plot("Battery, %", at.METRIC_BATTERY, (0.0, 100.0), runs=runs),
        name="Run",
    )


def _log() -> rrb.TextLogView:
    return rrb.TextLogView(origin=at.LOG, contents=under(at.LOG), name="Log")


def _visible(bounds: Bounds | None) -> rrb.VisualBounds2D | None:
    """Bounds for Rerun, whose 2D y axis points down."""
    if bounds is None:
        return None
    left, low, right, high = bounds
    margin = MARGIN * max(right - left, high - low, 1.0)
    return rrb.VisualBounds2D(
        x_range=(left - margin, right + margin), y_range=(-high - margin, -low + margin)
    )


def _flat(
    name: str, area: rrb.VisualBounds2D | None, *contents: str, time_ranges: Any = None, overrides: Any = None
) -> rrb.Spatial2DView:
    """2D view with y up: its origin is above the entity that flips y."""
    return rrb.Spatial2DView(
        origin=at.ROOT,
        contents=[under(entity) for entity in contents],
        name=name,
        background=BACKGROUND,
        visual_bounds=area,
        time_ranges=time_ranges,
        overrides=overrides,
    )


def _solid(bounds: Bounds | None) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin=at.WORLD,
        contents=under(at.WORLD),
        name="3D",
        background=BACKGROUND,
        line_grid=False,
        eye_controls=None if bounds is None else _from_the_south(bounds),
        time_ranges=_so_far(),
    )


def _from_the_south(bounds: Bounds) -> rrb.EyeControls3D:
    """Camera that looks down into the rooms, with north at the top."""
    left, low, right, high = bounds
    x, y, size = (left + right) / 2, (low + high) / 2, max(right - left, high - low, 1.0)
    return rrb.EyeControls3D(
        position=(x, y - 0.5 * size, 0.65 * size), look_target=(x, y, 0.0), eye_up=(0.0, 0.0, 1.0)
    )


def _plot(
    name: str, entity: str, span: tuple[float, float] | None = None, *, runs: Sequence[str] = ()
) -> rrb.TimeSeriesView:
    axis = None if span is None else rrb.ScalarAxis(range=span, zoom_lock=True)
    return rrb.TimeSeriesView(
        origin=entity,
        contents=under(entity),
        name=name,
        axis_x=_whole(),
        axis_y=axis,
        overrides=_metric_colours(entity, runs),
    )


def _whole() -> rrb.TimeAxis:
    """Whole timeline; Rerun's default is a minute around the cursor."""
    everything = rrb.TimeRange(start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite())
    return rrb.TimeAxis(view_range=everything)


def _so_far() -> list[rr.VisibleTimeRange]:
    """All rows up to now: the driven path consists of many short strips."""
    return [_until_now(timeline) for timeline in (at.MISSION_TIME, at.ROBOT_TIME)]


def _until_now(timeline: str) -> rr.VisibleTimeRange:
    return rrb.VisibleTimeRange(
        timeline, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative()
    )
