"""A turn and a shift from points known in both frames; what does not determine them is refused."""

from __future__ import annotations

import json
import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stopgo.bridge.commands.robot_commands import read_map
from stopgo.command_line import main
from stopgo.mission.errors import InputError
from stopgo.mission.files.coverage_json import read_coverage
from stopgo.mission.files.mission_json import read, write
from stopgo.mission.frames.rigid_fit import rigid_fit
from tests.mission.worlds import square_tour

CORNERS = np.array([(0.0, 0.0), (8.0, 0.0), (8.0, 6.0)])
QUARTER = np.array([(10.0, 5.0), (10.0, 13.0), (4.0, 13.0)])
"""The corners rotated by 90° to the left, then shifted by (10, 5)."""


def test_a_quarter_turn_is_found() -> None:
    fit = rigid_fit(CORNERS, QUARTER)
    assert (fit.transform.x, fit.transform.y) == pytest.approx((10, 5))
    assert math.degrees(fit.transform.heading) == pytest.approx(90)
    assert fit.residuals == pytest.approx([0, 0, 0], abs=1e-12)
    assert fit.scale == pytest.approx(1)


numbers = st.floats(-1e3, 1e3)


@given(x=numbers, y=numbers, heading=st.floats(-3.1, 3.1), far=numbers)
def test_any_turn_and_shift_is_found(x: float, y: float, heading: float, far: float) -> None:
    from stopgo.mission.frames.transform import Transform

    wanted = Transform(x=x, y=y, heading=heading)
    site = CORNERS + far
    there = np.array([wanted.point((px, py)) for px, py in site.tolist()])
    found = rigid_fit(site, there).transform
    back = np.array([found.point((px, py)) for px, py in site.tolist()])
    assert np.abs(back - there).max() < 1e-8


def test_a_point_that_was_noted_wrongly_has_the_largest_residual() -> None:
    square = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)])
    noted = square + np.array([(0.0, 0.0), (0.0, 0.0), (0.1, 0.0), (0.0, 0.0)])
    fit = rigid_fit(square, noted)
    assert int(fit.residuals.argmax()) == 2
    assert fit.max_m < 0.1
    assert fit.rms_m == pytest.approx(math.sqrt((fit.residuals**2).mean()))


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ([(0, 0)], [(1, 1)], "one pair of points: two are needed"),
        ([(1, 1), (1, 1)], [(2, 2), (2, 2)], "too near each other to fix a rotation"),
        ([(0, 0), (0.1, 0)], [(0, 0), (0.1, 0)], "at least 2 m apart"),
        ([(0, 0), (8, 0)], [(0, 0), (8000, 0)], "1000.000 times as far apart"),
        ([(0, 0), (8, 0), (8, 6)], [(0, 0), (-8, 0), (-8, 6)], "the map is mirrored"),
    ],
)
def test_what_shows_no_turn_is_refused(
    first: list[tuple[float, float]], second: list[tuple[float, float]], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        rigid_fit(np.array(first, dtype=float), np.array(second, dtype=float))


def options(site: np.ndarray, there: np.ndarray) -> list[str]:
    pairs = zip(site.tolist(), there.tolist(), strict=True)
    return [f"--pair={x},{y}={mx},{my}" for (x, y), (mx, my) in pairs]


def test_the_command_prints_what_the_robot_takes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["align", *options(CORNERS, QUARTER)]) == 0
    *_, last = capsys.readouterr().out.splitlines()
    taken = read_map(last.removeprefix("--map "))
    assert taken is not None
    assert (taken.x, taken.y, taken.heading) == pytest.approx((10, 5, math.pi / 2))
    (tmp_path / "pairs.csv").write_text("x,y,map_x,map_y\n0,0,10,5\n8,0,10,13\n\n8,6,4,13\n")
    assert main(["align", str(tmp_path / "pairs.csv"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["map"] == last.removeprefix("--map ")
    assert [pair["map_xy"] for pair in told["pairs"]] == QUARTER.tolist()


def test_the_mission_gets_the_transform_on_demand(tmp_path: Path) -> None:
    path = tmp_path / "mission.json"
    write(square_tour(), path)
    assert main(["align", *options(CORNERS, QUARTER), "--mission", str(path), "-o", str(path)]) == 0
    placed = read(path)
    assert placed.frame.to_map is not None
    assert placed.frame.to_map.x == pytest.approx(10)
    assert placed.revision == square_tour().revision + 1
    assert placed.stops == square_tour().stops


def test_a_placed_mission_in_a_file_of_its_own_is_a_later_revision(tmp_path: Path) -> None:
    """A robot that holds the plan takes no other content as that revision; the same place changes none."""
    plan, placed = tmp_path / "mission.json", tmp_path / "placed.json"
    write(msgspec.structs.replace(square_tour(), revision=4), plan)
    for at, revision in ((QUARTER, 5), (QUARTER, 5), (QUARTER + 1.0, 6)):
        assert main(["align", *options(CORNERS, at), "--mission", str(plan), "-o", str(placed)]) == 0
        assert read(placed).revision == revision


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "no points given"),
        (["--pair", "1,2"], "--pair 1,2: write X,Y=MAPX,MAPY"),
        (["--pair", "1,2=3,4=5,6"], "write X,Y=MAPX,MAPY"),
        (["--pair", "nan,2=3,4"], "must be finite numbers"),
        (["none.csv"], "none.csv: cannot be read"),
        (["odd.csv"], "odd.csv: line 2 is '1,2,3': write four numbers"),
        (["--pair", "1,2=3,4", "-o", "x.json"], "give --mission FILE and -o FILE together"),
    ],
)
def test_what_is_no_pair_is_one_line(
    arguments: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "odd.csv").write_text("0,0,1,1\n1,2,3\n")
    assert main(["align", *arguments]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert said in told.err
    assert told.err.count("\n") == 1


SQUARE = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)])


def test_points_that_were_exchanged_fit_no_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Their scale is right and they are not mirrored; residuals of metres came with a result and exit 0."""
    path = tmp_path / "mission.json"
    write(square_tour(), path)
    given = [*options(SQUARE, SQUARE[[0, 1, 3, 2]]), "--mission", str(path), "-o", str(path)]
    assert main(["align", *given]) == 1
    told = capsys.readouterr()
    assert "--map" not in told.out
    assert "the points fit within 7.07 m only" in told.err
    assert read(path) == square_tour()
    assert main(["align", *given, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["map"] is None


def test_points_of_a_map_that_drifts_fit_it() -> None:
    """A fiftieth of the distances is what maps of large buildings are off."""
    noted = 10 * SQUARE + np.array([(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (0.0, 0.0)])
    assert not rigid_fit(10 * SQUARE, noted).is_doubtful


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (SQUARE[:2], "two points cannot show a mistake"),
        (np.array([(0.0, 0.0), (5.0, 0.05), (10.0, 0.0)]), "points on one line cannot show"),
        (SQUARE[[0, 1, 0]], "points on one line cannot show"),
        (CORNERS, ""),
    ],
)
def test_a_mistake_that_the_points_cannot_show_is_named(points: np.ndarray, said: str) -> None:
    unshown = rigid_fit(points, points).unshown
    assert unshown.startswith(said)
    assert bool(unshown) == bool(said)


def test_the_coverage_of_a_plan_is_that_of_the_plan_placed_on_a_map(tmp_path: Path) -> None:
    """Where the map lies changes nothing that a stop sees; whatever else differs is another revision."""
    plan, placed, coverage = tmp_path / "mission.json", tmp_path / "placed.json", tmp_path / "coverage.json"
    write(square_tour(), plan)
    made = read(plan)
    counts = {"units": 1, "visible": 1, "seen": 1, "coverage": 1.0}
    head = {"schema": "stopgo/coverage", "version": 1, "total": counts, "elements": []}
    of = {"id": made.id, "revision": made.revision, "digest": made.digest}
    coverage.write_text(json.dumps({**head, "mission": of}))
    for there in (QUARTER, QUARTER + 1.0):
        assert main(["align", *options(CORNERS, there), "--mission", str(plan), "-o", str(placed)]) == 0
        assert read_coverage(coverage, read(placed)).total.seen == 1
    with pytest.raises(InputError, match="of another revision"):
        read_coverage(coverage, msgspec.structs.replace(read(placed), name="other", digest=""))
