"""`stopgo import` as a person runs it."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from stopgo.command_line import main
from stopgo.mission.files.mission_json import read
from tests.mission.files.imports.worlds import CAPTURE, command, delay, plan, waypoint, waypoints

Captured = pytest.CaptureFixture[str]
PLAN = plan(waypoint(1), waypoint(2, hold=1), delay(2.5), CAPTURE, delay(90))
TABLE = b"id,x_m,y_m,scan_s\nA,1,1,30\nB,4,1,\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, data in {
        "site.plan": PLAN,
        "site.waypoints": waypoints(waypoint(hold=5)),
        "stops.csv": TABLE,
        "air.plan": plan(command(22, 15), waypoint(hold=5)),
    }.items():
        (tmp_path / name).write_bytes(data)
    (tmp_path / "plan.toml").write_text("[scanner]\nscan_time = 77\n[robot]\nspeed = 0.25\n")
    return tmp_path


def run(arguments: list[str], capsys: Captured) -> tuple[int, str, str]:
    code = main(["import", *arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.mark.parametrize("name", ["site.plan", "site.waypoints", "stops.csv"])
def test_the_mission_passes_its_check(name: str, folder: Path, capsys: Captured) -> None:
    out = str(folder / "mission.json")
    code, said, err = run([str(folder / name), "-o", out], capsys)
    assert code == 0
    assert said.startswith(f"{out}: ")
    assert "stopgo check --floor FLOOR.dxf tests" in err
    assert main(["check", out]) == 0
    mission = read(out)
    assert mission.origin.floor == name
    assert mission.origin.floor_digest == hashlib.sha256((folder / name).read_bytes()).hexdigest()
    assert {(stop.sees.units, stop.sees.new_units) for stop in mission.stops} == {(0, 0)}


def test_what_the_file_does_not_say_comes_from_the_settings(folder: Path, capsys: Captured) -> None:
    out = str(folder / "mission.json")
    options = ["-p", str(folder / "plan.toml"), "--start", "0,1,180"]
    assert run([str(folder / "stops.csv"), "-o", out, *options], capsys)[0] == 0
    mission = read(out)
    assert [stop.scan.duration_s for stop in mission.stops] == [30.0, 77.0]
    assert [stop.scan.timeout_s for stop in mission.stops] == [60.0, 154.0]
    assert mission.robot.speed == 0.25
    assert [stop.approach for stop in mission.stops] == [((0.0, 1.0), (1.0, 1.0)), ((1.0, 1.0), (4.0, 1.0))]
    assert mission.start.heading == pytest.approx(3.141593)
    assert mission.start.reason == "given"
    assert mission.georeference is None


def test_without_a_start_the_robot_starts_at_the_first_place(folder: Path, capsys: Captured) -> None:
    out = str(folder / "mission.json")
    assert run([str(folder / "stops.csv"), "-o", out], capsys)[0] == 0
    mission = read(out)
    assert (mission.start.x, mission.start.y, mission.start.heading) == (1.0, 1.0, 0.0)
    assert mission.stops[0].approach == ((1.0, 1.0),)


def test_json_is_one_object(folder: Path, capsys: Captured) -> None:
    code, said, _ = run([str(folder / "site.plan"), "-o", str(folder / "m.json"), "--json"], capsys)
    assert code == 0
    report = json.loads(said)
    assert (report["imported"], report["stops"]) == ("site.plan", 1)
    assert report["digest"] == read(folder / "m.json").digest
    assert report["route_m"] == pytest.approx(10.0, abs=0.05)


def test_another_import_over_it_is_a_new_revision(folder: Path, capsys: Captured) -> None:
    out = str(folder / "m.json")
    for autopilot, revision in (("ardupilot", 1), ("ardupilot", 1), ("px4", 2)):
        assert run([str(folder / "site.plan"), "-o", out, "--autopilot", autopilot], capsys)[0] == 0
        assert read(out).revision == revision


def test_an_imported_mission_is_exported_again(folder: Path, capsys: Captured) -> None:
    out = str(folder / "m.json")
    assert run([str(folder / "site.plan"), "-o", out], capsys)[0] == 0
    for suffix in (".plan", ".dxf", ".geojson", ".vda5050.json"):
        assert main(["export", out, "-o", str(folder / f"again{suffix}")]) == 0


REFUSED = {
    "aircraft": (["air.plan"], "item 1 (NAV_TAKEOFF 22)"),
    "missing": (["no.plan"], "no.plan: cannot be read"),
    "folder": (["."], "files with this suffix are not read; known: .plan, .waypoints, .csv"),
    "suffix": (["plan.toml"], "files with this suffix are not read"),
    "format": (["site.plan", "--from", "dwg"], "--from dwg: no such format; known: plan"),
    "wrong format": (["site.plan", "--from", "waypoints"], "not 'QGC WPL 110'"),
    "autopilot": (["site.plan", "--autopilot", "kk"], "'kk': unknown"),
    "origin": (["site.plan", "--origin", "1,2"], "write LAT,LON,ALT,HEADING"),
    "start": (["site.plan", "--start", "x"], "write X,Y,HEADING"),
    "settings": (["site.plan", "-p", "stops.csv"], "not a TOML file"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_imported_is_one_line_and_2(
    case: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(folder)
    arguments, words = REFUSED[case]
    code, out, err = run([*arguments, "-o", "m.json"], capsys)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert words in err
    assert not (folder / "m.json").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["site.plan"], ["no --origin"]),
        (["site.waypoints"], ["no --origin", "no --autopilot"]),
        (["site.waypoints", "--origin", "47,8,400,30", "--autopilot", "px4"], []),
    ],
)
def test_what_is_taken_for_granted_is_said(
    arguments: list[str], said: list[str], folder: Path, capsys: Captured
) -> None:
    _, _, err = run([str(folder / arguments[0]), *arguments[1:], "-o", str(folder / "m.json")], capsys)
    assert [word for word in ("no --origin", "no --autopilot") if word in err] == said
