"""`stopgo prove` as a user calls it: its files, its results, and its errors in one line."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import ezdxf
import pytest

from stopgo.recordings.rrd.read import check
from tests.called import stopgo
from tests.disk import small_disk

COARSE = ("--angular-step", "1")


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a floor of one room, and its plan."""
    folder = tmp_path_factory.mktemp("proof")
    drawing = ezdxf.new(units=6)
    inside, outside = [(0, 0), (4, 0), (4, 3), (0, 3)], [(-0.2, -0.2), (4.2, -0.2), (4.2, 3.2), (-0.2, 3.2)]
    space = drawing.modelspace()
    for layer, ring in (("FLOOR", inside), ("ROOMS", inside), ("WALLS", outside), ("WALLS", inside[::-1])):
        space.add_lwpolyline(ring, close=True, dxfattribs={"layer": layer})
    drawing.saveas(folder / "floor.dxf")
    assert stopgo("plan", str(folder / "floor.dxf"), "-o", str(folder)).returncode == 0
    return folder


def prove(folder: Path, *more: str):
    return stopgo("prove", str(folder / "mission.json"), "--floor", str(folder / "floor.dxf"), *COARSE, *more)


def test_a_proof_is_written_read_back_and_reported(planned: Path) -> None:
    told = prove(planned, "--json")
    assert [line for line in told.stderr.splitlines() if not line.endswith(": running")] == []
    answer = json.loads(told.stdout)
    assert told.returncode == (0 if answer["met"] else 1)
    assert answer["network"]["closed"]
    assert {Path(path).name for path in answer["files"].values()} == {"proof.json", "proof.rrd", "proof.html"}
    written = json.loads((planned / "proof.json").read_text(encoding="utf-8"))
    assert written == {key: value for key, value in answer.items() if key != "files"}
    mission = json.loads((planned / "mission.json").read_text(encoding="utf-8"))
    held = check(planned / "proof.rrd")
    assert (held.complete, held.recording_id) == (True, mission["id"])
    assert "/world/proof/clouds/s01" in held.rows
    page = (planned / "proof.html").read_text(encoding="utf-8")
    assert "verification by simulation" in page and mission["digest"] in page


def test_a_damaged_coverage_next_to_the_mission_is_reported(planned: Path, tmp_path: Path) -> None:
    whole = (planned / "coverage.json").read_bytes()
    for name in ("mission.json", "floor.dxf"):
        (tmp_path / name).write_bytes((planned / name).read_bytes())
    (tmp_path / "coverage.json").write_bytes(whole[: len(whole) // 2])
    told = prove(tmp_path)
    assert told.returncode in (0, 1)
    assert "coverage.json: not a coverage.json" in told.stderr and told.stderr.count("\n") == 1
    assert "only the mission's counts are compared with the scans" in told.stderr


@pytest.mark.parametrize("place", [("total",), ("kinds", "walls")])
def test_a_fraction_that_was_raised_is_not_proved(
    place: tuple[str, ...], planned: Path, tmp_path: Path
) -> None:
    """The fraction is of what candidates see, which the simulation of the stops does not count."""
    shutil.copy(planned / "floor.dxf", tmp_path)
    half = ("--fov", "120", "--coverage", "0.5", "--room-coverage", "0", "--kind-coverage", "0")
    assert stopgo("plan", str(tmp_path / "floor.dxf"), "-o", str(tmp_path), *half).returncode == 0
    coverage = json.loads((tmp_path / "coverage.json").read_text())
    row = coverage
    for step in place:
        row = row[step]
    row["coverage"] = 0.9999
    (tmp_path / "coverage.json").write_text(json.dumps(coverage))
    told = prove(tmp_path)
    assert told.returncode == 1
    assert f"coverage $.{'.'.join(place)}.coverage: is 0.9999, but " in told.stderr


@pytest.mark.parametrize(
    ("more", "words"),
    [((), "no blind cone below it (--blind-cone 60"), (("--blind-cone", "60"), "blind cone of 60°")],
)
def test_the_blind_cone_is_the_plans_unless_one_is_given(
    more: tuple[str, ...], words: str, planned: Path, tmp_path: Path
) -> None:
    told = prove(planned, "-o", str(tmp_path), *more)
    assert told.returncode in (0, 1)
    assert words in told.stdout


def test_another_floor_is_refused(planned: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.dxf"
    other.write_bytes((planned / "floor.dxf").read_bytes() + b"999\nanother\n")
    told = stopgo("prove", str(planned / "mission.json"), "--floor", str(other), "-o", str(tmp_path))
    assert (told.returncode, told.stdout) == (2, "")
    assert "is not the floor" in told.stderr and told.stderr.count("\n") == 1
    assert not (tmp_path / "proof.json").exists()


@pytest.mark.parametrize("library", ["embreex", "small_gicp"])
def test_a_missing_library_is_reported_with_its_extra(
    planned: Path, library: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    told = prove(planned)
    assert (told.returncode, told.stdout) == (2, "")
    assert (
        told.stderr == f'stopgo: {library} is not installed; install it with: pip install "stopgo[prove]"\n'
    )


def test_only_scans_without_poses_need_the_matcher(planned: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has no wheels for Windows, 64-bit ARM Linux and the newest Python."""
    monkeypatch.setitem(sys.modules, "kiss_matcher", None)
    assert prove(planned).returncode in (0, 1)
    refused = prove(planned, "--without-poses")
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (2, "", 1)
    assert refused.stderr.startswith("stopgo: --without-poses: kiss-matcher is not installed; ")


@pytest.mark.parametrize(
    ("option", "value"),
    [("--angular-step", "0.0001"), ("--scanner-height", "3"), ("--coverage-file", "none.json")],
)
def test_what_cannot_be_is_one_line(planned: Path, option: str, value: str) -> None:
    told = prove(planned, option, value)
    assert (told.returncode, told.stdout) == (2, "")
    assert told.stderr.count("\n") == 1
    assert option in told.stderr or value in told.stderr


def test_on_a_full_disk_nothing_is_left(planned: Path, tmp_path: Path) -> None:
    with small_disk(2000):
        told = prove(planned, "-o", str(tmp_path))
    assert told.returncode == 2
    assert told.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_reported_before_anything_is_done(planned: Path) -> None:
    told = prove(planned, "-o", str(planned / "floor.dxf"))
    assert told.returncode == 2
    assert "floor.dxf" in told.stderr
