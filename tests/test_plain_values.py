"""Options are converted without pydantic, to the values and with the errors that typer gives."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from typer.exceptions import TyperException
from typer.main import get_command

from stopgo.option_help import GroupedCommand

WORDS = (
    *("", "0", "-0", "7", "007", "-3", "+3", " 3", "3 ", "1_0", "1e3", "3.5", "-0.25", ".5", "5.", "1,5"),
    *("nan", "inf", "-inf", "999999999", "9999999999", "1" * 400, "0.1" + "0" * 300, "0x10", "true", "None"),
    *("٣", "word", "two words", "-", "--", "ü", "a\x00b", "/", "no/such/file", __file__, "tests"),
)
KINDS: dict[str, Any] = {
    "text": str | None,
    "whole": int | None,
    "number": float | None,
    "path": Path | None,
    "texts": list[str] | None,
    "paths": list[Path] | None,
    "share": Annotated[float, typer.Option(min=0.0, max=1.0)],
    "count": Annotated[int, typer.Option(min=1)],
    "megabytes": float,
    "unusual": Annotated[Path | None, typer.Option(exists=True, dir_okay=False)],
    "toggle": bool,
}
DEFAULTS = {"share": 0.5, "count": 2, "megabytes": 512, "toggle": False}


def command(cls: Any = None) -> Any:
    """A command with an option of each kind; of typer's own class if none is given."""
    app = typer.Typer()

    arguments = ", ".join(f"{name}: KINDS[{name!r}] = DEFAULTS.get({name!r})" for name in KINDS)
    scope: dict[str, Any] = {"KINDS": KINDS, "DEFAULTS": DEFAULTS}
    exec(f"def every({arguments}): ...", scope)
    app.command(cls=cls)(scope["every"])
    return get_command(app)


OURS, TYPERS = command(GroupedCommand), command()


def values(made: Any, arguments: list[str]) -> Any:
    """Values of the options, or the error's text."""
    try:
        with made.make_context("every", list(arguments)) as context:
            return {
                name: (type(value), repr(value)) for name, value in context.params.items() if name in KINDS
            }
    except TyperException as error:
        return error.format_message()


@pytest.mark.parametrize("name", KINDS)
def test_a_word_is_the_value_or_the_error_that_typer_makes_of_it(name: str) -> None:
    for word in WORDS:
        given_ = [f"--{name}"] if name == "toggle" else [f"--{name}={word}", f"--{name}=7"]
        assert values(OURS, given_) == values(TYPERS, given_), word
        assert values(OURS, given_[:1]) == values(TYPERS, given_[:1]), word


@given(
    st.sampled_from([name for name in KINDS if name != "toggle"]), st.text("0123456789.-+e _", max_size=12)
)
def test_what_looks_like_a_number_is_read_alike(name: str, word: str) -> None:
    given_ = [f"--{name}={word}"]
    assert values(OURS, given_) == values(TYPERS, given_)


def test_an_unreadable_path_is_typers_to_refuse(monkeypatch: pytest.MonkeyPatch) -> None:
    import os

    real = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.R_OK and real(path, mode))
    given_ = [f"--path={__file__}"]
    assert "is not readable" in values(OURS, given_)
    assert values(OURS, given_) == values(TYPERS, given_)


def test_no_command_loads_pydantic_for_usual_words() -> None:
    code = """
import sys
from stopgo.command_line import main
for line in sys.argv[1:]:
    main(line.split())
    assert "pydantic" not in sys.modules, line
"""
    lines = [
        "--version", "status --help", "plan nothere.dxf --range 8 --robots 2 --start 2.5,3,90",
        "pause --robot r1 --connect nowhere", "review a.rrd b.rrd --json", "keys issue --help-all",
        "robot --name r1 --state nothere --listen nowhere",
        "watch --mavlink nowhere:1", "export nothere.json -o x.plan", "plan --help-all",
    ]  # fmt: skip
    done = subprocess.run([sys.executable, "-c", code, *lines], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-600:]
