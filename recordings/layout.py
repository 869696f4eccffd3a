"""The blueprint of every recording: what a viewer shows when it opens a plan, a field run, or both."""

from __future__ import annotations

from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from recordings import entities as at
from recordings.entities import under

BACKGROUND = (18, 20, 26, 255)


Bounds = tuple[float, float, float, float]
"""Least x, least y, greatest x, greatest y in local metres, y up."""
STEPS_PER_SECOND = 4.0
"""How fast the candidates and the selection are played."""
MARGIN = 0.04
"""Empty space around the drawing, as a share of its size."""


def blueprint(bounds: Bounds | None = None, *, of_run: bool = False) -> rrb.Blueprint:
    """Tabs for the mission, its planning stages, the run, and the log; 2D views show `bounds`.

    A run is shown at its newest moment: a live one as it goes on, a recorded one at its end.
    """
    return rrb.Blueprint(
        rrb.Tabs(_mission(bounds, of_run), _stages(bounds), _run(), _log(), active_tab=0),
        rrb.TimePanel(
            timeline=at.MISSION_TIME,
            play_state="following" if of_run else "paused",
            state="collapsed",
            fps=STEPS_PER_SECOND,
        ),
        auto_views=False,
        auto_layout=False,
        collapse_panels=True,
    )


def _mission(bounds: Bounds | None, of_run: bool) -> rrb.Horizontal:
    plan = _flat(
        "Plan and run",
        _visible(bounds),
        *(at.FLOOR, at.COVERAGE, at.ROUTE, at.STOPS, at.PLANNED_ROBOT, at.FIELD),
        time_ranges=_so_far(),
    )
    reports = rrb.Tabs(
        rrb.TextDocumentView(origin=at.REPORT, name="Plan report"),
        rrb.TextDocumentView(origin=at.FIELD, contents=under(at.FIELD), name="Run report"),
        active_tab=1 if of_run else 0,
    )
    return rrb.Horizontal(
        plan,
        rrb.Vertical(_solid(bounds), reports),
        column_shares=[3, 2],
        name="Mission",
    )


def _stages(bounds: Bounds | None) -> rrb.Grid:
    area = _visible(bounds)
    return rrb.Grid(
        _flat("Navigable space and candidates", area, at.FLOOR, at.NAVIGABLE, at.TARGETS, at.CANDIDATES),
        _flat("What a candidate sees (timeline: candidate)", area, at.FLOOR, at.VISIBILITY),
        _flat("Selection (timeline: stage_step)", area, at.FLOOR, at.SELECTION),
        _plot("Coverage, %", at.METRIC_COVERAGE),
        grid_columns=2,
        name="Planning",
    )


def _run() -> rrb.Vertical:
    return rrb.Vertical(
        rrb.StateTimelineView(origin=at.FIELD, contents=under(at.FIELD), name="States", time_view=_whole()),
        _plot("Distance from the route, mm (left positive)", at.METRIC_CROSS_TRACK),
        _plot("Deviation at each stop, mm", at.METRIC_DEVIATION),
        _plot("Battery, %", at.METRIC_BATTERY, (0.0, 100.0)),
        name="Run",
    )


def _log() -> rrb.TextLogView:
    return rrb.TextLogView(origin=at.LOG, contents=under(at.LOG), name="Log")


def _visible(bounds: Bounds | None) -> rrb.VisualBounds2D | None:
    """Rerun's bounds are y-down."""
    if bounds is None:
        return None
    left, low, right, high = bounds
    margin = MARGIN * max(right - left, high - low, 1.0)
    return rrb.VisualBounds2D(
        x_range=(left - margin, right + margin), y_range=(-high - margin, -low + margin)
    )


def _flat(
    name: str, area: rrb.VisualBounds2D | None, *contents: str, time_ranges: Any = None
) -> rrb.Spatial2DView:
    """A y-up 2D view: its origin lies above the flip."""
    return rrb.Spatial2DView(
        origin=at.ROOT,
        contents=[under(entity) for entity in contents],
        name=name,
        background=BACKGROUND,
        visual_bounds=area,
        time_ranges=time_ranges,
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
    """An eye that looks down into the rooms, north at the top."""
    left, low, right, high = bounds
    x, y, size = (left + right) / 2, (low + high) / 2, max(right - left, high - low, 1.0)
    return rrb.EyeControls3D(
        position=(x, y - 0.5 * size, 0.65 * size), look_target=(x, y, 0.0), eye_up=(0.0, 0.0, 1.0)
    )


def _plot(name: str, entity: str, span: tuple[float, float] | None = None) -> rrb.TimeSeriesView:
    axis = None if span is None else rrb.ScalarAxis(range=span, zoom_lock=True)
    return rrb.TimeSeriesView(origin=entity, contents=under(entity), name=name, axis_x=_whole(), axis_y=axis)


def _whole() -> rrb.TimeAxis:
    """All of the timeline; Rerun's own choice is a minute around the cursor."""
    everything = rrb.TimeRange(start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite())
    return rrb.TimeAxis(view_range=everything)


def _so_far() -> list[rr.VisibleTimeRange]:
    """The driven path is rows of short pieces: show all of them up to now."""
    return [
        rrb.VisibleTimeRange(
            timeline,
            start=rrb.TimeRangeBoundary.infinite(),
            end=rrb.TimeRangeBoundary.cursor_relative(),
        )
        for timeline in (at.MISSION_TIME, at.ROBOT_TIME)
    ]
