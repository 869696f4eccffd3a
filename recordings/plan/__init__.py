"""A plan as a recording: takes each noun as the planner makes it, and draws them when the plan ends."""

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
from stopgo.mission.stages.sight import Sight
from stopgo.mission.stages.stop_reasons import driven_coverage, stop_reasons
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.blueprint import Bounds
from stopgo.recordings.drawing.canvas import (
    Canvas,
    LocalOrigin,
    Sheet,
    layout_alone,
    local_origin,
    mission_origin,
    open_canvas,
)
from stopgo.recordings.drawing.markdown import Nouns, parameter_values, parameters, plan_report, plan_results
from stopgo.recordings.embedded.checking import carry_end
from stopgo.recordings.embedded.findings import carry_findings
from stopgo.recordings.embedded.missions import carry_mission
from stopgo.recordings.embedded.reasons import carry_reasons
from stopgo.recordings.embedded.sight import carry_sight
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
from stopgo.recordings.plan.stop_browser import tell_stops
from stopgo.recordings.plan.visibility import draw_visibility
from stopgo.recordings.rrd.read import check

Drawing = Callable[[Canvas, Any], None]

DRAWINGS: dict[type, tuple[Drawing, ...]] = {
    FloorPlan: (draw_floor, raise_floor),
    NavigableSpace: (draw_space,),
    Candidates: (draw_candidates,),
    Visibility: (draw_visibility,),
    Selection: (draw_selection, paint_coverage),
    Mission: (draw_mission, carry_mission),
    Sight: (carry_sight,),
    Figures: (carry_findings,),
}
"""How each noun is drawn; nouns of other types are left out."""


class PlanRecording:
    """Collects the nouns of one plan, and draws them when it is written.

    Drawing waits for the end because the local origin is the mission's, which is known last and which
    field recordings of the mission know too.
    """

    def __init__(self, recording_id: str) -> None:
        self.recording_id = recording_id
        self._nouns: Nouns = {}

    def observe(self, noun: object) -> None:
        """Take one noun; of two of a kind the later one counts."""
        self._nouns[type(noun)] = noun

    def write(self, path: Path) -> None:
        """Draw the nouns into `path`, and read it back to its end."""
        path.write_bytes(_drawn(self.recording_id, self._nouns))
        check(path)

    def streamed(self) -> bytes:
        """The nouns as a recording, behind its layout: a viewer that reads it from a pipe draws what it has
        so far, and would make a layout of its own for a recording that comes first.
        """
        layout = layout_alone(_sheet(self.recording_id, self._nouns))
        return layout + _drawn(self.recording_id, self._nouns)


def _drawn(recording_id: str, nouns: Nouns) -> bytes:
    with open_canvas(_sheet(recording_id, nouns)) as canvas:
        for kind, drawings in DRAWINGS.items():
            for draw in drawings if kind in nouns else ():
                draw(canvas, nouns[kind])
        _draw_planned_drive(canvas, nouns)
        _tell(canvas, nouns)
        carry_end(canvas)
        return canvas.taken()


def _sheet(recording_id: str, nouns: Nouns) -> Sheet:
    return Sheet(recording_id=recording_id, name=_name(nouns), origin=_origin(nouns), extent=_extent(nouns))


def _origin(nouns: Nouns) -> LocalOrigin:
    if Mission in nouns:
        return mission_origin(nouns[Mission])
    if FloorPlan in nouns and nouns[FloorPlan].outline:
        x, y = nouns[FloorPlan].outline[0].exterior[0]
        return local_origin(float(x), float(y))
    return (0.0, 0.0)


def _extent(nouns: Nouns) -> Bounds:
    floor, mission = nouns.get(FloorPlan), nouns.get(Mission)
    if floor is not None:
        return bounds(polygon.exterior for polygon in floor.outline)
    return mission_extent(mission) if mission is not None else (0.0, 0.0, 0.0, 0.0)


def _name(nouns: Nouns) -> str:
    for kind in (Mission, FloorPlan):
        if kind in nouns:
            return str(nouns[kind].name)
    return "plan"


def _draw_planned_drive(canvas: Canvas, nouns: Nouns) -> None:
    """The drive of the mission, and the coverage it reaches on the way."""
    if Mission not in nouns or not nouns[Mission].stops:
        return
    mission = nouns[Mission]
    drive = planned_drive(mission)
    draw_drive(canvas, drive, radius=mission.robot.radius)
    if Route in nouns:
        route: Route = nouns[Route]
        reasons = stop_reasons(route, [stop.id for stop in mission.stops])
        plot_planned_coverage(canvas, driven_coverage(route), drive)
        tell_stops(canvas, route, mission, reasons, drive)
        carry_reasons(canvas, reasons)
    plan_states(canvas, mission, drive)


def _tell(canvas: Canvas, nouns: Nouns) -> None:
    """The report, and the properties by which the file says what it is of."""
    report = rr.TextDocument(plan_report(nouns, canvas.origin), media_type="text/markdown")
    canvas.show(entities.REPORT, report)
    canvas.at(entities.LATEST_REPORT, report, step=0, candidate=0, mission_s=0.0)
    results = {"local_origin": list(canvas.origin), "stopgo": __version__, **plan_results(nouns)}
    canvas.describe(entities.PROPERTY_PLAN, results)
    settings = parameters(nouns)
    if settings is not None:
        canvas.describe(entities.PROPERTY_PARAMETERS, parameter_values(settings))
