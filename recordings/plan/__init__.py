"""Plan as a recording: collects each stage result from the planner, and draws them all when the plan ends."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import rerun as rr

from stopgo.mission import __version__
from stopgo.mission.document import Mission
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import bounds
from stopgo.mission.stages import Candidates, NavigableSpace, Route, Selection, Visibility
from stopgo.mission.stages.figures import Figures
from stopgo.mission.stages.plan_results import PlanResults, StageResults
from stopgo.mission.stages.sight import Sight
from stopgo.mission.stages.stop_reasons import driven_coverage, stop_reasons
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.blueprint import Bounds
from stopgo.recordings.drawing.canvas import (
    Canvas,
    KeepingCanvas,
    LocalOrigin,
    Sheet,
    layout_alone,
    local_origin,
    mission_origin,
    open_canvas,
)
from stopgo.recordings.drawing.markdown import (
    parameter_values,
    parameters,
    plan_report,
)
from stopgo.recordings.embedded.checking import embed_end
from stopgo.recordings.embedded.findings import embed_findings
from stopgo.recordings.embedded.missions import embed_mission
from stopgo.recordings.embedded.reasons import embed_reasons
from stopgo.recordings.embedded.sight import embed_sight
from stopgo.recordings.plan.candidates import draw_candidates
from stopgo.recordings.plan.drive import planned_drive
from stopgo.recordings.plan.floor import draw_floor, raise_floor
from stopgo.recordings.plan.mission import (
    draw_drive,
    draw_mission,
    mission_extent,
    plan_states,
    plot_planned_coverage,
)
from stopgo.recordings.plan.selection import draw_selection, paint_coverage
from stopgo.recordings.plan.space import draw_space
from stopgo.recordings.plan.stop_browser import describe_stops
from stopgo.recordings.plan.visibility import draw_visibility
from stopgo.recordings.rrd.read import check

Drawing = Callable[[Canvas, Any], None]

DRAWINGS: dict[type, tuple[Drawing, ...]] = {
    FloorPlan: (draw_floor, raise_floor),
    NavigableSpace: (draw_space,),
    Candidates: (draw_candidates,),
    Visibility: (draw_visibility,),
    Selection: (draw_selection, paint_coverage),
    Mission: (draw_mission, embed_mission),
    Sight: (embed_sight,),
    Figures: (embed_findings,),
}
"""Drawing functions of each stage result; results of other types are left out."""


COMMON = frozenset({FloorPlan, NavigableSpace, Candidates, Visibility})
"""Stage results that several missions may have in common; they are drawn without any other result."""


class CommonDrawings:
    """Drawings of results that several recordings have in common: each is made once for a local origin."""

    def __init__(self) -> None:
        self._kept: dict[tuple[type, LocalOrigin], tuple[object, list[Callable[[Canvas], None]]]] = {}

    def draw(self, canvas: Canvas, result: object) -> None:
        """Draw a result, as before if it was the last of its type; else it is kept in its place."""
        key = (type(result), canvas.origin)
        of, kept = self._kept.get(key, (None, []))
        if of is result:
            for draw_again in kept:
                draw_again(canvas)
            return
        keeping = KeepingCanvas.of(canvas)
        _draw_result(keeping, result)
        self._kept[key] = (result, keeping.kept)


class PlanRecording:
    """Collects the stage results of one plan, and draws them when it is written.

    Drawing waits for the end, because the local origin is the mission's. The mission is the last result, and
    its field recordings have the same origin. What it has in `common` with other recordings is drawn once.
    """

    def __init__(self, recording_id: str, common: CommonDrawings | None = None) -> None:
        self.recording_id = recording_id
        self._common = common
        self._results: dict[type, Any] = {}
        self._drawn: bytes | None = None

    def observe(self, result: object) -> None:
        """Collect one stage result; a later one replaces an earlier one of the same type."""
        self._results[type(result)] = result
        self._drawn = None

    def draw(self) -> bytes:
        """Draw the stage results; returns the recording in Rerun's format, the same at each call."""
        if self._drawn is None:
            self._drawn = _recording(self.recording_id, self._results, self._common)
        return self._drawn

    def write(self, path: Path) -> None:
        """Draw the stage results into `path`, and read the file to its end."""
        path.write_bytes(self.draw())
        check(path)

    def streamed(self) -> bytes:
        """Return the stage results as a recording that follows its layout.

        A viewer that reads from a pipe draws the data it has so far. It would make its own layout for a
        recording that comes before its layout.
        """
        layout = layout_alone(_sheet(self.recording_id, self._results))
        return layout + _recording(self.recording_id, self._results)


def _recording(recording_id: str, results: StageResults, common: CommonDrawings | None = None) -> bytes:
    with open_canvas(_sheet(recording_id, results)) as canvas:
        for kind in DRAWINGS:
            if kind in results:
                draw = common.draw if common and kind in COMMON else _draw_result
                draw(canvas, results[kind])
        _draw_planned_drive(canvas, results)
        _describe_plan(canvas, results)
        embed_end(canvas)
        return canvas.drain()


def _draw_result(canvas: Canvas, result: object) -> None:
    for draw in DRAWINGS[type(result)]:
        draw(canvas, result)


def _sheet(recording_id: str, results: StageResults) -> Sheet:
    return Sheet(
        recording_id=recording_id, name=_name(results), origin=_origin(results), extent=_extent(results)
    )


def _origin(results: StageResults) -> LocalOrigin:
    if Mission in results:
        return mission_origin(results[Mission])
    if FloorPlan in results and results[FloorPlan].outline:
        x, y = results[FloorPlan].outline[0].exterior[0]
        return local_origin(float(x), float(y))
    return (0.0, 0.0)


def _extent(results: StageResults) -> Bounds:
    floor, mission = results.get(FloorPlan), results.get(Mission)
    if floor is not None:
        return bounds(polygon.exterior for polygon in floor.outline)
    return mission_extent(mission) if mission is not None else (0.0, 0.0, 0.0, 0.0)


def _name(results: StageResults) -> str:
    for kind in (Mission, FloorPlan):
        if kind in results:
            return str(results[kind].name)
    return "plan"


def _draw_planned_drive(canvas: Canvas, results: StageResults) -> None:
    """Draw the mission's drive, and the coverage along it."""
    if Mission not in results or not results[Mission].stops:
        return
    mission = results[Mission]
    drive = planned_drive(mission)
    draw_drive(canvas, drive, radius=mission.robot.radius)
    if Route in results:
        route: Route = results[Route]
        reasons = stop_reasons(route, [stop.id for stop in mission.stops])
        plot_planned_coverage(canvas, driven_coverage(route), drive)
        describe_stops(canvas, route, mission, reasons, drive)
        embed_reasons(canvas, reasons)
    plan_states(canvas, mission, drive)


def _describe_plan(canvas: Canvas, results: StageResults) -> None:
    """Write the report, and the properties that identify the file."""
    report = rr.TextDocument(plan_report(results, canvas.origin), media_type="text/markdown")
    canvas.show(entities.REPORT, report)
    canvas.at(entities.LATEST_REPORT, report, step=0, candidate=0, mission_s=0.0)
    values = {
        "local_origin": list(canvas.origin),
        "stopgo": __version__,
        **PlanResults.of(results).properties,
    }
    canvas.describe(entities.PROPERTY_PLAN, values)
    settings = parameters(results)
    if settings is not None:
        canvas.describe(entities.PROPERTY_PARAMETERS, parameter_values(settings))
