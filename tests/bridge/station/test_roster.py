"""A robot that ought to be there and is silent is shown so, with when it was last seen; exit code 1."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.link import zenoh_link
from stopgo.bridge.link.link import Request
from stopgo.bridge.link.memory_link import MemoryLink
from stopgo.bridge.station import fleet as fleets
from stopgo.bridge.station.roster import read_roster
from stopgo.command_line import main
from stopgo.mission.errors import InputError
from tests.bridge.world import Field


@pytest.fixture
def field(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Field:
    """The site's one robot, r1, which every command of this process finds."""
    field = Field()
    field.serve()
    field.link.announce(field.keys.alive)

    @contextmanager
    def connecting(endpoint: str, guard: object, **options: Any) -> Iterator[MemoryLink]:
        yield field.board.link()

    monkeypatch.setattr(zenoh_link, "connecting", connecting)
    monkeypatch.setattr(fleets, "GATHER_S", 0.0)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return field


def status(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, list[dict[str, Any]]]:
    code = main(["status", "--timeout", "0.2", "--json", *words])
    return code, json.loads(capsys.readouterr().out)["robots"]


def test_a_robot_that_was_seen_and_is_gone_is_silent(
    field: Field, capsys: pytest.CaptureFixture[str]
) -> None:
    code, robots = status(capsys)
    assert (code, [(robot["robot"], robot["state"], robot["silent"]) for robot in robots]) == (
        0, [("r1", "IDLE", False)],
    )  # fmt: skip
    field.link.close()
    code, (gone,) = status(capsys)
    assert (code, gone["robot"], gone["state"], gone["silent"]) == (1, "r1", None, True)
    assert gone["last_seen"] is not None
    assert main(["status", "--timeout", "0.2"]) == 1
    assert "r1: NO DATA; IDLE at its last report, 20" in capsys.readouterr().out


def test_a_robot_that_shows_itself_and_does_not_answer_is_silent(
    field: Field, capsys: pytest.CaptureFixture[str]
) -> None:
    field.board.link().announce("sx/1/r2/alive")
    code, robots = status(capsys)
    assert (code, [(robot["robot"], robot["silent"]) for robot in robots]) == (
        1,
        [("r1", False), ("r2", True)],
    )
    assert "found, but r2: no state received within" in robots[1]["trouble"]


def test_a_roster_says_who_is_missed(
    field: Field, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    roster = tmp_path / "robots.toml"
    roster.write_text('robots = ["r1", "r7"]')
    code, robots = status(capsys, "--roster", str(roster))
    assert (code, [(robot["robot"], robot["silent"]) for robot in robots]) == (
        1,
        [("r1", False), ("r7", True)],
    )
    assert status(capsys)[0] == 0


def test_a_robot_that_comes_while_others_are_queried_is_queried_too(
    field: Field, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """It was left out: neither found in time, nor missing from those that were found in the end."""
    roster = tmp_path / "robots.toml"
    roster.write_text('robots = ["r1", "r7"]')
    answer = field.agent._info

    def come(request: Request) -> bytes:
        field.board.link().announce("sx/1/r7/alive")
        return answer(request)

    field.link.serve(field.keys.info, come)
    code, robots = status(capsys, "--roster", str(roster))
    assert (code, [(robot["robot"], robot["silent"]) for robot in robots]) == (
        1, [("r1", False), ("r7", True)],
    )  # fmt: skip
    assert robots[1]["trouble"].startswith("found, but r7: no state received")


def test_a_robot_that_left_for_good_is_forgotten(field: Field, capsys: pytest.CaptureFixture[str]) -> None:
    field.board.link().announce("sx/1/r2/alive")
    assert status(capsys)[0] == 1
    field.board.alive.discard("sx/1/r2/alive")
    assert status(capsys)[0] == 0, "a robot that never answered was never seen"
    field.link.close()
    assert main(["status", "--timeout", "0.2", "--forget", "r1"]) == 2, (
        "nobody shows itself, and none is known"
    )
    assert main(["status", "--timeout", "0.2", "--forget", "r1"]) == 2
    assert "unknown here" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text",
    ["", "robots = []", "robots = 3", 'robots = ["a/b"]', "robots = [1]", "robots", 'x = ["r1"]', "\xff"],
)
def test_a_roster_that_is_none_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "robots.toml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match=r"robots\.toml|robot name"):
        read_roster(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_roster(tmp_path)
