"""`stopgo runs` finds every plan and run in a folder, and reads each recording once."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import msgspec
import pytest

from stopgo.command_line import main
from stopgo.recordings.catalog import run_index
from stopgo.recordings.catalog.run_index import (
    INDEX,
    IndexedFile,
    Version,
    index_by_parts,
    index_of,
    index_text,
)
from tests.recordings import run, world


@pytest.fixture(scope="module")
def folder(sighted: Path, skipping: Path, field: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("runs")
    (place / "site").mkdir()
    shutil.copy(sighted, place / "plan.rrd")
    shutil.copy(skipping, place / "site" / "skip.rrd")
    (place / "broken.rrd").write_bytes(b"RRF2junk")
    for number in range(200):
        (place / f"photo-{number}.jpg").touch()
    index_of(place)
    return place


def test_runs_and_plans_are_listed_with_what_they_acquired(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["runs", str(folder), "--json"]) == 0
    out, err = capsys.readouterr()
    told = json.loads(out)
    (found,) = told["runs"]
    assert (found["file"], found["run_id"], found["robot"]) == ("site/skip.rrd", run.RUN, "r1")
    assert (found["scanned"], found["asked"], found["answer"]) == (1, 2, "no")
    assert found["coverage"] == pytest.approx(8 / 14)
    assert found["began_ns"] == run.BEGAN_NS
    assert told["plans"][0]["mission_id"] == world.MISSION_ID
    assert err.count("broken.rrd") == 1
    assert main(["runs", str(folder)]) == 0
    assert "57.1 %" in capsys.readouterr().out


def test_what_is_known_is_not_read_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = index_of(folder)

    def never(*args: object) -> None:
        raise AssertionError("read again")

    monkeypatch.setattr(run_index, "_read", never)
    assert index_of(folder) == before


def test_a_run_that_comes_later_is_compared_with_the_plan_that_is_known(folder: Path, field: Path) -> None:
    late = folder / "late.rrd"
    shutil.copy(field, late)
    try:
        runs = dict(index_of(folder).runs())
        assert runs["late.rrd"].coverage == pytest.approx(11 / 14)
        assert list(runs) == ["late.rrd", "site/skip.rrd"]
    finally:
        late.unlink()
    assert "late.rrd" not in index_of(folder).files


@pytest.mark.parametrize(
    "content", [b"", b"{", b'{"version": 99, "files": {}}', b"\xff\xfe", b'{"later": ' + b"[" * 20_000]
)
def test_an_index_that_cannot_be_read_is_made_again(folder: Path, content: bytes) -> None:
    whole = index_of(folder)
    (folder / INDEX).write_bytes(content)
    assert index_of(folder) == whole
    assert (folder / INDEX).read_bytes() != content


def test_a_recording_that_changed_is_read_again(folder: Path) -> None:
    path = folder / "broken.rrd"
    os.utime(path, (0, 0))
    assert index_of(folder).files["broken.rrd"].changed_ns == 0


def test_a_folder_without_recordings_has_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["runs", str(tmp_path)]) == 0
    assert capsys.readouterr().out == "no runs\n"
    assert main(["runs", str(tmp_path / "none")]) == 2


def test_texts_of_recordings_do_not_reach_the_terminal_as_they_are(folder: Path) -> None:
    assert "\x1b" not in index_text(index_of(folder))


def test_what_is_hidden_is_not_listed(sighted: Path, tmp_path: Path) -> None:
    """The store of a batch holds each of its plans once more; a page of the site may not open it there."""
    for name in (".store/results/plan.rrd", "floor/plan.rrd", "floor/.plan.rrd"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(sighted, tmp_path / name)
    assert list(index_of(tmp_path).files) == ["floor/plan.rrd"]


def test_a_recording_that_is_removed_while_the_folder_is_listed_is_none(
    sighted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(sighted, tmp_path / "plan.rrd")
    stamp_of = run_index.stamp_of

    def removed(path: Path) -> tuple[int, int]:
        path.unlink()
        return stamp_of(path)

    monkeypatch.setattr(run_index, "stamp_of", removed)
    assert not index_of(tmp_path).files


def test_what_is_named_as_a_recording_and_is_no_file_is_reported(
    tmp_path: Path, sighted: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A link whose target was moved away was passed over, as if there had been no run."""
    (tmp_path / "moved.rrd").symlink_to(tmp_path / "away" / "field.rrd")
    os.mkfifo(tmp_path / "pipe.rrd")
    (tmp_path / "folder.rrd").mkdir()
    assert len(index_of(tmp_path).faults()) == 2
    main(["runs", str(tmp_path)])
    errors = capsys.readouterr().err
    assert "moved.rrd: is a link to a file that does not exist" in errors
    assert "pipe.rrd: is a pipe, a socket or a device, not a file" in errors
    assert "folder.rrd" not in errors
    (tmp_path / "away").mkdir()
    shutil.copy(sighted, tmp_path / "away" / "field.rrd")
    assert set(index_of(tmp_path).files) == {"away/field.rrd", "moved.rrd", "pipe.rrd"}
    assert len(index_of(tmp_path).faults()) == 1


def test_a_name_that_is_no_text_does_not_end_the_list(
    tmp_path: Path, sighted: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Archives from other systems hold such names; the index could not be written with one."""
    shutil.copy(sighted, tmp_path / "plan.rrd")
    shutil.copy(sighted, tmp_path / os.fsdecode(b"B\xfcro.rrd"))
    main(["runs", str(tmp_path)])
    shown = capsys.readouterr()
    assert "plan.rrd" in shown.out
    assert "B\ufffdro.rrd: is not UTF-8 text; rename the file or folder" in shown.err
    main(["review", str(tmp_path)])
    assert "B\ufffdro.rrd: is not UTF-8 text; rename the file or folder" in capsys.readouterr().err


def test_a_run_is_compared_again_when_its_plan_comes_and_goes(
    sighted: Path, skipping: Path, tmp_path: Path
) -> None:
    """Its coverage stayed unknown, or that of the plan that had gone."""
    shutil.copy(skipping, tmp_path / "run.rrd")

    def coverage() -> float | None:
        ((_, found),) = index_of(tmp_path).runs()
        return found.coverage

    assert coverage() is None
    shutil.copy(sighted, tmp_path / "plan.rrd")
    assert coverage() == pytest.approx(8 / 14)
    (tmp_path / "plan.rrd").unlink()
    assert coverage() is None


def test_a_large_folder_is_read_by_parts_and_goes_on_where_it_was_ended(
    sighted: Path, skipping: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing was kept before all was read. Files that have plan and run are read at most once more."""
    for number in range(3):
        shutil.copy(skipping, tmp_path / f"run-{number}.rrd")
    shutil.copy(sighted, tmp_path / "plan.rrd")
    for age, name in enumerate(("run-0", "plan", "run-1", "run-2")):
        os.utime(tmp_path / f"{name}.rrd", (age, age))
    monkeypatch.setattr(run_index, "PART", 1)
    index, left = next(index_by_parts(tmp_path))
    assert (list(index.files), left) == (["run-0.rrd"], 3)
    rest = [(sorted(index.files), left) for index, left in index_by_parts(tmp_path)]
    assert [left for _, left in rest] == [3, 2, 1, 0]
    assert rest[0][0] == ["plan.rrd"] and len(rest[-1][0]) == 4
    assert [found.coverage for _, found in index_of(tmp_path).runs()] == pytest.approx([8 / 14] * 3)


def test_a_folder_that_takes_no_index_is_read_to_its_end(
    skipping: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(3):
        shutil.copy(skipping, tmp_path / f"run-{number}.rrd")
    monkeypatch.setattr(run_index, "PART", 1)
    (tmp_path / INDEX).mkdir()
    said: list[str] = []
    assert len(index_of(tmp_path, say=said.append).files) == 3
    assert any(INDEX in line for line in said)
    kept: dict[str, IndexedFile] = {}
    assert [next(index_by_parts(tmp_path, kept=kept))[1] for _ in range(4)] == [2, 1, 0, 0]


def test_threads_that_want_one_index_share_the_work(
    skipping: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the map and the list of a site that begins."""
    for number in range(4):
        shutil.copy(skipping, tmp_path / f"run-{number}.rrd")
    read, counted = run_index._read, []

    def counting(folder: Path, stale: dict[str, run_index.Stamp], others: dict[str, IndexedFile]) -> Any:
        counted.extend(stale)
        return read(folder, stale, others)

    monkeypatch.setattr(run_index, "_read", counting)
    monkeypatch.setattr(run_index, "PART", 1)
    first, second = index_by_parts(tmp_path), index_by_parts(tmp_path)
    assert [next(one)[1] for one in (first, second, first, second)] == [3, 2, 1, 0]
    assert len(counted) == len(set(counted)) == 4


def test_a_later_revision_of_a_plan_reads_no_earlier_run_again(
    sighted: Path, skipping: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As each variant that is saved on the page."""
    shutil.copy(skipping, tmp_path / "run.rrd")
    shutil.copy(sighted, tmp_path / "plan.rrd")
    before = index_of(tmp_path)
    shutil.copy(sighted, tmp_path / "next.rrd")
    later = msgspec.structs.replace(before.files["plan.rrd"].plans[0], revision=2)
    found = msgspec.structs.replace(before.files["plan.rrd"], plans=(later,))
    monkeypatch.setattr(run_index, "_read", lambda folder, stale, others: dict.fromkeys(stale, found))
    assert [left for _, left in index_by_parts(tmp_path)] == [0]


def test_files_with_a_plan_and_a_run_do_not_have_each_other_read_for_ever(
    sighted: Path, skipping: Path, tmp_path: Path
) -> None:
    """A reader that takes one part after the other, as the page does."""
    both, merged = tmp_path / "both.rrd", tmp_path / "merged"
    main(["review", str(sighted), str(skipping), "-o", str(both)])
    merged.mkdir()
    announced: set[Version] = set()
    for name in ("a.rrd", "b.rrd"):
        shutil.copy(both, merged / name)
        left = [next(index_by_parts(merged, announced=announced))[1] for _ in range(4)]
        assert left[-1] == 0, left
    index = index_of(merged)
    assert all(file.plans and file.runs for file in index.files.values())
