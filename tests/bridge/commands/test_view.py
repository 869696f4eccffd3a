"""Watching with the viewer: it opens once, on what is being recorded, or the reason is reported."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from stopgo.commands.bridge_commands import recording
from stopgo.mission.errors import InputError
from stopgo.recordings.runs.field import FieldRecording
from stopgo.recordings.viewing import viewer
from stopgo.recordings.viewing.viewer import Viewed, open_viewer
from tests.bridge.world import corridor


def test_the_viewer_opens_once_on_what_is_being_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    opened: list[str] = []

    def start(address: str) -> None:
        port = int(address.removeprefix("rerun+http://127.0.0.1:").removesuffix("/proxy"))
        socket.create_connection(("127.0.0.1", port)).close()
        opened.append(address)

    with Viewed(FieldRecording(tmp_path / "field.rrd"), start) as record:
        assert not opened
        record.mission(corridor())
        record.mission(corridor(stops=4, revision=2))
    assert len(opened) == 1
    assert (tmp_path / "field.rrd").exists()


def test_without_a_screen_one_line_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer.sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match="no screen"), recording(tmp_path / "f.rrd", None, view=True):
        pass
    with pytest.raises(InputError, match="no screen"):
        open_viewer([tmp_path / "f.rrd"])


def test_to_view_is_to_record(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="with --rrd"), recording(None, None, view=True):
        pass


def test_the_viewer_listens_on_this_machine_only() -> None:
    command = viewer._command(["f.rrd"])
    assert command[1:3] == ["--bind", "127.0.0.1"]
