"""Parameters of the floor: which storey, day, drawing or part of a file is read, and how."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from stopgo.mission.settings.layer_kinds import entries_in
from stopgo.mission.settings.parameter import Parameter

_floor = partial(Parameter, "floor", group="Floor")


@dataclass(frozen=True, kw_only=True)
class FloorParameters:
    """Table `floor` of plan.toml. What stands here makes a floor another floor."""

    storey: Annotated[
        str | None, _floor("The model's storey, by name", first=True, undecided="its only one")
    ] = None
    level: Annotated[float | None, _floor("Level of the floor in a model", "m", undecided="storey's")] = None
    scan_height: Annotated[
        float | None,
        _floor(
            "Height above the floor at which a model is cut",
            "m",
            above=0,
            below=10,
            undecided="1.3",
            word="cut_height",
        ),
    ] = None
    robot_height: Annotated[
        float | None, _floor("Robot's height", "m", above=0.1, below=10, undecided="cut_height")
    ] = None
    date: Annotated[str | None, _floor("Day of the construction status", "YYYY-MM-DD")] = None
    since: Annotated[str | None, _floor("Scan only what was finished after this day", "YYYY-MM-DD")] = None
    schedule: Annotated[str | None, _floor("CSV of GlobalIds with start and finish of their tasks")] = None
    schedule_columns: Annotated[
        tuple[str, ...],
        _floor(
            "Column of the schedule that holds guid, task, start or finish",
            form="WHAT=COLUMN",
            example="guid=GlobalId",
            read=str,
            option="schedule_column",
        ),
    ] = ()
    in_progress: Annotated[
        Literal["obstacle", "target"] | None,
        _floor("Elements under construction: obstacles only, or scanned too", undecided="obstacle"),
    ] = None
    furniture: Annotated[
        Literal["obstacle", "ignore"] | None,
        _floor("Furniture and equipment of a model: obstacles to the robot, or absent", undecided="obstacle"),
    ] = None
    units: Annotated[
        str | None, _floor("Unit of a drawing, such as mm, m or inch", undecided="as it fits walls and doors")
    ] = None
    drawing: Annotated[
        int | None,
        _floor(
            "Number of the drawing in a file that holds several, from 1", least=1, undecided="its only plan"
        ),
    ] = None
    region: Annotated[
        tuple[float, float, float, float] | None,
        _floor(
            "Part of a drawing to read, in its own unit",
            undecided="all",
            form="X0,Y0,X1,Y1",
            example="0,0,30,20",
            farthest=1e12,
        ),
    ] = None
    heights: Annotated[
        tuple[str, ...],
        _floor(
            "Lower and upper height of a kind in a drawing, or the underside of its ceiling or of lintels",
            "m",
            group="Scanner",
            form="KIND=LOW..HIGH",
            example="beams=2.4..2.8 or ceiling=2.8 or doors=2.1",
            read=str,
        ),
    ] = ()
    layer_map: Annotated[
        tuple[str, ...] | None,
        _floor(
            "Kinds of the layers, from a file of stopgo floors --write-map",
            form="FILE",
            example="layers.toml",
            read=entries_in,
            option="layers",
            undecided="by their names",
        ),
    ] = None
