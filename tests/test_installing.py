"""Installations: names that others have too, old Pythons, and systems without file locks."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import ezdxf
import pytest

import stopgo
from stopgo.mission import __version__
from stopgo.mission.errors import InputError
from tests.faults.sizes import FULL
from tests.sources import MODULES

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site-packages that holds what the wheel brings, and a user's packages of our folders' names.

    The short form leaves out pip, and with it the wheel around the same files.
    """
    folder = tmp_path_factory.mktemp("installed")
    tree, site = folder / "tree", folder / "site"
    shutil.copytree(
        ROOT, tree, ignore=shutil.ignore_patterns(".*", "tests", "docs", "build", "demo"), symlinks=True
    )
    pip = ["-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-compile", "--no-deps"]
    by_pip = [*pip, "--no-build-isolation", "--target", str(site), "."]
    built = ["setup.py", "--quiet", "build", "--build-lib", str(site)]
    subprocess.run(
        [sys.executable, *(by_pip if FULL else built)],
        cwd=tree,
        env={**os.environ, "STOPGO_PURE": "yes"},
        check=True,
        capture_output=True,
    )
    for name in stopgo.FOLDERS:
        (site / name).mkdir()
        (site / name / "__init__.py").write_text("OF_THE_USER = True\n")
    return site


def write_hall(path: Path) -> None:
    """Draw a small floor, which takes less time to plan than all is imported in."""
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 6
    ring = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]
    drawing.modelspace().add_lwpolyline(ring, close=True, dxfattribs={"layer": "FLOOR"})
    wall = [(0.0, 4.0), (4.0, 4.0), (4.0, 4.2), (0.0, 4.2)]
    drawing.modelspace().add_lwpolyline(wall, close=True, dxfattribs={"layer": "WALLS"})
    drawing.saveas(path)


def run(code: str, site: Path) -> subprocess.CompletedProcess[str]:
    """Code in a fresh Python that finds `site` before all else that is installed, next to a floor."""
    write_hall(site.parent / "hall.dxf")
    return subprocess.run(
        [sys.executable, "-P", "-c", code],
        cwd=site.parent,
        env={**os.environ, "PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_wheel_holds_one_name(installed: Path) -> None:
    found = {path.name for path in installed.iterdir() if path.suffix != ".dist-info"}
    assert found - set(stopgo.FOLDERS) - {"bin", "__pycache__"} == {"stopgo"}
    for needed in (
        "mission/mission.schema.json",
        "bridge/link/seal.vectors.json",
        "recordings/samples/office.dxf",
    ):
        assert (installed / "stopgo" / needed).is_file()
    assert all((installed / "stopgo" / name / "py.typed").is_file() for name in stopgo.FOLDERS)


THEIRS = f"import {', '.join(stopgo.FOLDERS)}"
OURS = """
import stopgo, sys
before = list(sys.path)
plan = stopgo.plan("hall.dxf")
"""
CHECKS = """
assert sys.path == before, sys.path
assert mission.OF_THE_USER and planner.OF_THE_USER and bridge.OF_THE_USER and recordings.OF_THE_USER
print(len(plan.mission.stops), stopgo.__file__)
"""


@pytest.mark.parametrize(
    "code", [f"{THEIRS}\n{OURS}", f"{OURS}\n{THEIRS}"], ids=["theirs first", "ours first"]
)
def test_packages_of_the_same_names_stay_the_users(installed: Path, code: str) -> None:
    done = run(code + CHECKS, installed)
    assert done.returncode == 0, done.stderr
    stops, place = done.stdout.split()
    assert int(stops) > 0
    assert Path(place).parent == installed / "stopgo"


def test_the_command_next_to_packages_of_the_same_names(installed: Path, tmp_path: Path) -> None:
    code = f"import sys, stopgo; sys.argv = ['stopgo', 'plan', 'hall.dxf', '-o', {str(tmp_path)!r}]\n"
    done = run(f"{THEIRS}\n{code}sys.exit(stopgo.main())", installed)
    assert (done.returncode, (tmp_path / "mission.json").exists()) == (0, True), done.stderr


def test_an_older_installation_next_to_it_changes_nothing(installed: Path, tmp_path: Path) -> None:
    """Of the time when a module `stopgo` stood in site-packages, and the folders below `_stopgo`."""
    site = shutil.copytree(installed, tmp_path / "site")
    (site / "stopgo.py").write_text("raise ImportError('the older stopgo')\n")
    (site / "_stopgo" / "mission").mkdir(parents=True)
    (site / "_stopgo" / "mission" / "__init__.py").write_text("raise ImportError('the older mission')\n")
    assert run(f"{OURS}\n{THEIRS}{CHECKS}", site).returncode == 0


def test_of_two_versions_the_first_on_the_path_is_whole(installed: Path, tmp_path: Path) -> None:
    other = shutil.copytree(installed, tmp_path / "other")
    (other / "stopgo" / "planner" / "__init__.py").write_text("raise ImportError('the other version')\n")
    code = (
        f"import sys; sys.path.append({str(other)!r})\nimport stopgo.planner\nprint(stopgo.planner.__file__)"
    )
    done = run(code, installed)
    assert (done.returncode, done.stdout.strip()) == (
        0,
        str(installed / "stopgo" / "planner" / "__init__.py"),
    )


READ_ONLY = """
import os, sys
site = {site!r}
def refuse(event, arguments):
    writes = event == "open" and isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR)
    if (writes or event in ("os.mkdir", "os.rename", "os.remove")) and str(arguments[0]).startswith(site):
        raise PermissionError(30, "Read-only file system", arguments[0])
sys.addaudithook(refuse)
import stopgo
sys.argv = ["stopgo", "plan", "hall.dxf", "-o", {out!r}]
sys.exit(stopgo.main())
"""


def test_a_read_only_installation_plans(installed: Path, tmp_path: Path) -> None:
    done = run(READ_ONLY.format(site=str(installed), out=str(tmp_path)), installed)
    assert (done.returncode, (tmp_path / "mission.json").exists()) == (0, True), done.stderr
    assert "Traceback" not in done.stderr


def test_an_installation_that_was_cut_off_is_reported_in_one_line(installed: Path, tmp_path: Path) -> None:
    site = shutil.copytree(installed, tmp_path / "site")
    shutil.rmtree(site / "stopgo" / "bridge")
    done = run("import sys, stopgo; sys.exit(stopgo.main())", site)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "is incomplete: no bridge; install it again" in done.stderr


def test_it_runs_from_a_zip_file(installed: Path, tmp_path: Path) -> None:
    whole = Path(shutil.make_archive(str(tmp_path / "site"), "zip", installed))
    code = f"import sys, stopgo; sys.argv = ['stopgo', 'plan', 'hall.dxf', '-o', {str(tmp_path)!r}]\n"
    done = run(f"{code}print(stopgo.__file__)\nsys.exit(stopgo.main())", whole)
    assert (done.returncode, (tmp_path / "mission.json").exists()) == (0, True), done.stderr
    assert done.stdout.startswith(str(whole))


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
    from stopgo.bridge.robot import journal_file

    monkeypatch.setitem(sys.modules, "fcntl", None)
    with (
        pytest.raises(InputError, match="on Linux and macOS only"),
        journal_file.open_journal(tmp_path, "r1"),
    ):
        raise AssertionError("was opened")


def test_only_four_modules_know_of_file_locks() -> None:
    """Where there are none, the first two are refused in one line, plans of one folder do not wait for one
    another, and a site's variants are temporary."""
    knows = [name for name, path in MODULES.items() if "import fcntl" in path.read_text(encoding="utf-8")]
    assert sorted(knows) == [
        "stopgo.bridge.robot.journal_file",
        "stopgo.bridge.station.shared_session",
        "stopgo.mission.files.atomic",
        "stopgo.site.kept_variants",
    ]


def test_every_folder_is_typed_and_every_extra_of_a_user_is_in_all() -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    assert set(extras) - {"all", "test"} == set(extras["all"][0].partition("[")[2].rstrip("]").split(","))
    for folder in stopgo.FOLDERS:
        assert (ROOT / folder / "py.typed").exists()


def test_the_hooks_run_ruff_at_the_pinned_version() -> None:
    pinned = re.search(r"^ruff==(.*)$", (ROOT / "constraints.txt").read_text(encoding="utf-8"), re.MULTILINE)
    hooks = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    assert pinned is not None
    assert f"rev: v{pinned[1]}\n" in hooks


def test_the_workflow_runs_make_test_on_every_promised_system_and_version() -> None:
    workflow = (ROOT / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8")
    assert "os: [ubuntu-latest, macos-latest, windows-latest]" in workflow
    named = [item.rpartition(" ")[2] for item in PROJECT["project"]["classifiers"] if ":: 3." in item]
    assert f"python: {named}".replace("'", '"') in workflow
    assert "run: make test" in workflow


def test_the_version_in_the_code_is_that_of_the_package() -> None:
    assert __version__ == PROJECT["project"]["version"]


def test_the_next_release_in_the_changelog_is_newer_than_the_version() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    following = re.search(r"^## \[(\d+)\.(\d+)\.(\d+)\] - unreleased$", changelog, re.MULTILINE)
    assert following is not None
    assert [int(part) for part in following.groups()] > [
        int(part) for part in PROJECT["project"]["version"].split(".")
    ]
