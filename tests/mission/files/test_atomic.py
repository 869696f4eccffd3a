"""A file is written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from stopgo.command_line import main
from stopgo.mission.errors import InputError
from stopgo.mission.files import atomic
from stopgo.mission.files.atomic import replacing, write_atomic
from tests.disk import small_disk


def test_what_is_written_is_there_and_nothing_else(tmp_path: Path) -> None:
    write_atomic(tmp_path / "a.json", b"one")
    write_atomic(tmp_path / "a.json", b"two")
    assert (tmp_path / "a.json").read_bytes() == b"two"
    assert os.listdir(tmp_path) == ["a.json"]


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"folder .*/nowhere does not exist"):
        write_atomic(tmp_path / "nowhere" / "a.json", b"")


def test_a_folder_in_the_place_of_the_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.json").mkdir()
    with pytest.raises(InputError, match="not a regular file"):
        write_atomic(tmp_path / "a.json", b"")


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "real")
    write_atomic(tmp_path / "link", b"one")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"one"


@pytest.mark.parametrize("fault", [KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_a_fault_leaves_the_old_file_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: BaseException
) -> None:
    write_atomic(tmp_path / "a.json", b"old")

    def fail(*_: object) -> None:
        raise fault

    monkeypatch.setattr(atomic.os, "fsync", fail)
    with pytest.raises((KeyboardInterrupt, InputError)) as raised:
        write_atomic(tmp_path / "a.json", b"new")
    if isinstance(fault, OSError):
        assert f"{tmp_path} is writable" in str(raised.value)
        assert "No space left" in str(raised.value)
    assert (tmp_path / "a.json").read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.json"]


def test_a_dash_is_no_file() -> None:
    with pytest.raises(InputError, match="results are written to files"):
        write_atomic("-", b"x")


def test_files_of_one_result_appear_together(tmp_path: Path) -> None:
    (tmp_path / "b").write_bytes(b"old")
    with replacing(tmp_path / "a", tmp_path / "b") as (first, second):
        first.write_bytes(b"new")
        second.write_bytes(b"new")
        assert not (tmp_path / "a").exists()
        assert (tmp_path / "b").read_bytes() == b"old"
    assert sorted(os.listdir(tmp_path)) == ["a", "b"]
    assert (tmp_path / "b").read_bytes() == b"new"


def test_if_one_of_them_finds_no_room_none_changes(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"old")
    with (
        pytest.raises(InputError, match=rf"^{tmp_path}: cannot be written \(File too large\)"),
        replacing(tmp_path / "a", tmp_path / "b") as (first, second),
        small_disk(100),
    ):
        first.write_bytes(b"new")
        second.write_bytes(bytes(101))
    assert os.listdir(tmp_path) == ["a"]
    assert (tmp_path / "a").read_bytes() == b"old"


def test_one_alone_puts_files_in_place_in_a_folder(tmp_path: Path) -> None:
    locks = pytest.importorskip("fcntl")
    other = os.open(tmp_path, os.O_RDONLY)
    with atomic.alone_in(tmp_path), pytest.raises(BlockingIOError):
        locks.flock(other, locks.LOCK_EX | locks.LOCK_NB)
    locks.flock(other, locks.LOCK_EX | locks.LOCK_NB)
    os.close(other)


@pytest.mark.parametrize(
    "command",
    [
        ["floors", "office.dxf", "--picture", "office.dxf"],
        ["floors", "office.dxf", "--write-map", "./office.dxf"],
        ["convert", "office.dxf", "-o", "office.dxf"],
        ["review", "office.dxf", "--html", "office.dxf"],
    ],
)
def test_what_is_read_is_never_written_over(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("office.dxf").write_text("a drawing")
    assert main(command) == 2
    assert "is also an input and would be overwritten" in capsys.readouterr().err
    assert Path("office.dxf").read_text() == "a drawing"
