"""Names of missions, stops and commanders move no cursor, forge no line and become no path."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest

from stopgo.bridge.station import session_link
from stopgo.bridge.station import station as stations
from stopgo.bridge.station.station import Station
from stopgo.command_line import main
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.files.file_name import file_name
from stopgo.mission.files.mission_json import write
from stopgo.mission.run.events import Scanned
from tests.bridge.world import Field, corridor

FORGED = "r1: FINISHED; forged"
HOSTILE = f"x\x1b[31m\x1b]0;title\x07\u202egnp.exe\u2066\u0085\u2028\r\n{FORGED}\n\x9b2J"
PATHS = ("../../../etc/passwd", "/etc/passwd", "..", "a/../b", "\x00", ".hidden", "con\\nul")


def hostile() -> Mission:
    """A mission whose words were chosen by somebody who means harm."""
    mission = corridor(stops=len(PATHS) + 1)
    names = (HOSTILE, *PATHS)
    stops = tuple(
        msgspec.structs.replace(stop, id=name) for stop, name in zip(mission.stops, names, strict=True)
    )
    return with_digest(msgspec.structs.replace(mission, name=HOSTILE, stops=stops))


@pytest.fixture
def field(monkeypatch: pytest.MonkeyPatch) -> Field:
    """A robot that every command of this process reaches, as a commander of that kind."""
    field = Field()

    @contextmanager
    def connect(endpoint: str, **options: Any) -> Iterator[Station]:
        yield field.station(commander=HOSTILE)

    monkeypatch.setattr(stations, "connect", connect)
    monkeypatch.setattr(session_link, "connect", connect)
    return field


def check_harmless(text: str) -> None:
    assert all(letter.isprintable() for letter in text.replace("\n", ""))
    assert not any(line.startswith(FORGED) for line in text.split("\n"))


def test_no_command_lets_hostile_text_reach_the_terminal(
    field: Field, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "mission.json"
    write(hostile(), path)
    said = 0
    for words in (
        ("push", str(path)), ("status",), ("start",), ("status",), ("pause",), ("pause",), ("resume",),
        ("skip", "--stop", HOSTILE), ("skip", "--stop", "../../.."), ("home",), ("abort",), ("retry",),
        ("push", str(path), "--as", HOSTILE), ("status", "--site", HOSTILE), ("status", "--keys", HOSTILE),
        ("keys", "issue", "station", HOSTILE, "--in", str(tmp_path)), ("keys", "list", HOSTILE),
    ):  # fmt: skip
        own = () if words[0] == "keys" else ("--robot", "r1")
        main([*words, *own])
        out, err = capsys.readouterr()
        check_harmless(out)
        check_harmless(err)
        said += bool(out or err)
    assert said > 10
    field.order("start", again=True, from_here=True, take_over=True)
    field.work()
    state = field.station().status()
    events = field.journal.events()
    monkeypatch.setattr(Station, "reports", lambda self: iter((state, *events, state)))
    for more in ((), ("--json",)):
        main(["watch", "--robot", "r1", *more])
        out, err = capsys.readouterr()
        assert "Scanned" in out + err
        check_harmless(out)
        check_harmless(err)


def test_a_scan_is_a_file_in_its_folder_whatever_its_stop_is_called(field: Field) -> None:
    field.station().push(hostile())
    field.order("start")
    field.work()
    files = [event.file for event in field.journal.events() if isinstance(event, Scanned)]
    assert len(files) == len(set(files)) == len(PATHS) + 1
    for name in files:
        assert (Path("/scans") / name).resolve().parent == Path("/scans")
        check_harmless(name)


@pytest.mark.parametrize("text", [*PATHS, HOSTILE, "", ".", "x" * 1000, "\ud800", "S 1", "S_1"])
def test_a_files_name_is_a_name_and_never_that_of_another_text(text: str) -> None:
    name = file_name(text)
    assert Path(name).name == name
    assert 0 < len(name) <= 110
    assert not name.startswith((".", "-"))
    others = ("a_.._b", "_", "S_1", "etc_passwd")
    assert all(file_name(other) != name for other in others if other != text)


def test_a_plain_name_stays_as_it_is() -> None:
    assert [file_name(text) for text in ("s1", "S12", "room-3.b_2")] == ["s1", "S12", "room-3.b_2"]
