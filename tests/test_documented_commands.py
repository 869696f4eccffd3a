"""Every command of the guides is one: its verb, its options and what they need are known."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.exceptions import TyperException

from stopgo.command_line import front_door

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("README.md"), *ROOT.glob("docs/**/*.md")])
BLOCK = re.compile(r"^```[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
PROMPT = re.compile(r"^(?:\w+)?\$ +")


def commands_of(page: Path) -> Iterator[str]:
    """Whole command lines in the blocks of a page, without their prompts and comments."""
    for block in BLOCK.findall(page.read_text(encoding="utf-8")):
        for line in block.replace("\\\n", " ").splitlines():
            words = PROMPT.sub("", line.strip())
            if words.startswith("stopgo "):
                yield words


def parsed(words: list[str]) -> None:
    """Parse a command line as the front door does, and run nothing."""
    command, context = front_door(), None
    while True:
        context = command.make_context(words[0], words[1:], parent=context)
        words = [*context._protected_args, *context.args] if hasattr(command, "commands") else []
        if not words:
            return
        command = command.commands[words[0]]


INLINE = re.compile(r"`(stopgo [^`\n]+)`")
ENDS_AT_ONCE = ("--help", "--install-completion", "--print-config", "--version")
"""Options that act while a command line is parsed."""


def named_in(page: Path) -> Iterator[str]:
    """Commands in the text of a page, often without their arguments."""
    text = re.sub(r"^ *```.*?^ *```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    yield from (line for line in INLINE.findall(text) if not any(end in line for end in ENDS_AT_ONCE))


EVERY = [(str(page.relative_to(ROOT)), line) for page in PAGES for line in commands_of(page)]


@pytest.mark.parametrize(("page", "line"), EVERY)
def test_a_documented_command_is_one(page: str, line: str) -> None:
    words = shlex.split(re.split(r" [|&<>]|[^ ]&&| 2>", line)[0], comments=True)
    try:
        parsed([word for word in words if word not in ("[", "]", "…", "...")])
    except TyperException as error:
        pytest.fail(f"{page}: {line}: {error.format_message()}")
    except KeyError as error:
        pytest.fail(f"{page}: {line}: no such command {error}")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_and_options_that_a_page_names_are_known(page: Path) -> None:
    for line in named_in(page):
        words = shlex.split(re.split(r" [|&<>]", line)[0])
        try:
            parsed([word for word in words if word not in ("…", "...")])
        except TyperException as error:
            said = error.format_message()
            assert said.startswith("Missing ") or said.endswith("requires an argument."), f"{line}: {said}"
        except KeyError as error:
            pytest.fail(f"{line}: no such command {error}")
