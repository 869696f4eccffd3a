"""What an installation relies on: names that others have too, old Pythons, and systems without file locks."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import stopgo
from mission.errors import InputError
from tests.test_house import MODULES

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def other_mission(folder: Path) -> Path:
    """A package of another's that is called as one of our folders."""
    (folder / "mission").mkdir()
    (folder / "mission" / "__init__.py").write_text("")
    return folder


def run(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Code in a fresh Python whose PYTHONPATH has `folder` before the project."""
    path = os.pathsep.join([str(folder), str(ROOT)])
    return subprocess.run(
        [sys.executable, "-c", code, "--version"],
        cwd=folder, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_a_package_of_the_same_name_on_the_path_changes_nothing(tmp_path: Path) -> None:
    done = run("import sys, stopgo; sys.exit(stopgo.main())", other_mission(tmp_path))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip()


def test_a_package_of_the_same_name_that_was_loaded_first_is_told_in_one_line(tmp_path: Path) -> None:
    done = run("import sys, mission, stopgo; sys.exit(stopgo.main())", other_mission(tmp_path))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f"'mission' is taken from {tmp_path / 'mission'}" in done.stderr


def test_an_old_python_gets_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "version_info", (3, 10, 13))
    monkeypatch.setattr(sys, "version", "3.10.13 (main)")
    assert stopgo.main() == 2
    told = capsys.readouterr().err
    assert told == f"stopgo: needs Python 3.11 or newer; this is 3.10.13 ({sys.executable})\n"


def test_without_file_locks_everything_is_importable_and_a_journal_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on Windows, where planning and stations run and robots do not."""
    from bridge.robot import journal

    monkeypatch.setitem(sys.modules, "fcntl", None)
    with pytest.raises(InputError, match="on Linux and macOS only"), journal.open_journal(tmp_path, "r1"):
        raise AssertionError("was opened")


def test_no_module_but_the_journal_knows_of_file_locks() -> None:
    knows = [name for name, path in MODULES.items() if "import fcntl" in path.read_text(encoding="utf-8")]
    assert knows == ["bridge.robot.journal"]


def test_every_folder_is_typed_and_every_extra_of_a_user_is_in_all() -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    assert set(extras) - {"all", "docs", "test"} == set(
        extras["all"][0].partition("[")[2].rstrip("]").split(",")
    )
    for folder in stopgo.FOLDERS:
        assert (ROOT / folder / "py.typed").exists()
