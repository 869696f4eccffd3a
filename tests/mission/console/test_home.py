"""A user without a home, as in a container, and one whose home may not be entered."""

from __future__ import annotations

import getpass
import os
from pathlib import Path

import pytest

from stopgo.bridge.station.station import whoami
from stopgo.mission.console.state_folder import NO_HOME, have_home, state_folder

pytestmark = pytest.mark.skipif(os.name != "posix", reason="users of Windows have a profile")


def homeless() -> Path:
    raise RuntimeError("Could not determine home directory.")


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of temporary files; a home that is set here ends with the test."""
    monkeypatch.delenv("XDG_STATE_HOME", raising=False)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path / "kept"))
    return tmp_path


def test_a_user_without_a_home_gets_a_private_one(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(Path, "home", homeless)
        have_home()
    home = Path(os.environ["HOME"])
    assert home.parent == place
    assert home.stat().st_mode & 0o777 == 0o700
    assert state_folder() == home / ".local" / "state" / "stopgo"


def test_a_folder_that_others_can_enter_is_no_home(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another user may have made it, with settings of their own."""
    made = place / f"stopgo-home-{os.getuid()}"
    made.mkdir()
    made.chmod(0o755)
    monkeypatch.setattr(Path, "home", homeless)
    have_home()
    assert os.environ["HOME"] == NO_HOME
    made.rmdir()
    made.symlink_to(place)
    have_home()
    assert os.environ["HOME"] == NO_HOME


def test_a_home_that_may_not_be_entered_is_none(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (place / "kept").mkdir()
    have_home()
    assert os.environ["HOME"] == str(place / "kept")
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    have_home()
    assert os.environ["HOME"] == str(place / f"stopgo-home-{os.getuid()}")


@pytest.mark.parametrize("refusal", [KeyError("getpwuid(): uid not found"), OSError("No username set")])
def test_a_user_without_a_name_commands_by_number(
    refusal: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nameless() -> str:
        raise refusal

    monkeypatch.setattr(getpass, "getuser", nameless)
    assert whoami().startswith(f"user-{os.getuid()}@")
