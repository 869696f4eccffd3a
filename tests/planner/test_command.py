"""`stopgo plan` as a person runs it: what it prints, what it writes, and how it refuses."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import pytest

import stopgo
from stopgo.command_line import main
from stopgo.mission.files import plan_svg
from stopgo.mission.files.mission_json import read
from stopgo.mission.files.plan_toml import read_settings
from stopgo.mission.settings import Settings
from stopgo.plan_files import plan_files
from stopgo.recording_process import RecordingProcess
from tests.disk import small_disk
from tests.faults.sizes import some
from tests.planner.worlds import FLOORS, SHARED

Draw = Callable[["Drawing"], None]
FILES = {"mission.json", "plan.rrd", "plan.svg", "coverage.json"}


class Drawing:
    """A layered DXF in metres."""

    def __init__(self) -> None:
        self.document = ezdxf.new()
        self.document.header["$INSUNITS"] = 6
        self.space = self.document.modelspace()

    def ring(self, layer: str, *points: tuple[float, float]) -> None:
        self.space.add_lwpolyline(points, close=True, dxfattribs={"layer": layer})

    def box(self, layer: str, x0: float, y0: float, x1: float, y1: float) -> None:
        self.ring(layer, (x0, y0), (x1, y0), (x1, y1), (x0, y1))

    def line(self, layer: str, a: tuple[float, float], b: tuple[float, float]) -> None:
        self.space.add_line(a, b, dxfattribs={"layer": layer})


def drawn(path: Path, *more: Draw, door: float = 0.9) -> Path:
    """Two rooms of 4 × 4 m with a door between them, and whatever else is drawn."""
    drawing = Drawing()
    drawing.box("FLOOR", 0, 0, 8, 4)
    for x0, y0, x1, y1 in ((-0.2, -0.2, 8.2, 0), (-0.2, 4, 8.2, 4.2), (-0.2, 0, 0, 4), (8, 0, 8.2, 4)):
        drawing.box("WALLS", x0, y0, x1, y1)
    low, high = 2 - door / 2, 2 + door / 2
    drawing.box("WALLS", 3.9, 0, 4.1, low)
    drawing.box("WALLS", 3.9, high, 4.1, 4)
    drawing.line("DOORS", (4, low), (4, high))
    drawing.box("ROOMS", 0, 0, 3.9, 4)
    drawing.box("ROOMS", 4.1, 0, 8, 4)
    for draw in more:
        draw(drawing)
    drawing.document.saveas(path)
    return path


@pytest.fixture(scope="module")
def two_rooms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return drawn(tmp_path_factory.mktemp("floor") / "floor.dxf")


@pytest.fixture
def floor(two_rooms: Path, tmp_path: Path) -> Path:
    return shutil.copy(two_rooms, tmp_path / "floor.dxf")


Run = tuple[int, str, str]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., Run]:
    def run(*arguments: object) -> Run:
        capsys.readouterr()
        code = main([str(item) for item in arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def one_line(error: str) -> str:
    lines = error.splitlines()
    assert len(lines) == 1, error
    assert "Traceback" not in error
    assert lines[0].startswith("stopgo: ")
    return lines[0]


def left_in(folder: Path) -> set[str]:
    return {path.name for path in folder.rglob("*") if path.is_file()} if folder.exists() else set()


# ---- done ----


def test_a_plan_writes_its_four_files(run: Callable[..., Run], floor: Path, tmp_path: Path) -> None:
    code, out, error = run("plan", floor, "-o", tmp_path / "out")
    assert (code, error) == (0, "")
    assert left_in(tmp_path / "out") == FILES
    assert read(tmp_path / "out" / "mission.json").name == "floor"
    assert "stops" in out


KEYS = {
    "floor": {"name", "area_m2", "rooms", "openings", "findings"},
    "targets": {"total", "raw", "by_kind"},
    "candidates": {"generated", "reachable", "strategy"},
    "visibility": {"visible", "method"},
    "selection": {"stops", "coverage", "bound", "method"},
    "route": {"length_m", "bound_m", "method", "tour"},
    "schedule": {"drive_s", "turn_s", "settle_s", "scan_s", "total_s"},
    "times_s": {"read", "navigable", "candidates", "visibility", "selection", "route", "total"},
    "files": {"mission", "recording", "picture", "coverage"},
}


def test_json_is_one_object_with_the_keys_that_programs_rely_on(
    run: Callable[..., Run], floor: Path, tmp_path: Path
) -> None:
    code, out, error = run("plan", floor, "-o", tmp_path / "out", "--json")
    assert (code, error) == (0, "")
    told = json.loads(out)
    for key, keys in KEYS.items():
        assert keys <= set(told[key]), key
    assert told["unreached"] == []
    assert told["floor"]["area_m2"] == 32.0
    assert told["floor"]["rooms"] == 2
    assert all(Path(path).exists() for path in told["files"].values())
    assert told["selection"]["stops"] == len(read(Path(told["files"]["mission"])).stops)
    assert json.loads(json.dumps(told, allow_nan=False)) == told


def test_the_printed_configuration_reads_back_the_same(run: Callable[..., Run], tmp_path: Path) -> None:
    code, out, _ = run(
        "plan",
        "--print-config",
        "--range",
        7.5,
        "--start",
        "1,2,90",
        "--targets",
        "walls,columns",
        "--coverage",
        0.8,
    )
    assert code == 0
    (tmp_path / "plan.toml").write_text(out)
    expected = Settings(range=7.5, start=(1, 2, 90), targets=("walls", "columns"), coverage=0.8)
    assert read_settings(tmp_path / "plan.toml", {}) == expected
    assert run("plan", "--print-config", "-p", tmp_path / "plan.toml")[1] == out


def test_options_override_the_file(run: Callable[..., Run], floor: Path, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text("[plan]\ncoverage = 0.5\ngrid = 0.8\n")
    code, *_ = run("plan", floor, "-p", tmp_path / "plan.toml", "--grid", 2, "-o", tmp_path / "out")
    assert code == 0
    parameters = read(tmp_path / "out" / "mission.json").origin.parameters
    assert (parameters["coverage"], parameters["grid"]) == (0.5, 2.0)


def test_planning_again_gives_the_same_mission(run: Callable[..., Run], floor: Path, tmp_path: Path) -> None:
    run("plan", floor, "-o", tmp_path / "one")
    before = (tmp_path / "one" / "mission.json").read_bytes()
    run("plan", floor, "-o", tmp_path / "one")
    run("plan", floor, "-o", tmp_path / "two")
    assert (tmp_path / "one" / "mission.json").read_bytes() == before
    assert (tmp_path / "two" / "mission.json").read_bytes() == before


def test_a_narrow_door_is_reported_and_strict_says_no(run: Callable[..., Run], tmp_path: Path) -> None:
    narrow = drawn(tmp_path / "narrow.dxf", door=0.6)
    code, out, _ = run("plan", narrow, "-o", tmp_path / "out", "--json")
    told = json.loads(out)
    assert code == 0
    assert len(told["unreached"]) == 1
    assert "0.600" in json.dumps(told["floor"]["findings"])
    assert run("plan", narrow, "-o", tmp_path / "out", "--strict")[0] == 1
    assert left_in(tmp_path / "out") == FILES


def test_all_parts_are_planned_into_files_of_their_own(run: Callable[..., Run], tmp_path: Path) -> None:
    narrow = drawn(tmp_path / "narrow.dxf", door=0.6)
    code, out, _ = run("plan", narrow, "-o", tmp_path / "out", "--all-parts", "--json")
    assert code == 0
    assert left_in(tmp_path / "out") == FILES | SECOND
    assert len(json.loads(out)["parts"]) == 1
    sides = [
        {stop.x < 4 for stop in read(tmp_path / "out" / name).stops}
        for name in ("mission.json", "mission-2.json")
    ]
    assert sorted(map(sorted, sides)) == [[False], [True]]


SECOND = {"mission-2.json", "plan-2.rrd", "plan-2.svg", "coverage-2.json"}


def test_what_another_plan_left_of_a_second_part_is_renamed_and_reported(
    run: Callable[..., Run], tmp_path: Path
) -> None:
    narrow, out = drawn(tmp_path / "narrow.dxf", door=0.6), tmp_path / "out"
    run("plan", narrow, "-o", out, "--all-parts")
    before = (out / "mission-2.json").read_bytes()
    code, _, error = run("plan", narrow, "-o", out, "--range", 4)
    assert (code, len(error.splitlines())) == (0, 1)
    assert left_in(out) == FILES | {f"{name}.old" for name in SECOND}
    assert all(f"{name}.old" in error for name in SECOND)
    assert (out / "mission-2.json.old").read_bytes() == before
    run("plan", narrow, "-o", out, "--all-parts")
    run("plan", narrow, "-o", out, "--range", 4)
    assert {f"{name}.old2" for name in SECOND} <= left_in(out)


def test_a_second_part_that_the_same_settings_give_again_stays(
    run: Callable[..., Run], tmp_path: Path
) -> None:
    narrow, out = drawn(tmp_path / "narrow.dxf", door=0.6), tmp_path / "out"
    run("plan", narrow, "-o", out, "--all-parts")
    assert run("plan", narrow, "-o", out)[2] == ""
    assert left_in(out) == FILES | SECOND


def test_a_refusal_renames_nothing_and_what_is_no_mission_stays(
    run: Callable[..., Run], tmp_path: Path
) -> None:
    narrow, out = drawn(tmp_path / "narrow.dxf", door=0.6), tmp_path / "out"
    run("plan", narrow, "-o", out, "--all-parts")
    (out / "mission-3.json").write_text("mine")
    assert run("plan", narrow, "-o", out, "--clearance", 3)[0] == 1
    assert left_in(out) == FILES | SECOND | {"mission-3.json"}
    run("plan", narrow, "-o", out, "--range", 4)
    assert (out / "mission-3.json").read_text() == "mine"


@pytest.mark.parametrize("name", ["layered/fzk-haus-eg.dxf"])
def test_a_real_floor_is_planned_by_the_command(run: Callable[..., Run], name: str, tmp_path: Path) -> None:
    assert name in FLOORS
    if not (SHARED / name).exists():
        pytest.skip(f"{SHARED / name} is not there")
    code, out, _ = run("plan", SHARED / name, "-o", tmp_path, "--json")
    assert code == 0
    assert json.loads(out)["selection"]["coverage"] >= 0.9


# ---- odd drawings ----

NAN = float("nan")

ODD: dict[str, Draw] = {
    "a room that crosses itself": lambda d: d.ring("ROOMS", (1, 1), (3, 3), (3, 1), (1, 3)),
    "a room with a spike": lambda d: d.ring("ROOMS", (5, 1), (6, 1), (6, 3), (6, 2), (5, 2)),
    "a floor that crosses itself": lambda d: d.ring("FLOOR", (20, 0), (22, 2), (22, 0), (20, 2)),
    "a floor drawn twice": lambda d: d.box("FLOOR", 0, 0, 8, 4),
    "a hole that touches the floor's outline": lambda d: d.ring("FLOOR", (0, 1), (0.4, 0.9), (0.4, 1.1)),
    "a hole across the floor's outline": lambda d: d.box("FLOOR", 7, 1, 9, 1.5),
    "a floor that touches another in a corner": lambda d: d.box("FLOOR", 8, 4, 9, 5),
    "a wall with a coordinate that is no number": lambda d: d.ring("WALLS", (1, 1), (2, 1), (2, NAN)),
    "a wall that crosses itself": lambda d: d.ring("WALLS", (2, 1), (3, 2), (3, 1), (2, 2)),
    "a door of no length": lambda d: d.line("DOORS", (2, 2), (2, 2)),
    "a wall of no length": lambda d: d.line("WALLS", (2, 2), (2, 2)),
    "a ring of two points": lambda d: d.ring("WALLS", (1, 1), (2, 1)),
    "a beam drawn twice": lambda d: [d.box("BEAMS", 1, 1, 3, 1.2) for _ in range(2)] and None,
    "a room outside the floor": lambda d: d.box("ROOMS", 100, 100, 110, 110),
    "a door outside everything": lambda d: d.line("DOORS", (50, 50), (51, 50)),
    "a door on a solid wall": lambda d: d.line("DOORS", (4, 3), (4, 3.9)),
}


@pytest.mark.parametrize("name", some(list(ODD), every=2))
def test_an_anomalous_drawing_is_planned(run: Callable[..., Run], name: str, tmp_path: Path) -> None:
    code, out, error = run("plan", drawn(tmp_path / "odd.dxf", ODD[name]), "-o", tmp_path / "out", "--json")
    assert (code, error) == (0, "")
    told = json.loads(out)
    assert told["selection"]["stops"] >= 1
    if not any(word in name for word in ("door", "two points", "hole")):
        assert told["floor"]["findings"], "an odd drawing is told of"


# ---- refused ----


def refused(run: Callable[..., Run], code: int, out: Path, *arguments: object) -> str:
    """The one line of a refusal; nothing may be left in `out`."""
    found, printed, error = run("plan", *arguments, "-o", out)
    assert (found, printed) == (code, ""), error
    assert left_in(out) == set()
    return one_line(error)


@pytest.mark.parametrize(
    ("name", "content", "word"),
    [
        ("missing.dxf", None, "no such file"),
        ("empty.dxf", b"", "empty"),
        ("blank.dxf", b" \n\n", "empty"),
        ("picture.dxf", b"\x89PNG\r\n\x1a\n" + bytes(100), "not a DXF"),
        ("text.dxf", b"hello world", "not a DXF"),
        ("floor.pdf", b"%PDF-1.4", "unknown kind"),
        ("drawing.dwg", b"AC1032", "unknown kind"),
    ],
)
def test_a_file_that_is_no_floor_is_2(
    run: Callable[..., Run], name: str, content: bytes | None, word: str, tmp_path: Path
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    line = refused(run, 2, tmp_path / "out", tmp_path / name)
    assert name in line
    assert word in line


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_a_file_cut_off_before_its_entities_end_is_2(
    run: Callable[..., Run], share: float, floor: Path, tmp_path: Path
) -> None:
    data = floor.read_bytes()
    end = data.find(b"ENDSEC", data.find(b"ENTITIES"))
    (tmp_path / "cut.dxf").write_bytes(data[: int(share * end)])
    assert "cut.dxf" in refused(run, 2, tmp_path / "out", tmp_path / "cut.dxf")


def test_a_folder_as_the_floor_is_2(run: Callable[..., Run], tmp_path: Path) -> None:
    (tmp_path / "floor.dxf").mkdir()
    assert "directory" in refused(run, 2, tmp_path / "out", tmp_path / "floor.dxf")


def test_a_floor_farther_away_than_any_mission_may_be_is_2(run: Callable[..., Run], tmp_path: Path) -> None:
    drawing = Drawing()
    for layer in ("FLOOR", "WALLS"):
        drawing.box(layer, 1e9, 0, 1e9 + 8, 4)
    drawing.document.saveas(tmp_path / "far.dxf")
    code, out, error = run("plan", tmp_path / "far.dxf", "-o", tmp_path / "out")
    assert (code, out) == (2, "")
    assert "far: lies 1e+09 m from its origin, and no mission" in error.splitlines()[-1]


@pytest.mark.parametrize("layer", ["FLOOR", "ROOMS", "WALLS"])
def test_a_shape_a_million_kilometres_away_is_2(run: Callable[..., Run], layer: str, tmp_path: Path) -> None:
    far = drawn(tmp_path / "far.dxf", lambda d: d.box(layer, 1e9, 0, 1e9 + 5, 5))
    code, out, error = run("plan", far, "-o", tmp_path / "out")
    assert (code, out) == (2, "")
    name = {"FLOOR": "its outline", "ROOMS": "room-003", "WALLS": "walls-007"}[layer]
    assert f" m across with {name}, more than 5000 m" in error.splitlines()[-1]


@pytest.mark.parametrize(
    "points", [[(0, 0), (8, 0)], [(0, 0), (8, 0), (4, 0)], [(0, 0)], [(0, 0), (NAN, 1), (1, 1)]]
)
def test_a_floor_without_area_is_2(
    run: Callable[..., Run], points: list[tuple[float, float]], tmp_path: Path
) -> None:
    drawing = Drawing()
    drawing.ring("FLOOR", *points)
    drawing.document.saveas(tmp_path / "flat.dxf")
    assert "no closed outline on layer FLOOR" in refused(run, 2, tmp_path / "out", tmp_path / "flat.dxf")


def test_a_drawing_without_a_floor_is_2(run: Callable[..., Run], tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.box("WALLS", 0, 0, 1, 1)
    drawing.document.saveas(tmp_path / "walls.dxf")
    line = refused(run, 2, tmp_path / "out", tmp_path / "walls.dxf")
    assert "FLOOR" in line
    assert "WALLS" in line


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--clearance", "nan"),
        ("--clearance", "-0.1"),
        ("--range", "0"),
        ("--range", "inf"),
        ("--range", "-5"),
        ("--coverage", "0"),
        ("--coverage", "1.5"),
        ("--coverage", "90"),
        ("--d-dis", "0"),
        ("--d-dis", "1e-9"),
        ("--grid", "0.001"),
        ("--grid", "1e300"),
        ("--edge-clearance", "-1"),
        ("--min-door-width", "0"),
        ("--robot-radius", "-0.35"),
        ("--robot-radius", "0"),
        ("--speed", "0"),
        ("--settle", "-1"),
        ("--scan-time", "nan"),
        ("--tolerance", "0"),
        ("--seed", "-1"),
        ("--seed", "many"),
        ("--doors", "ajar"),
        ("--tour", "round"),
        ("--targets", "walls,ghosts"),
        ("--targets", ""),
        ("--start", "1"),
        ("--start", "1,2"),
        ("--start", "a,b,c"),
        ("--start", "nan,1,0"),
        ("--end", "1,2,3"),
        ("--origin", "91,0,0,0"),
        ("--candidates", "stars"),
        ("--candidates", "no.such.module:thing"),
        ("--visibility", "xray"),
        ("--selector", "luck"),
        ("--router", "walk"),
        ("--colour", "red"),
    ],
)
def test_a_value_no_plan_can_be_made_with_is_2(
    run: Callable[..., Run], option: str, value: str, floor: Path, tmp_path: Path
) -> None:
    line = refused(run, 2, tmp_path / "out", floor, f"{option}={value}")
    named = option.strip("-").replace("-", "_")
    assert named in line.replace("-", "_") or value in line


@pytest.mark.parametrize(
    ("toml", "words"),
    [
        ("[plan]\ncolour = 1\n", ("colour",)),
        ("[paint]\nrange = 1\n", ("paint",)),
        ("[plan]\nrange = 5\n", ("range", "scanner")),
        ("range = 5\n", ("range",)),
        ("[plan]\ncoverage = 'most'\n", ("coverage",)),
        ("[plan]\ncoverage = nan\n", ("coverage",)),
        ("[plan]\nstart = [1, 2]\n", ("start",)),
        ("[plan\n", ("TOML",)),
        ("[plan]\nd_sec = 1\nd_sec = 2\n", ("TOML",)),
        ("[plan]\nd_sec = " + "[" * 20_000, ("TOML", "nested too deeply")),
    ],
)
def test_a_bad_plan_toml_is_2(
    run: Callable[..., Run], toml: str, words: tuple[str, ...], floor: Path, tmp_path: Path
) -> None:
    (tmp_path / "plan.toml").write_text(toml)
    line = refused(run, 2, tmp_path / "out", floor, "-p", tmp_path / "plan.toml")
    assert all(word in line for word in words)


def test_a_plan_toml_that_is_not_there_is_2(run: Callable[..., Run], floor: Path, tmp_path: Path) -> None:
    assert "none.toml" in refused(run, 2, tmp_path / "out", floor, "-p", tmp_path / "none.toml")


def test_no_candidate_left_is_1(run: Callable[..., Run], floor: Path, tmp_path: Path) -> None:
    line = refused(run, 1, tmp_path / "out", floor, "--clearance", 3)
    assert "no candidate" in line
    assert "clearance" in line


def test_no_target_is_1(run: Callable[..., Run], floor: Path, tmp_path: Path) -> None:
    line = refused(run, 1, tmp_path / "out", floor, "--targets", "beams")
    assert "no target" in line
    assert "walls" in line


def test_nothing_in_range_is_1(run: Callable[..., Run], floor: Path, tmp_path: Path) -> None:
    assert "--range" in refused(run, 1, tmp_path / "out", floor, "--range", 0.1)


@pytest.mark.parametrize("start", ["4,3.5,0", "0.1,2,0", "-5,2,0", "1e5,1e5,0"])
def test_a_start_where_the_robot_does_not_fit_is_2(
    run: Callable[..., Run], start: str, floor: Path, tmp_path: Path
) -> None:
    assert "start" in refused(run, 2, tmp_path / "out", floor, f"--start={start}")


def test_a_closed_tour_with_an_end_is_2(run: Callable[..., Run], floor: Path, tmp_path: Path) -> None:
    refused(run, 2, tmp_path / "out", floor, "--tour", "closed", "--end", "1,1")


def test_a_file_in_place_of_the_folder_is_2(run: Callable[..., Run], floor: Path, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    code, _, error = run("plan", floor, "-o", tmp_path / "out")
    assert code == 2
    assert "out" in one_line(error)
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.parametrize("name", sorted(FILES))
def test_a_folder_in_place_of_a_file_is_2(
    run: Callable[..., Run], name: str, floor: Path, tmp_path: Path
) -> None:
    (tmp_path / "out" / name).mkdir(parents=True)
    code, _, error = run("plan", floor, "-o", tmp_path / "out")
    assert code == 2
    assert name in one_line(error)
    assert not (tmp_path / "out" / "mission.json").is_file()


def test_a_folder_that_cannot_be_made_is_2(run: Callable[..., Run], floor: Path) -> None:
    code, _, error = run("plan", floor, "-o", "/proc/stopgo")  # where not even root can make one
    assert code == 2
    assert "/proc/stopgo" in one_line(error)


def test_a_folder_under_a_file_is_2(run: Callable[..., Run], floor: Path) -> None:
    code, _, error = run("plan", floor, "-o", floor / "out")
    assert code == 2
    one_line(error)


def test_no_floor_at_all_is_2(run: Callable[..., Run]) -> None:
    code, _, error = run("plan")
    assert code == 2
    assert "floor" in one_line(error)


def test_a_refusal_leaves_an_older_plan_as_it_was(
    run: Callable[..., Run], floor: Path, tmp_path: Path
) -> None:
    run("plan", floor, "-o", tmp_path / "out")
    before = {name: (tmp_path / "out" / name).read_bytes() for name in FILES}
    code, _, error = run("plan", floor, "-o", tmp_path / "out", "--clearance", 3)
    assert code == 1
    one_line(error)
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before


@pytest.mark.parametrize("room", [0, 2_000, 20_000])
@pytest.mark.parametrize("older", [False, True])
def test_a_full_disk_is_2_and_changes_nothing(
    run: Callable[..., Run], floor: Path, tmp_path: Path, room: int, older: bool
) -> None:
    out = tmp_path / "out"
    if older:
        run("plan", floor, "-o", out, "--clearance", 0.8)
    before = {name: (out / name).read_bytes() for name in FILES} if older else {}
    with small_disk(room):
        code, _, error = run("plan", floor, "-o", out)
    assert code == 2
    assert f"{out}: cannot be written (File too large)" in one_line(error)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.parametrize("fault", [RuntimeError, KeyboardInterrupt])
@pytest.mark.parametrize("stage", ["stopgo.planner.routing.route", "stopgo.mission.files.plan_svg.plan_svg"])
def test_a_plan_that_ends_in_the_middle_changes_nothing(
    floor: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: type[BaseException], stage: str
) -> None:
    (tmp_path / "out").mkdir()
    before = {name: b"before" for name in FILES - {"mission.json"}}
    for name, data in before.items():
        (tmp_path / "out" / name).write_bytes(data)

    def fail(*arguments: object, **options: object) -> None:
        raise fault

    monkeypatch.setattr(stage, fail)
    with pytest.raises(fault):
        plan_files(floor, tmp_path / "out", Settings())
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before


@pytest.mark.parametrize("fault", [KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_a_fault_in_a_later_part_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: BaseException
) -> None:
    narrow, out = drawn(tmp_path / "narrow.dxf", door=0.6), tmp_path / "out"
    plan_files(narrow, out, Settings(), all_parts=True)
    before = {path.name: path.read_bytes() for path in out.iterdir()}

    def fail() -> None:
        raise fault

    _before_the_second_part_is_drawn(monkeypatch, fail)
    with pytest.raises(type(fault)):
        plan_files(narrow, out, Settings(range=4.0), all_parts=True)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_files_of_two_plans_into_one_folder_at_once_are_not_mixed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    narrow, out = drawn(tmp_path / "narrow.dxf", door=0.6), tmp_path / "out"
    other = drawn(tmp_path / "other.dxf", door=0.9)
    _before_the_second_part_is_drawn(monkeypatch, lambda: plan_files(other, out, Settings()))
    plan_files(narrow, out, Settings(), all_parts=True)
    assert left_in(out) == FILES | SECOND
    for number in ("", "-2"):
        mission = read(out / f"mission{number}.json")
        coverage = json.loads((out / f"coverage{number}.json").read_text())
        assert mission.origin is not None
        assert mission.origin.floor == "narrow"
        assert coverage["mission"]["digest"] == mission.digest


def _before_the_second_part_is_drawn(monkeypatch: pytest.MonkeyPatch, do: Callable[[], object]) -> None:
    """Call `do` in the middle of a plan of two parts: when the files of its first part are made."""
    pictures: list[object] = []
    draw = plan_svg.plan_svg

    def drawing(*arguments: Any, **options: Any) -> bytes:
        pictures.append(arguments)
        if len(pictures) == 2:
            do()
        return draw(*arguments, **options)

    monkeypatch.setattr(plan_svg, "plan_svg", drawing)


# ---- interrupted ----

INTERRUPTED = """
import os, signal, sys
import stopgo.planner.routing.assemble
from stopgo.command_line import main
from stopgo.mission.files import plan_svg

signal.signal(signal.SIGINT, signal.default_int_handler)  # a background process inherits that it is ignored

def interrupt(*_, **__):
    os.kill(os.getpid(), signal.SIGINT)

stopgo.planner.routing.assemble.assemble = interrupt
sys.exit(main(sys.argv[1:]))
"""


def test_ctrl_c_leaves_nothing_half_written(floor: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, "plan", str(floor), "-o", str(tmp_path / "out")],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 130
    assert "Traceback" not in done.stderr
    told = [line for line in done.stderr.splitlines() if not line.endswith(": running")]
    assert told == ["stopgo: stopped by Ctrl-C"]  # a step that takes long is named before
    assert left_in(tmp_path / "out") == set()


def test_a_plan_is_made_where_recordings_are_not_installed(
    two_rooms: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(stopgo, "recordings", stopgo.recordings)  # and back, whatever is loaded meanwhile
    for name in [name for name in sys.modules if f"{name}.".startswith(("rerun.", "stopgo.recordings."))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["plan", str(two_rooms), "-o", str(tmp_path)]) == 0
    told = capsys.readouterr()
    assert "rerun is not installed" in told.err
    assert "plan.rrd" not in told.out
    assert {path.name for path in tmp_path.iterdir()} == {"mission.json", "plan.svg", "coverage.json"}


@pytest.mark.parametrize("recording", [False, True])
def test_sheets_and_picture_drawn_in_another_process_are_the_same(
    two_rooms: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, recording: bool
) -> None:
    monkeypatch.setattr(RecordingProcess, "is_running", property(lambda _: recording))
    monkeypatch.setattr("stopgo.planner.geometry.side_work.can_fork", lambda: True)
    for many in (0, 10**9):
        monkeypatch.setattr(stopgo.plan_files, "MANY", many)
        assert main(["plan", str(two_rooms), "-o", str(tmp_path / f"{many}"), "--sheets"]) == 0
    for name in ("plan.pdf", "plan.svg"):
        printed = [(tmp_path / f"{many}" / name).read_bytes() for many in (0, 10**9)]
        assert printed[0] == printed[1]


@pytest.mark.parametrize("many", [0, 10**9])
def test_sheets_that_cannot_be_drawn_are_reported_once(
    two_rooms: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    many: int,
) -> None:
    def fail(*_: object, **__: object) -> bytes:
        raise ModuleNotFoundError("No module named 'reportlab'", name="reportlab")

    monkeypatch.setattr(stopgo.plan_files, "MANY", many)
    monkeypatch.setattr("stopgo.mission.files.plan_sheets.plan_pdf", fail)
    monkeypatch.setattr("stopgo.mission.files.plan_sheets.needs_sheets", lambda *_: True)
    assert main(["plan", str(two_rooms), "-o", str(tmp_path)]) == 0
    assert capsys.readouterr().err.count("plan.pdf: not written, reportlab is not installed") == 1
    assert "plan.pdf" not in {path.name for path in tmp_path.iterdir()}


@pytest.mark.parametrize("speed_up", ["1001", "0", "nan"])
def test_a_demo_no_robot_can_run_plans_nothing(
    speed_up: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["demo", "--speed-up", speed_up, "-o", str(tmp_path / "demo")]) == 2
    assert "'--speed-up': Input should be" in capsys.readouterr().err
    assert not (tmp_path / "demo").exists()
