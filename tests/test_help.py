"""Help of every command: it fits its terminal, shows every option in a group, and names the right one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from typer.core import TyperOption

from stopgo.command_line import COMMANDS, front_door, main
from stopgo.mission.settings import PARAMETERS
from stopgo.mission.settings.parameter import FIRST, GROUPS
from stopgo.option_help import grouped
from stopgo.root_help import COMMAND_GROUPS, root_help

WORDS = [word for commands in COMMAND_GROUPS.values() for word in commands]


def every(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command below one, with the words that name it."""
    for word, made in command.commands.items():
        if hasattr(made, "commands"):
            yield (*path, word), made
            yield from every(made, (*path, word))
        else:
            yield (*path, word), made


EVERY = [path for path, made in every(front_door()) if not made.hidden]


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main([*arguments]) == 0
    return capsys.readouterr().out


def options_of(path: tuple[str, ...]) -> list[TyperOption]:
    made: Any = front_door()
    for word in path:
        made = made.commands[word]
    return [param for param in made.params if isinstance(param, TyperOption)]


def test_the_first_help_has_every_command_once_on_one_screen(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed(capsys, "--help").splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 60
    assert sorted(WORDS) == sorted({path[0] for path in EVERY})
    assert set(WORDS) == {word for words in COMMANDS.values() for word in words} - {"rerun-importer"}
    assert [line.split()[0] for line in lines if line.startswith("  ")] == WORDS


@pytest.mark.parametrize("arguments", [(), ("-h",), ("--help-all",)])
def test_it_is_the_same_however_it_is_asked_for(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]
) -> None:
    assert printed(capsys, *arguments) == f"{root_help()}\n"


@pytest.mark.parametrize("columns", [80, 60])
@pytest.mark.parametrize("path", EVERY, ids=" ".join)
def test_help_fits_the_terminal_and_has_every_option(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, path: tuple[str, ...], columns: int
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    for asked in ("--help", "--help-all") if options_of(path) else ("--help",):
        text = printed(capsys, *path, asked)
        assert max(map(len, text.splitlines())) <= columns
        words = text.replace(",", " ").split()
        assert [option.opts for option in options_of(path) if not {*option.opts} & {*words}] == []


@pytest.mark.parametrize("path", EVERY, ids=" ".join)
def test_a_command_of_many_options_has_them_in_groups(path: tuple[str, ...]) -> None:
    largest = max((len(options) for _, options in grouped(options_of(path))), default=0)
    assert largest <= 18


def test_plan_shows_twelve_options_first_and_the_papers_last(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert all(parameter.group in GROUPS for parameter in PARAMETERS.values())
    titles = [title for title, _ in grouped(options_of(("plan",)))]
    assert titles == [FIRST, *GROUPS]
    assert len(dict(grouped(options_of(("plan",))))[FIRST]) == 12
    short, whole = printed(capsys, "plan", "--help"), printed(capsys, "plan", "--help-all")
    assert len(short.splitlines()) <= 66
    assert "Minimum side of a triangle" in whole
    assert "Minimum side of a triangle" not in short


@pytest.mark.parametrize(
    ("given", "line"),
    [
        (("plann", "f.dxf"), "plann: no such command; the nearest is: stopgo plan"),
        (("xyz",), "xyz: no such command; see: stopgo --help"),
        (("plan", "--overlab", "0.1"), "stopgo plan has no option --overlab; the nearest is --overlap"),
        (("status", "--coverage", "1"), "stopgo status has no option --coverage; it belongs to stopgo plan"),
        (("watch", "--stop", "s1"), "it belongs to stopgo skip, stopgo retry"),
        (("status", "--coverag", "1"), "the nearest is --coverage of stopgo plan"),
        (("keys", "issue", "--dayz", "3"), "stopgo keys issue has no option --dayz; the nearest is --days"),
        (
            ("check", "--d-sec", "1"),
            "stopgo check has no option --d-sec; it is now --clearance of stopgo plan",
        ),
        (("keys", "isue"), "No such command 'isue'. Did you mean 'issue'?"),
        (("--vresion",), "stopgo has no option --vresion; the nearest is --version"),
        (("status", "--qqqq"), "stopgo status has no option --qqqq (see --help)"),
    ],
)
def test_a_wrong_word_names_the_right_one(
    capsys: pytest.CaptureFixture[str], given: tuple[str, ...], line: str
) -> None:
    assert main([*given]) == 2
    told = capsys.readouterr()
    assert line in told.err
    assert told.err.count("\n") == 1
    assert told.out == ""


def test_a_default_names_another_parameter_as_its_option(capsys: pytest.CaptureFixture[str]) -> None:
    text = " ".join(printed(capsys, "plan", "--help-all").split())
    assert "half of --min-door-width" in text
    assert [key for key in PARAMETERS if "_" in key and f" {key}]" in text] == []
