"""Planning from the page: floors read in processes, variants, stops by hand, and saving as a revision."""

from __future__ import annotations

import errno
import os
import signal
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.mission_json import read
from stopgo.planner.floors.ifc import loading
from stopgo.planner.floors.ifc.extract import main as extract
from stopgo.recordings.catalog import run_index
from stopgo.recordings.page import reviewed
from stopgo.site import planning
from stopgo.site.event_feed import EventFeed
from stopgo.site.kept_variants import kept_variants
from stopgo.site.planning import EditRequest, PlanningRoom, VariantRequest, WorkLane
from stopgo.site.planning_routes import options_json, planning_routes
from stopgo.site.planning_work import (
    DRAWING,
    CommandTask,
    ReadTask,
    VariantTask,
    read_work,
    settings_of,
    variant_work,
)
from stopgo.site.run_pages import RunRoom
from stopgo.site.site_folder import SiteFiles
from tests.planner.floors.ifc.house import two_rooms as house_model
from tests.site.pages import Page, parts_of
from tests.site.two_rooms import two_rooms


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    two_rooms(folder / "house.dxf")
    return folder


@pytest.fixture(scope="module")
def room(place: Path) -> Iterator[PlanningRoom]:
    with kept_variants(place / "state" / "site.variants") as kept:
        made = PlanningRoom(SiteFiles.at(place), EventFeed(), kept, lambda: None)
        yield made
        made.close()


def waited(room: PlanningRoom, number: int) -> dict[str, Any]:
    """Display of a variant on the pages once its process has answered."""
    order = room.variant(number).order
    assert order is not None
    while room.variant(number).shown["state"] in ("waiting", "running"):
        time.sleep(0.02)
    return room.variant(number).shown


def test_a_floor_is_read_with_its_drawing(place: Path) -> None:
    found = read_work(ReadTask(place / "house.dxf", {}), lambda message: None)
    assert (found["about"]["rooms"], found["about"]["openings"]) == (2, 1)
    assert found["about"]["area_m2"] == pytest.approx(32.0)
    assert {layer["kind"] for layer in found["drawing"]["layers"]} == {"floor", "walls", "openings"}
    assert [name for name, _, _ in found["drawing"]["names"]] == ["left", "right"]


def test_a_model_is_read_at_the_storey_that_people_mean(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first with a floor; the page shows the others and how each is chosen."""
    monkeypatch.setattr(loading, "cache_folder", lambda: tmp_path / "models")
    monkeypatch.setattr(loading, "_run", lambda source, out, rest: extract([str(source), str(out), *rest]))
    path = house_model().write(tmp_path / "house.ifc")
    found = read_work(ReadTask(path, {}), lambda message: None)
    assert found["chosen"] == {"storey": "EG"}
    assert [one["options"] for one in found["storeys"]] == [{"storey": "EG"}, {"storey": "OG"}]
    assert found["about"]["rooms"] == 2
    upper = read_work(ReadTask(path, {"storey": "OG"}), lambda message: None)
    assert upper["chosen"] == {"storey": "OG"}


def test_no_answer_names_the_place_of_the_folder(room: PlanningRoom, place: Path) -> None:
    (place / "empty.dxf").write_bytes(b"0\nEOF\n")
    with pytest.raises(InputError) as error:
        room.read("empty.dxf", {})
    assert SiteFiles.at(place).plain(str(error.value)).startswith("empty.dxf: ")


def test_a_variant_of_several_missions_is_refused(tmp_path: Path) -> None:
    """Its report is of all of them; it ended in an unexpected error."""
    options = {"robots": "2", "start": "1,1,0"}
    with pytest.raises(InputError, match="a variant is one mission"):
        variant_work(VariantTask(tmp_path / "house.dxf", options, tmp_path), lambda told: None)


def test_a_plan_is_shown_as_it_grows(place: Path, tmp_path: Path) -> None:
    told: list[dict[str, Any]] = []
    answer = variant_work(VariantTask(place / "house.dxf", {"coverage": "0.8"}, tmp_path), told.append)
    stages = [one["stage"] for one in told]
    assert stages[0] == "FloorPlan"
    assert stages.index("Candidates") < stages.index("Selection") < stages.index("Route")
    route = next(one for one in told if one["stage"] == "Route")
    assert route["length_m"] == pytest.approx(answer["report"]["length_m"])
    assert {"mission.json", "plan.rrd", "plan.svg", "plan.pdf", "drawing.json"} <= {*os.listdir(tmp_path)}


def test_variants_and_stops_by_hand_are_revisions_of_one_mission(room: PlanningRoom, place: Path) -> None:
    first = waited(room, room.plan(VariantRequest(floor="house.dxf")))
    assert first["state"] == "done", first
    saved = room.save(first["number"], "house")
    mission = read(place / saved)
    assert (saved, mission.revision) == ("plans/house/mission.json", 1)
    stop, *others = mission.stops
    moved = waited(room, room.plan(VariantRequest(
        floor="house.dxf", required=((stop.x, round(stop.y + 0.3, 3)), *((one.x, one.y) for one in others)),
        forbidden=((stop.x, stop.y, 0.1),), replaces=saved,
    )))  # fmt: skip
    assert moved["state"] == "done", moved
    room.save(moved["number"], "house")
    again = read(place / saved)
    assert (again.id, again.revision) == (mission.id, 2)
    assert (stop.x, stop.y) not in {(one.x, one.y) for one in again.stops}
    with pytest.raises(NegativeResult, match="another revision"):
        room.save(first["number"], "house")


def test_the_cost_of_a_change_by_hand_is_that_of_the_plan_with_it(room: PlanningRoom) -> None:
    """Coverage agrees exactly; the way is estimated in the order of the tour, so it is at least as long."""
    first = waited(room, room.plan(VariantRequest(floor="house.dxf")))
    drawing = room.drawing(first["number"])
    stop, *others = drawing["stops"]
    spot = (stop["x"], round(stop["y"] + 0.3, 3))
    kept = tuple(one["id"] for one in others)
    cost = room.edit(first["number"], EditRequest(kept=kept, added=(spot,)))
    assert cost["before"]["coverage"] == pytest.approx(first["report"]["coverage"])
    assert cost["before"]["twice"] == pytest.approx(first["report"]["twice"])
    moved = waited(room, room.plan(VariantRequest(
        floor="house.dxf", required=(spot, *((one["x"], one["y"]) for one in others)),
        forbidden=((stop["x"], stop["y"], 0.1),),
    )))["report"]  # fmt: skip
    assert moved["stops"] == cost["after"]["stops"]
    assert cost["after"]["coverage"] == pytest.approx(moved["coverage"])
    assert cost["after"]["twice"] == pytest.approx(moved["twice"])
    assert cost["after"]["length_m"] >= moved["length_m"] - 1e-6
    without = room.edit(first["number"], EditRequest(kept=kept))
    assert without["after"]["coverage"] < cost["after"]["coverage"]
    assert without["after"]["total_s"] < without["before"]["total_s"]
    with pytest.raises(InputError, match="the robot does not fit there"):
        room.edit(first["number"], EditRequest(kept=kept, added=((0.1, 0.1),)))


def test_bad_options_and_a_killed_process_are_one_line(room: PlanningRoom, place: Path) -> None:
    wrong = waited(room, room.plan(VariantRequest(floor="house.dxf", options={"coverage": "much"})))
    assert (wrong["state"], wrong["error"]) == ("failed", "--coverage much: must be a number")
    (place / "broken.dxf").write_bytes(b"0\nSECTION\n")
    assert "broken.dxf" in waited(room, room.plan(VariantRequest(floor="broken.dxf")))["error"]
    with pytest.raises(InputError, match="no such file"):
        room.plan(VariantRequest(floor="../house.dxf".removeprefix("../") + "x"))
    os.kill(room._plans._process.pid, signal.SIGKILL)
    assert waited(room, room.plan(VariantRequest(floor="house.dxf")))["state"] in ("failed", "done")
    assert waited(room, room.plan(VariantRequest(floor="house.dxf")))["state"] == "done"


def test_a_process_that_cannot_start_is_one_line_and_the_next_task_is_tried(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    context = get_context("spawn")

    def refuse(process: object) -> None:
        raise OSError(errno.EAGAIN, "Resource temporarily unavailable")

    monkeypatch.setattr(context.Process, "start", refuse)
    lane = WorkLane()
    for _ in range(2):
        with pytest.raises(InputError, match="no process can be started for it"):
            lane.answer(ReadTask(place / "house.dxf", {}))
    lane.close()


def test_a_variant_is_cancelled(room: PlanningRoom) -> None:
    number = room.plan(VariantRequest(floor="house.dxf"))
    room.cancel(number)
    assert waited(room, number)["state"] == "cancelled"
    (room.variant(number).folder / DRAWING).write_text("{}")  # as if cancelled before the mission was written
    with pytest.raises(InputError, match="no plan to save"):
        room.save(number, "cancelled")


def test_the_twelve_options_and_the_origin_are_options_of_plan() -> None:
    listed = options_json()
    assert [one["key"] for one in listed[12:]] == ["origin"]
    given = {
        "min_views": "2",
        "register": "yes",
        "start": "1,2,90",
        "targets": "walls",
        "robot_radius": "0.3",
        "origin": "47.4,8.5,400,0",
    }
    settings = settings_of(given)
    assert (settings.views, settings.start) == (2, (1.0, 2.0, 90.0))
    assert settings.origin == (47.4, 8.5, 400.0, 0.0)
    assert given.keys() <= {str(one["key"]) for one in listed}


def test_saved_plans_are_listed_and_downloaded(room: PlanningRoom, place: Path, tmp_path: Path) -> None:
    back = RunRoom(SiteFiles.at(place), tmp_path, room.files)
    (mission,) = [one for one in back.listed()["missions"] if one["file"]]
    assert mission["runs"] == []
    assert b"<svg" in back.report(mission["key"])
    for form, begin in {"pdf": b"%PDF", "svg": b"<?xml", "dxf": b"  0", "csv": b"", "json": b"{"}.items():
        assert back.download(mission["file"], form).body.startswith(begin), form
    with pytest.raises(InputError, match="no such form"):
        back.download(mission["file"], "exe")
    secret = back.open_recording(mission["key"])
    assert back.recording_of_secret(secret).startswith(b"RRF2")
    with pytest.raises(InputError, match="too old"):
        back.recording_of_secret("guessed")


def test_a_large_folder_is_listed_by_parts(
    room: PlanningRoom, place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    back = RunRoom(SiteFiles.at(place), tmp_path, room.files)
    assert back.listed()["left"] == 0
    monkeypatch.setattr(run_index, "PART", 1)
    copies = [place / f"copy-{number}.rrd" for number in range(2)]
    plan = (place / back.listed()["missions"][0]["file"]).with_name("plan.rrd")
    try:
        for copy in copies:
            copy.write_bytes(plan.read_bytes())
        assert [back.listed()["left"] for _ in range(2)] == [1, 0]
    finally:
        for copy in copies:
            copy.unlink()


def test_a_recording_that_is_renamed_while_it_is_read_is_read_again(
    room: PlanningRoom, place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the run's that ends: its report had left it out."""
    back = RunRoom(SiteFiles.at(place), tmp_path, room.files)
    (mission,) = [one for one in back.listed()["missions"] if one["file"]]
    plan, looks = (place / mission["file"]).with_name("plan.rrd"), []
    read = reviewed.review

    def renaming(paths: list[Path]) -> Any:
        looks.append(paths)
        if len(looks) == 1:
            plan.rename(plan.with_name("renamed.rrd"))
        return read(paths)

    monkeypatch.setattr(reviewed, "review", renaming)
    try:
        assert b"<svg" in back.report(mission["key"])
    finally:
        plan.with_name("renamed.rrd").rename(plan)
    assert [plan in paths for paths in looks] == [True, False]


def test_a_report_that_would_lack_a_recording_is_refused(
    room: PlanningRoom, place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    back = RunRoom(SiteFiles.at(place), tmp_path, room.files)
    (mission,) = [one for one in back.listed()["missions"] if one["file"]]
    monkeypatch.setattr(
        back, "_files", lambda key: [mission["file"].replace("mission.json", "plan.rrd"), "house.dxf"]
    )
    with pytest.raises(InputError, match=r"house\.dxf"):
        back.report(mission["key"])


@pytest.mark.parametrize(
    ("code", "why"), [(3, ""), (1, "all required targets were visible"), (2, "no floor")]
)
def test_a_follow_up_mission_is_planned_for_an_undecided_run_too(
    code: int, why: str, room: PlanningRoom, place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a run with doubtful stops `replay` ends with 3; what it did not write it names, with the reason."""
    back = RunRoom(SiteFiles.at(place), tmp_path, room.files)
    (mission,) = [one for one in back.listed()["missions"] if one["file"]]
    out = (place / mission["file"]).parent / "follow-up" / "mission.json"

    def answer(task: CommandTask) -> dict[str, Any]:
        if not why:
            out.write_bytes((place / mission["file"]).read_bytes())
        log = (
            f"stopgo: {why}"
            if code == 2
            else f"{out}: not written: {why}\nAcquired."
            if why
            else "Undecided."
        )
        return {"code": code, "log": log}

    monkeypatch.setattr(back, "_lane", SimpleNamespace(answer=answer))
    try:
        if why:
            with pytest.raises(InputError if code == 2 else NegativeResult, match=why):
                back.follow_up(mission["key"])
        else:
            assert back.follow_up(mission["key"])["stops"] == mission["stops"]
    finally:
        out.unlink(missing_ok=True)


def test_a_variant_does_not_replace_a_mission_that_it_was_not_planned_from(
    room: PlanningRoom, place: Path
) -> None:
    """Two variants of a floor have one name on the page; the second took the place of the first."""
    first = waited(room, room.plan(VariantRequest(floor="house.dxf")))
    other = waited(room, room.plan(VariantRequest(floor="house.dxf", options={"coverage": "0.6"})))
    saved = place / room.save(first["number"], "two")
    before = saved.read_bytes()
    with pytest.raises(NegativeResult, match="plans/two: holds another mission; save this one under another"):
        room.save(other["number"], "two")
    assert saved.read_bytes() == before
    assert room.save(first["number"], "two") == "plans/two/mission.json", "saved again, it is the same"
    assert room.save(other["number"], "two-again") == "plans/two-again/mission.json"


def test_of_two_variants_that_are_saved_at_once_in_one_place_the_second_is_refused(
    room: PlanningRoom, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = waited(room, room.plan(VariantRequest(floor="house.dxf")))
    other = waited(room, room.plan(VariantRequest(floor="house.dxf", options={"coverage": "0.6"})))
    refused: list[str] = []

    def save_other() -> None:
        try:
            room.save(other["number"], "at-once")
        except NegativeResult as error:
            refused.append(str(error))

    second = threading.Thread(target=save_other)
    copy = planning.shutil.copyfile

    def copied(source: Path, target: Path) -> object:
        if second.ident is None:
            second.start()
            second.join(1.0)  # it waits for the first one
        return copy(source, target)

    monkeypatch.setattr(planning.shutil, "copyfile", copied)
    saved = place / room.save(first["number"], "at-once")
    second.join()
    assert len(refused) == 1
    assert read(saved).id == read(room.variant(first["number"]).folder / "mission.json").id


def test_a_disk_that_refuses_is_one_line(room: PlanningRoom, place: Path, tmp_path: Path) -> None:
    """It was an internal error for the page, and a traceback on the terminal."""
    made = waited(room, room.plan(VariantRequest(floor="house.dxf")))
    taken = place / "plans" / "taken"
    taken.parent.mkdir(exist_ok=True)
    taken.write_bytes(b"")
    parts = replace(parts_of(tmp_path), folder=SiteFiles.at(place), more=planning_routes(room))
    answer = Page(parts).post(f"/api/plans/{made['number']}/save", {"name": "taken"})
    assert answer.status_code == 400
    assert answer.json()["error"] == (
        "plans/taken: File exists; make room, or let the site write there, and try again"
    )
