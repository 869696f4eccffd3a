"""`stopgo export` as a person runs it."""

from __future__ import annotations

import json
from pathlib import Path

import ezdxf
import msgspec
import pytest

from stopgo.command_line import main
from stopgo.mission.document import Mission
from stopgo.mission.files import mission_json
from stopgo.mission.files.exports import FORMATS
from stopgo.mission.files.mission_json import read
from stopgo.mission.frames.transform import SiteOrigin
from tests.mission.files.exports.worlds import laboratory

Captured = pytest.CaptureFixture[str]
ZURICH = "47.3769,8.5417,408,30"
SAMPLE = Path(__file__).parents[4] / "recordings" / "samples" / "office.dxf"


@pytest.fixture
def path(tmp_path: Path) -> str:
    """A mission without georeference."""
    mission_json.write(msgspec.structs.replace(laboratory(), georeference=None), tmp_path / "mission.json")
    return str(tmp_path / "mission.json")


@pytest.fixture(scope="module")
def office(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample office, planned in the quickest way."""
    folder = tmp_path_factory.mktemp("office")
    quickly = ["--coverage", "0.5", "--selector", "greedy", "--no-refine", "--no-register", "--grid", "1"]
    assert main(["plan", str(SAMPLE), "-o", str(folder), *quickly]) == 0
    return folder


def exit_of(arguments: list[str], capsys: Captured) -> tuple[int, str, str]:
    code = main(["export", *arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_by_its_suffix(name: str, path: str, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / f"site{FORMATS[name].suffix}"
    origin = ["--origin", ZURICH] if "origin" in FORMATS[name].uses else []
    code, said, _ = exit_of([path, "-o", str(out), *origin, "--json"], capsys)
    assert code == 0
    report = json.loads(said)
    assert (report["format"], report["file"], report["stops"]) == (name, str(out), 3)
    assert report["bytes"] == out.stat().st_size
    assert [file.name for file in tmp_path.iterdir() if file.name.startswith(".")] == []


def test_an_existing_file_is_replaced_whole(path: str, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "site.csv"
    out.write_bytes(b"old" * 100_000)
    assert exit_of([path, "-o", str(out)], capsys)[0] == 0
    assert out.read_bytes().startswith(b"number,id,")
    assert b"old" not in out.read_bytes()


def test_an_origin_given_to_the_export_is_not_written_back(
    path: str, tmp_path: Path, capsys: Captured
) -> None:
    before = Path(path).read_bytes()
    assert exit_of([path, "-o", str(tmp_path / "a.plan"), "--origin", ZURICH], capsys)[0] == 0
    assert Path(path).read_bytes() == before


def test_a_map_turns_the_poses(path: str, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "w.nav2.yaml"
    assert exit_of([path, "-o", str(out), "--map", "10,0,90"], capsys)[0] == 0
    assert "pose: [5.875000, 3.250000, 0.0]" in out.read_text()


REFUSED = {
    "no georeference": (["-o", "x.plan"], "--origin LAT,LON,ALT,HEADING"),
    "unknown suffix": (["-o", "x.dwg"], ".plan, .waypoints, .dxf"),
    "unknown format": (["-o", "x.csv", "--to", "dwg"], "known: plan"),
    "useless option": (["-o", "x.csv", "--map", "1,2,3"], "--map: not used by table of stops"),
    "another useless option": (["-o", "x.dxf", "--autopilot", "px4"], "--autopilot: not used by DXF drawing"),
    "settling of none": (
        ["-o", "x.csv", "--settle-item", "hold"],
        "--settle-item: not used by table of stops",
    ),
    "strange settling": (["-o", "x.plan", "--settle-item", "kk"], "--settle-item kk: one of delay, hold"),
    "coverage of none": (
        ["-o", "x.csv", "--coverage-file", "c.json"],
        "--coverage-file: not used by table of",
    ),
    "origin of three": (["-o", "x.csv", "--origin", "1,2,3"], "write LAT,LON,ALT,HEADING"),
    "origin of words": (["-o", "x.csv", "--origin", "here"], "write LAT,LON,ALT,HEADING"),
    "origin beyond the pole": (["-o", "x.csv", "--origin", "91,0,0,0"], "latitude must be within"),
    "origin of nan": (["-o", "x.csv", "--origin", "nan,0,0,0"], "finite"),
    "map of nan": (["-o", "x.mcap", "--map", "nan,0,0"], "write X,Y,HEADING"),
    "strange autopilot": (["-o", "x.plan", "--autopilot", "kk"], "--autopilot kk: one of ardupilot"),
    "strange trigger": (["-o", "x.plan", "--trigger", "kk"], "--trigger kk: one of auto, script"),
    "trigger of none": (["-o", "x.csv", "--trigger", "auto"], "--trigger: not used by table of stops"),
    "floor missing": (["-o", "x.dxf", "--floor", "no.dxf"], "no.dxf: cannot be read"),
    "floor no dxf": (["-o", "x.dxf", "--floor", "README.md"], "only over a .dxf"),
    "floor of another mission": (["-o", "x.dxf", "--floor", str(SAMPLE)], "is not the floor that"),
    "coverage missing": (["-o", "x.dxf", "--coverage-file", "no.json"], "no.json: cannot be read"),
    "folder missing": (["-o", "no/x.csv"], "does not exist"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_exported_is_one_line_and_2(case: str, path: str, capsys: Captured) -> None:
    arguments, words = REFUSED[case]
    code, out, err = exit_of([path, *arguments], capsys)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert words in err
    assert not Path("x.plan").exists()


def test_the_mission_itself_is_never_overwritten(path: str, capsys: Captured) -> None:
    before = Path(path).read_bytes()
    code, _, err = exit_of([path, "-o", path, "--to", "csv"], capsys)
    assert code == 2
    assert "is also an input and would be overwritten" in err
    assert Path(path).read_bytes() == before


@pytest.mark.parametrize("name", ["room.dxf", "coverage.json"])
def test_neither_floor_nor_coverage_is_overwritten(
    name: str, path: str, tmp_path: Path, capsys: Captured
) -> None:
    given = {"room.dxf": "--floor", "coverage.json": "--coverage-file"}[name]
    (tmp_path / name).write_bytes(b"kept")
    (tmp_path / "link").symlink_to(tmp_path / name)
    arguments = [path, "--to", "dxf", given, str(tmp_path / name)]
    for out in (name, "link"):
        code, _, err = exit_of([*arguments, "-o", str(tmp_path / out)], capsys)
        assert code == 2
        assert "would be overwritten; choose another file" in err
    assert (tmp_path / name).read_bytes() == b"kept"


def test_a_senseless_mission_is_no(path: str, tmp_path: Path, capsys: Captured) -> None:
    robot = msgspec.structs.replace(laboratory().robot, speed=-1.0)
    mission_json.write(msgspec.structs.replace(laboratory(), robot=robot), tmp_path / "bad.json")
    code, _, err = exit_of([str(tmp_path / "bad.json"), "-o", str(tmp_path / "x.csv")], capsys)
    assert code == 1
    assert "$.robot.speed" in err


def test_layers_over_the_sample_office(office: Path, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "site.dxf"
    drawn = ["--floor", str(SAMPLE), "--coverage-file", str(office / "coverage.json")]
    code, _, err = exit_of([str(office / "mission.json"), *drawn, "-o", str(out)], capsys)
    assert (code, err) == (0, "")
    drawing = ezdxf.readfile(out)
    assert not drawing.audit().errors
    assert len(drawing.modelspace().query('INSERT[layer=="SCAN_STOPS"]')) == stops(office)
    assert drawing.modelspace().query('LINE[layer=="SCAN_COVERAGE"]')


def stops(folder: Path) -> int:
    mission: Mission = read(folder / "mission.json")
    return len(mission.stops)


def test_without_a_floor_a_line_says_so(office: Path, tmp_path: Path, capsys: Captured) -> None:
    code, _, err = exit_of([str(office / "mission.json"), "-o", str(tmp_path / "site.dxf")], capsys)
    assert code == 0
    assert "no --floor: the layers stand alone, in metres" in err


def test_an_origin_that_is_not_the_missions_own_is_said(path: str, tmp_path: Path, capsys: Captured) -> None:
    placed = tmp_path / "placed.json"
    here = SiteOrigin(lat=47.0, lon=8.0, alt=0.0, heading_deg=30.0)
    mission_json.write(msgspec.structs.replace(read(path), georeference=here), placed)
    said = exit_of([str(placed), "-o", str(tmp_path / "a.plan"), "--origin", ZURICH], capsys)[2]
    assert "differs from the mission's own georeference 47.0000000,8.0000000,0,30" in said
