"""`stopgo review --png`: a picture of every view, without a screen; or a line that says what is missing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from stopgo.recordings.drawing import palette
from stopgo.recordings.viewing import headless
from stopgo.recordings.viewing.headless import has_vulkan
from tests.called import stopgo
from tests.recordings import world
from tests.recordings.conftest import write_plan


@pytest.mark.rerun_threads
@pytest.mark.skipif(not has_vulkan(), reason="no Vulkan driver: install mesa-vulkan-drivers")
def test_every_view_is_drawn_to_a_file_of_its_own(plan: Path, field: Path, tmp_path: Path) -> None:
    told = stopgo("review", str(plan), str(field), "--png", str(tmp_path / "views"))
    assert told.returncode == 0, told.stderr
    pictures = sorted((tmp_path / "views").iterdir())
    names = [path.stem.partition("-")[2] for path in pictures]
    assert names[:5] == ["Plan-and-run", "3D", "Report", "Run-run-1", "Plan-report"]
    assert names[-1] == "Log"
    assert len(names) == len(set(names)) == 17
    for path in pictures:
        assert Image.open(path).convert("RGB").getcolors(10) is None, f"{path} has no more than 10 colours"
    sight = next(path for path in pictures if "What-a-candidate-sees" in path.name)
    pixels = np.asarray(Image.open(sight).convert("RGB")).astype(int)
    off = np.abs(pixels - palette.EYE[:3]).max(axis=2)
    assert (off < 40).sum() > 20, "drawn where its timeline ends: the candidate is there"


def test_without_a_driver_it_says_which_to_install(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(headless, "has_vulkan", lambda: False)
    told = stopgo("review", str(plan), "--png", str(tmp_path / "views"))
    assert (told.returncode, told.stdout) == (2, "")
    assert "mesa-vulkan-drivers" in told.stderr
    assert not (tmp_path / "views").exists()


def test_without_a_viewer_it_says_so(plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(headless, "VIEWER", tmp_path / "none")
    told = stopgo("review", str(plan), "--png", str(tmp_path / "views"))
    assert told.returncode == 2
    assert "no Rerun viewer" in told.stderr


@pytest.mark.rerun_threads
def test_a_viewer_that_ends_at_once_is_reported(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ending = tmp_path / "ending"
    ending.write_text("#!/bin/sh\nexit 7\n")
    ending.chmod(0o755)
    monkeypatch.setattr(headless, "VIEWER", ending)
    monkeypatch.setattr(headless, "has_vulkan", lambda: True)
    told = stopgo("review", str(plan), "--png", str(tmp_path / "views"))
    assert told.returncode == 2
    assert "ended with code 7" in told.stderr


def test_a_folder_that_is_a_file_is_refused(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(headless, "has_vulkan", lambda: True)
    (tmp_path / "views").touch()
    told = stopgo("review", str(plan), "--png", str(tmp_path / "views"))
    assert told.returncode == 2
    assert "views" in told.stderr and len(told.stderr.splitlines()) == 1


def test_recordings_of_two_missions_are_not_drawn_as_one(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(world, "MISSION_ID", "f" * 32)
    other = write_plan(tmp_path / "other.rrd")
    told = stopgo("review", str(plan), str(other), "--png", str(tmp_path / "views"))
    assert told.returncode == 2
    assert "of 2" in told.stderr
