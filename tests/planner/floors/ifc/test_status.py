"""Status on a day: finished elements are scanned, started ones are obstacles, later ones are absent."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ifcopenshell.api.pset
import ifcopenshell.api.sequence
import ifcopenshell.api.type
import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan, Rank
from stopgo.planner.floors.ifc.construction_dates import phases_by_product, tasks_by_product
from stopgo.planner.floors.ifc.model import Task
from stopgo.planner.floors.ifc.status import status_on
from stopgo.planner.floors.ifc.timetable import read_timetable
from tests.planner.floors.ifc.conftest import Read
from tests.planner.floors.ifc.house import House, two_rooms

WORK = {
    "slab": ("2024-01-01", "2024-01-31"),
    **{name: ("2024-02-01", "2024-02-28") for name in ("south", "north", "west", "east")},
    "middle": ("2024-03-01", "2024-03-31"),
    "column": ("2024-03-15", "2024-04-15"),
    "door": ("2024-05-01", "2024-05-02"),
}
"""Start and finish of what is built; the window and the beam have no task."""


def scheduled(house: House, work: dict[str, tuple[str, str]], *, assigned: str = "product") -> House:
    """The house with an IfcTask for each of its things, related as IFC4 allows in two ways."""
    schedule = ifcopenshell.api.sequence.add_work_schedule(house.model, name="work")
    for name, (start, finish) in work.items():
        task = ifcopenshell.api.sequence.add_task(house.model, work_schedule=schedule, name=f"build {name}")
        time = ifcopenshell.api.sequence.add_task_time(house.model, task=task)
        if assigned == "product":
            ifcopenshell.api.sequence.assign_product(
                house.model, relating_product=house.things[name], related_object=task
            )
        else:
            ifcopenshell.api.sequence.assign_process(
                house.model, relating_process=task, related_object=house.things[name]
            )
        time.ScheduleStart, time.ScheduleFinish = f"{start}T08:00:00", f"{finish}T17:00:00"
    return house


def targets(floor: FloorPlan, house: House) -> set[str]:
    names = {thing.GlobalId: name for name, thing in house.things.items()}
    return {names[item.global_id or ""] for item in floor.elements if item.target}


def there(floor: FloorPlan, house: House) -> set[str]:
    names = {thing.GlobalId: name for name, thing in house.things.items()}
    return {names[item.global_id] for item in (*floor.elements, *floor.openings) if item.global_id}


@pytest.mark.parametrize("assigned", ["product", "process"])
def test_three_days_give_three_floors(read: Read, assigned: str) -> None:
    house = scheduled(two_rooms(), WORK, assigned=assigned)
    early, middle, late = (read(house, date=f"2024-0{month}-20") for month in (2, 3, 5))
    assert dict(early.status) == {
        "built": 3, "in_progress": 4, "not_started": 3, "removed": 0, "without_task": 2
    }  # fmt: skip
    assert there(early, house) == {"south", "north", "west", "east", "window", "beam"}
    assert targets(early, house) == {"beam"}
    assert (middle.status["built"], middle.status["in_progress"]) == (7, 2)
    assert targets(middle, house) == {"south", "north", "west", "east", "beam"}
    assert {item.kind for item in middle.openings} == {"passage"}  # the door is not hung yet
    assert late.status["built"] == 10
    assert {item.kind for item in late.openings} == {"door"}


def test_what_is_begun_is_in_the_way_and_a_target_only_on_request(read: Read) -> None:
    house = scheduled(two_rooms(), WORK)
    (column,) = [item for item in read(house, date="2024-03-20").elements if item.kind == "columns"]
    assert (column.obstacle, column.target) == (True, False)
    assert "column" in targets(read(house, date="2024-03-20", in_progress="target"), house)


def test_since_leaves_exactly_what_was_finished_after_that_day(read: Read) -> None:
    house = scheduled(two_rooms(), WORK)
    floor = read(house, date="2024-04-20", since="2024-02-28")
    assert targets(floor, house) == {"middle", "column"}
    assert {item.kind for item in floor.elements if item.occludes} >= {"walls", "columns"}
    assert targets(floor.with_targets(("walls", "beams")), house) == {"middle"}
    assert floor.status["built_before"] == 7


def test_a_day_before_the_slab_has_no_floor(read: Read) -> None:
    house = scheduled(two_rooms(), WORK)
    said = r"date 2024-01-15: no floor at 'EG' on that day: slab \S+ 'slab' is in progress; choose a later"
    with pytest.raises(InputError, match=said):
        read(house, date="2024-01-15")


def test_a_model_without_any_day_is_not_planned_for_one(read: Read) -> None:
    with pytest.raises(InputError, match="no product of the model has a task or a day"):
        read(two_rooms(), date="2024-01-15")


def test_days_may_stand_in_properties(read: Read) -> None:
    house = two_rooms()
    for name, key in (("middle", "InstallationDate"), ("column", "Finish Date")):
        made = ifcopenshell.api.pset.add_pset(house.model, product=house.things[name], name="Site")
        ifcopenshell.api.pset.edit_pset(house.model, pset=made, properties={key: "2024-06-01"})
    before = read(house, date="2024-05-31")
    assert not there(before, house) & {"middle", "column"}
    assert there(read(house, date="2024-06-01"), house) >= {"middle", "column"}
    assert "no_task" in {item.code for item in before.findings}


def test_ifc2x3_reports_days_by_schedule_time_controls(read: Read) -> None:
    house = two_rooms("IFC2X3")
    model = house.model
    day = model.create_entity("IfcCalendarDate", DayComponent=1, MonthComponent=6, YearComponent=2024)
    owner = model.by_type("IfcOwnerHistory")[0]
    rooted: dict[str, Any] = {"OwnerHistory": owner}
    works: dict[str, Any] = {}
    task = model.create_entity("IfcTask", "1" * 22, **rooted, TaskId="1", IsMilestone=False)
    time = model.create_entity(
        "IfcScheduleTimeControl", "2" * 22, **rooted, ScheduleStart=day, ScheduleFinish=day
    )
    work = model.create_entity(
        "IfcWorkSchedule", "3" * 22, **rooted, Identifier="w", CreationDate=day, StartTime=day
    )
    works |= {"RelatingControl": work, "TimeForTask": time}
    model.create_entity(
        "IfcRelAssignsTasks",
        "4" * 22,
        **rooted,
        RelatedObjects=[task],
        RelatingControl=work,
        TimeForTask=time,
    )
    model.create_entity(
        "IfcRelAssignsToProcess",
        "5" * 22,
        **rooted,
        RelatedObjects=[house.things["column"]],
        RelatingProcess=task,
    )
    assert "column" not in there(read(house, date="2024-05-31"), house)
    assert "column" in there(read(house, date="2024-06-01"), house)


def test_a_schedule_next_to_the_model_names_products_by_global_id(read: Read, tmp_path: Path) -> None:
    house, path = two_rooms(), tmp_path / "work.csv"
    guid = house.things["column"].GlobalId
    path.write_text(f"GUID;Task;Start;Finish\n{guid};cast;3-1-2024;28-2-2024\n;;;\n{guid};strip;;15-3-2024\n")
    assert "column" not in there(read(house, date="2024-01-02", schedule=path), house)
    half = read(house, date="2024-03-01", schedule=path)
    assert (half.status["in_progress"], "column" in targets(half, house)) == (1, False)
    done = read(house, date="2024-03-15", schedule=path)
    assert "column" in targets(done, house)
    assert done.source.options["schedule"] == half.source.options["schedule"]
    assert done.source.basis != half.source.basis


def test_a_schedule_gives_days_to_phases_by_their_names(read: Read, tmp_path: Path) -> None:
    """Revit's phases have none of their own."""
    house, path = two_rooms(), tmp_path / "work.csv"
    phases = {
        "middle": {"Phase Created": "Fit-out", "Phase Demolished": "None"},
        "column": {"Phase Created": "Shell", "Phase Demolished": "Fit-out"},
        "beam": {"Phase Created": "Later"},
    }
    for name, said in phases.items():
        made = ifcopenshell.api.pset.add_pset(house.model, product=house.things[name], name="Phasing")
        ifcopenshell.api.pset.edit_pset(house.model, pset=made, properties=said)
    path.write_text("GUID,Start,Finish\nshell,2024-01-01,2024-02-01\nFit-out,2024-03-01,2024-04-01\n")
    shell, done = (read(house, date=day, schedule=path) for day in ("2024-02-20", "2024-04-02"))
    assert there(shell, house) & {"middle", "column"} == {"column"}
    assert there(done, house) & {"middle", "column"} == {"middle"}
    assert done.status["removed"] == 1
    (told,) = [item for item in done.findings if item.code == "phases_undated"]
    assert (
        told.message
        == "phases without a day are not used: 'Later'; give each a row of --schedule by its name"
    )


def with_phases(house: House, thing: Any, name: str, said: dict[str, Any]) -> None:
    made = ifcopenshell.api.pset.add_pset(house.model, product=thing, name=name)
    ifcopenshell.api.pset.edit_pset(house.model, pset=made, properties=said)


def test_a_product_has_the_phases_of_its_type_where_its_own_sets_name_none() -> None:
    house = two_rooms()
    kind = house.box("IfcWallType", "kind", (0, 0, 0, 1, 1, 1))
    walls = [house.things[name] for name in ("north", "west", "east")]
    with_phases(house, kind, "Phasing", {"Phase Created": "Shell", "Phase Demolished": " Fit-out "})
    ifcopenshell.api.type.assign_type(house.model, related_objects=walls, relating_type=kind)
    with_phases(house, walls[1], "Phasing", {"Phase Created": "Later", "Mark": "7"})
    with_phases(house, walls[2], "Other", {"Phase": "Later", "Phase Demolished": "None"})
    with_phases(house, house.things["column"], "Other", {"Phases": "Later", "Level": 3.0})
    found = phases_by_product(house.model)
    assert [found[wall.id()] for wall in walls] == [
        ("Shell", "Fit-out"),
        ("Later", "Fit-out"),
        ("Shell", "Fit-out"),
    ]
    assert house.things["column"].id() not in found


def test_a_property_without_a_name_takes_nothing_from_its_set() -> None:
    house = two_rooms()
    wall = house.things["north"]
    with_phases(house, wall, "Phasing", {"Mark": "7", "Phase Created": "Shell"})
    house.model.by_type("IfcPropertySingleValue")[0].Name = None
    model = ifcopenshell.file.from_string(house.model.to_string())
    assert phases_by_product(model)[wall.id()] == ("Shell", "")


@pytest.mark.parametrize(
    ("kind", "attribute"),
    [
        ("IfcRelDefinesByType", "RelatingType"),
        ("IfcRelDefinesByType", "RelatedObjects"),
        ("IfcRelDefinesByProperties", "RelatingPropertyDefinition"),
        ("IfcRelDefinesByProperties", "RelatedObjects"),
        ("IfcPropertySingleValue", "Name"),
    ],
)
def test_a_damaged_relation_takes_nothing_from_the_others(kind: str, attribute: str) -> None:
    """A file of another program may have `$` where the schema wants something."""
    house = two_rooms()
    types = [house.box("IfcWallType", name, (0, 0, 0, 1, 1, 1)) for name in ("one", "other")]
    for number, (wall, type_) in enumerate(zip(("north", "west"), types, strict=True)):
        thing = house.things[wall]
        with_phases(house, thing, "Dates", {"Start": "2024-01-01", f"Mark {number}": "7"})
        with_phases(house, type_, "Phasing", {"Phase Created": "Shell"})
        ifcopenshell.api.type.assign_type(house.model, related_objects=[thing], relating_type=type_)
    setattr(house.model.by_type(kind)[-1], attribute, None)
    model = ifcopenshell.file.from_string(house.model.to_string())
    assert phases_by_product(model)[house.things["north"].id()] == ("Shell", "")
    assert house.things["north"].id() in tasks_by_product(model)


def test_a_schedule_of_another_model_is_reported_as_a_warning(read: Read, tmp_path: Path) -> None:
    path = tmp_path / "work.csv"
    path.write_text("guid,finish\nsomewhere-else,2024-01-01\n")
    floor = read(two_rooms(), date="2024-03-01", schedule=path)
    (told,) = [item for item in floor.findings if item.code == "schedule_unrelated"]
    assert told.rank == Rank.GRAVE
    assert "none of the schedule's 1 GlobalIds is in the model" in told.message


def test_a_schedule_whose_global_ids_lost_their_capitals_is_reported_as_unrelated(
    read: Read, tmp_path: Path
) -> None:
    house = two_rooms()
    path = tmp_path / "work.csv"
    rows = [f"{thing.GlobalId.swapcase()},2024-01-01" for thing in house.things.values()]
    path.write_text("\n".join(["guid,finish", *rows]))
    floor = read(house, date="2023-03-01", schedule=path)
    (told,) = [item for item in floor.findings if item.code == "schedule_unrelated"]
    assert "or were its capitals changed?" in told.message


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n1,2\n", "no column for the guid; say which with --schedule-column guid=NAME"),
        ("guid,task\n1,2\n", "no column for the finish; say which with"),
        ("guid,finish\nx,soon\n", "line 2: finish = 'soon' is no day; write days as YYYY-MM-DD"),
        ("guid,finish\nx,31-13-2024\n", "line 2: finish = '31-13-2024' is no day"),
        ("guid,finish\nx,3/4/2024\n", "'3/4/2024' may be day/month or month/day"),
        ("guid,finish\nx,03-04-2024\n", "'03-04-2024' may be day/month or month/day"),
        ("guid,finish\nx,24-02-01\n", "line 2: finish = '24-02-01' may be day/month/year or year/month/day"),
        ("guid,finish\nx,\ny,5/4/24\n", "line 3: finish = '5/4/24' may be day/month/year or month/day/year"),
        ("guid,finish\nx,24-02-01\nx,45-02-01\nx,01-02-45\n", "'45-02-01' is no day"),
        ("guid,finish\nx,1.2.202\n", "line 2: finish = '1.2.202' is no day; write days as YYYY-MM-DD"),
        ("guid,finish\nx,1.2.4\n", "line 2: finish = '1.2.4' is no day"),
        ("guid,finish\n,2024-01-01\n", "no row has a GlobalId"),
        ("", "is empty; give a CSV"),
    ],
)
def test_a_schedule_that_cannot_be_used_is_refused_by_line(
    text: str, said: str, read: Read, tmp_path: Path
) -> None:
    path = tmp_path / "work.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read(two_rooms(), date="2024-03-01", schedule=path)


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        (["01.02.24"], ["2024-02-01"]),
        (["31-5-2024"], ["2024-05-31"]),
        (["2/13/2024", "3/4/2024"], ["2024-02-13", "2024-03-04"]),
        (["24-02-01", "45-02-01"], ["2024-02-01", "2045-02-01"]),
        (["24-02-01", "01-02-45"], ["2001-02-24", "2045-02-01"]),
        (["24-02-01", "13-02-2024"], ["2001-02-24", "2024-02-13"]),
        (["24-02-24", "2024-2-1 07:00"], ["2024-02-24", "2024-02-01"]),
    ],
)
def test_the_days_of_a_schedule_show_the_order_in_which_they_are_written(
    written: list[str], meant: list[str], tmp_path: Path
) -> None:
    """`24-02-01` alone was read as 2001-02-24."""
    path = tmp_path / "work.csv"
    path.write_text("\n".join(["guid,finish", *(f"{number},{day}" for number, day in enumerate(written))]))
    tasks = read_timetable(path, {}).tasks
    assert [tasks[str(number)][0].finish for number in range(len(written))] == meant


def test_tasks_are_read_as_of_the_end_of_the_day() -> None:
    build = Task("build", "2024-03-01", "2024-03-31")
    assert status_on("2024-02-29", (build,)) == "not_started"
    assert status_on("2024-03-01", (build,)) == "in_progress"
    assert status_on("2024-03-31", (build,)) == "built"
    assert status_on("2024-03-31", (build, Task("paint", "2024-05-01", "2024-05-02"))) == "in_progress"
    assert status_on("2024-01-01", ()) == "built"


def test_a_removal_ends_what_stands() -> None:
    tear_down = Task("tear down", "2024-03-01", "2024-03-31", removes=True)
    assert status_on("2024-02-01", (tear_down,)) == "built"
    assert status_on("2024-03-02", (tear_down,)) == "in_progress"
    assert status_on("2024-03-31", (tear_down,)) == "removed"
