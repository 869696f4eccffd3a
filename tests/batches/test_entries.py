"""Tests of a batch's file: its entries, and the faults that are known before anything is planned."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from stopgo.batches.batch_file import read_batch, read_day
from stopgo.batches.entries import Entry, Expansion, ModelStorey, expand
from stopgo.mission.errors import InputError
from tests.batches.halls import batch_file

TOWER = [ModelStorey("EG", True), ModelStorey("OG 1", True), ModelStorey("Roof", False, "nothing above it")]


def expanded(folder: Path, text: str, storeys: list[ModelStorey] | InputError = TOWER) -> Expansion:
    for name in ("a.ifc", "b.ifc", "hall.dxf"):
        (folder / name).write_text("")
    groups, problems = read_batch(batch_file(folder, text))
    assert not problems
    models = {folder / name: storeys for name in ("a.ifc", "b.ifc")}
    return expand(groups, models)


def names(found: Expansion) -> list[str]:
    return [entry.name for entry in found.entries]


def only(found: Expansion) -> Entry:
    (entry,) = found.entries
    return entry


def test_every_combination_of_files_storeys_dates_and_matrix_is_an_entry(tmp_path: Path) -> None:
    text = '[[floors]]\nfiles = "*.ifc"\ndates = ["2026-01-01", "2026-02-01"]\nmatrix = {range = [5.0, 8.0]}'
    found = expanded(tmp_path, text)
    assert len(found.entries) == 2 * 2 * 2 * 2
    assert "a/OG-1/2026-02-01/range=8" in names(found)
    assert [entry.settings.range for entry in found.entries[:2]] == [5.0, 8.0]


def test_storeys_left_out_are_named_unless_the_file_chooses(tmp_path: Path) -> None:
    plain = expanded(tmp_path, '[[floors]]\nfiles = "a.ifc"')
    assert names(plain) == ["a/EG", "a/OG-1"]
    assert plain.left_out == (f"{tmp_path / 'a.ifc'}: Roof: nothing above it",)
    chosen = expanded(tmp_path, '[[floors]]\nfiles = "a.ifc"\nstoreys = ["R*"]')
    assert names(chosen) == ["a/Roof"]
    assert not chosen.left_out


def test_options_go_from_the_file_over_the_group_to_the_entry(tmp_path: Path) -> None:
    text = """
[options]
range = 5.0
grid = 2.0
[[floors]]
files = "a.ifc"
options = { range = 6.0 }
override = [{ when = { storey = "O*" }, options = { range = 7.0 } }]
"""
    ground, upper = expanded(tmp_path, text).entries
    assert (ground.settings.range, ground.settings.grid) == (6.0, 2.0)
    assert (upper.settings.range, upper.settings.grid) == (7.0, 2.0)


def test_excluded_entries_are_not_planned(tmp_path: Path) -> None:
    text = '[[floors]]\nfiles = "*.ifc"\nexclude = [{ file = "b*" }, { storey = "EG" }]'
    assert names(expanded(tmp_path, text)) == ["a/OG-1"]


def test_an_included_file_has_its_own_folder_and_the_options_of_its_parent(tmp_path: Path) -> None:
    below = tmp_path / "north"
    below.mkdir()
    (below / "hall.dxf").write_text("")
    (below / "plans.toml").write_text('[[floors]]\nfiles = "hall.dxf"\nname = "north"')
    found = expanded(tmp_path, 'include = ["north/plans.toml"]\n[options]\nrange = 9.0')
    assert only(found).floor == below / "hall.dxf"
    assert only(found).settings.range == 9.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[[floors]]\nfiles = "a.ifc"\nstoreys = ["DG"]', "no storey is called 'DG'; it has: EG, OG 1, Roof"),
        ('[[floors]]\nfiles = "c*.ifc"', "no file has such a name"),
        ('[[floors]]\nfiles = "c.ifc"', "no such file"),
        ('[[floors]]\nfiles = "hall.dxf"\nstoreys = ["EG"]', "has no storeys"),
        ('[[floors]]\nfiles = "hall.dxf"\noptions = { rnge = 5 }', "rnge: no such parameter"),
        ('[[floors]]\nfiles = "hall.dxf"\noptions = { range = "far" }', "--range far"),
        ('[[floors]]\nfiles = "hall.dxf"\n[[floors]]\nfiles = "hall.dxf"', "is also that of"),
    ],
)
def test_a_fault_is_named_with_its_line_before_anything_is_planned(
    tmp_path: Path, text: str, words: str
) -> None:
    (problem,) = expanded(tmp_path, text).problems
    assert words in str(problem)
    line = 3 if "also" in words else 1
    assert str(problem).startswith(f"{tmp_path / 'plans.toml'}: line {line}")


def test_a_variant_that_is_refused_leaves_the_others(tmp_path: Path) -> None:
    found = expanded(tmp_path, '[[floors]]\nfiles = "hall.dxf"\nmatrix = { range = [5.0, -1.0] }')
    assert names(found) == ["hall/range=5"]
    assert "variant range=-1: --range -1" in str(found.problems[0])


def test_a_model_that_cannot_be_read_is_one_line_for_its_group(tmp_path: Path) -> None:
    found = expanded(tmp_path, '[[floors]]\nfiles = "a.ifc"', InputError("a.ifc: is cut off"))
    assert [str(item) for item in found.problems] == [f"{tmp_path / 'plans.toml'}: line 1: a.ifc: is cut off"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "names no floors"),
        ("floor = 3", "unknown field `floor`"),
        ('include = "x"', "include"),
        ("[[floors", "not a TOML file"),
    ],
)
def test_a_file_that_is_no_batch_is_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_batch(batch_file(tmp_path, text))


@pytest.mark.parametrize("table", ['[[floors]]\nname = "x"', "[[floors]]\nfiles = 3", "[[floors]]\nfile=1"])
def test_a_table_that_is_no_floor_is_one_line_and_the_others_are_read(tmp_path: Path, table: str) -> None:
    path = batch_file(tmp_path, f'{table}\n[[floors]]\nfiles = "a.ifc"\nexclude = [{{ floor = "x" }}]')
    groups, problems = read_batch(path)
    assert not groups
    assert [problem.split(": ")[1] for problem in problems] == ["line 1", "line 3"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_no_batch_even_if_somebody_writes_to_it(tmp_path: Path) -> None:
    """Its paths start at its folder, and the file is read more than once."""
    os.mkfifo(tmp_path / "plans.toml")
    end = os.open(tmp_path / "plans.toml", os.O_RDWR)
    os.write(end, b'[[floors]]\nfiles = "a.ifc"\n')
    for read in (read_batch, read_day):
        with pytest.raises(InputError, match="is a pipe, which can be read only once; save it as a file"):
            read(tmp_path / "plans.toml")
    os.close(end)


def test_files_that_include_each_other_are_refused(tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text('include = ["plans.toml"]')
    _, problems = read_batch(batch_file(tmp_path, 'include = ["other.toml"]'))
    assert "is included by itself (plans.toml -> other.toml -> plans.toml)" in problems[0]


def test_dates_without_quotes_are_entries(tmp_path: Path) -> None:
    text = '[[floors]]\nfiles = "a.ifc"\nstoreys = ["EG"]\ndates = [2026-01-01]\n'
    text += "override = [{ when = { date = 2026-01-01 }, options = { range = 7.0 } }]"
    found = expanded(tmp_path, text)
    assert names(found) == ["a/EG/2026-01-01"]
    assert only(found).settings.range == 7.0


def test_a_number_where_a_text_belongs_needs_quotes(tmp_path: Path) -> None:
    _, problems = read_batch(batch_file(tmp_path, '[[floors]]\nfiles = "a.ifc"\nstoreys = [1]'))
    assert problems[0].endswith("storeys[0]: Expected `str`, got `int`; write it in quotes")


def test_a_floor_whose_name_is_no_text_is_one_line_and_the_others_are_planned(tmp_path: Path) -> None:
    """The batch was planned, and then its table could not be written."""
    (tmp_path / os.fsdecode(b"B\xfcro.dxf")).touch()
    found = expanded(tmp_path, '[[floors]]\nfiles = "*.dxf"')
    assert names(found) == ["hall"]
    (problem,) = found.problems
    assert str(problem).endswith("B\ufffdro.dxf: is not UTF-8 text; rename the file or folder")
