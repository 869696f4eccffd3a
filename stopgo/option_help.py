"""Help of one command: its options in groups, and the nearest option for a wrong one."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from copy import copy
from difflib import get_close_matches
from inspect import cleandoc
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

from stopgo.mission.settings.parameter import FIRST, GROUPS
from stopgo.plain_values import converted_plainly
from stopgo.renamed_options import RENAMED, NewName
from stopgo.root_help import root_help

LONGEST = 30
"""Options of a command whose `--help` describes them all; of more, it only names those of the groups."""
JOINING = "\u2011"
"""Stands for a hyphen while lines are made: no line is broken at it."""
NARROW = 70
"""Below this many columns the options get a smaller part of the width."""

OptionGroup = tuple[str, list[TyperOption]]


class PlainCommand:
    """A command that starts without pydantic; its help breaks no line at a hyphen, since words are copied."""

    help: str | None
    epilog: str | None

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters; their words are converted without a library."""
        made: list[Any] = super().get_params(ctx)  # type: ignore[misc]
        return converted_plainly(made)

    def format_help_text(self, ctx: Any, formatter: Any) -> None:
        """Write what the command does."""
        _write_paragraphs(self.help, formatter)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the example."""
        _write_paragraphs(self.epilog, formatter)


class GroupedCommand(PlainCommand, TyperCommand):
    """A command whose help shows its options in groups; `--help-all` describes every option."""

    _help_all: Any = None

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, with `--help-all` before `--help`."""
        *params, own_help = super().get_params(ctx)
        if self._help_all is None:
            self._help_all = _all_of(own_help, hidden=not self._is_long())
        return converted_plainly([*params, self._help_all, own_help])

    def _is_long(self) -> bool:
        return sum(isinstance(param, TyperOption) for param in self.params) > LONGEST

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the arguments, then the options by group."""
        params = self.get_params(ctx)
        arguments = [param for param in params if not isinstance(param, TyperOption)]
        _write_records("Arguments", arguments, ctx, formatter)
        groups = list(grouped([param for param in params if isinstance(param, TyperOption)]))
        if ctx.meta.get(HELP_ALL) or not self._is_long():
            for title, options in groups:
                _write_records(title, options, ctx, formatter)
            return
        _write_records(*groups[0], ctx, formatter)
        with formatter.section("More options, described by --help-all"):
            for title, options in groups[1:]:
                if title != OWN:
                    _write_names(title, options, formatter)


class GroupedCommands(PlainCommand, TyperGroup):
    """A command with subcommands, whose help shows the first sentence of each."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write each subcommand with its first sentence."""
        with formatter.section("Commands"):
            formatter.write_dl(
                [(word, made.get_short_help_str(limit=200)) for word, made in self.commands.items()]
            )


class RootCommand(PlainCommand, TyperGroup):
    """The `stopgo` command."""

    def get_help(self, ctx: Any) -> str:
        """Return the help with every command."""
        return root_help()


def _all_of(own_help: Any, *, hidden: bool) -> Any:
    """Return the option `--help-all`, made from `--help`."""

    def show(ctx: Any, _: object, wanted: bool) -> None:
        if wanted and not ctx.resilient_parsing:
            ctx.meta[HELP_ALL] = True
            typer.echo(ctx.get_help())
            ctx.exit()

    made = copy(own_help)
    made.opts, made.name = ["--help-all"], "help_all"
    made.help, made.callback, made.hidden = "Describe every option and exit.", show, hidden
    return made


HELP_ALL = "stopgo.help_all"


def grouped(options: list[TyperOption]) -> Iterator[OptionGroup]:
    """Yield the groups of the options of a command, those that people use first at the beginning.

    An option without a group belongs to the command itself; such options come first, or else last.
    """
    by_title: dict[str, list[TyperOption]] = {}
    for option in options:
        if not option.hidden:
            by_title.setdefault(option.rich_help_panel or OWN, []).append(option)
    others = [title for title in by_title if title not in (FIRST, OWN, *GROUPS)]
    titles = [FIRST, *GROUPS, *others, OWN] if FIRST in by_title else [OWN, *others, *GROUPS]
    for title in titles:
        if title in by_title:
            yield title, by_title[title]


OWN = "Options"


def _write_records(title: str, params: list[Any], ctx: Any, formatter: Any) -> None:
    found = [record for param in params if (record := param.get_help_record(ctx)) is not None]
    records = [(name, text.replace("-", JOINING)) for name, text in found]
    if records:
        with formatter.section(title):
            before = len(formatter.buffer)
            formatter.write_dl(records, col_max=30 if formatter.width >= NARROW - 2 else 20)
            formatter.buffer[before:] = [part.replace(JOINING, "-") for part in formatter.buffer[before:]]


def _write_paragraphs(text: str | None, formatter: Any) -> None:
    for paragraph in cleandoc(text or "").split("\n\n"):
        if paragraph:
            filled = textwrap.fill(
                " ".join(paragraph.split()), formatter.width, initial_indent="  ", subsequent_indent="  ",
                break_on_hyphens=False, break_long_words=False,
            )  # fmt: skip
            formatter.write(f"\n{filled}\n")


def _write_names(title: str, options: list[TyperOption], formatter: Any) -> None:
    """Write the names of a group's options, unbroken."""
    indent = " " * (formatter.current_indent + 10)
    names = " ".join(max(option.opts, key=len) for option in options)
    text = textwrap.fill(
        names, formatter.width, initial_indent=f"  {title:<9} ", subsequent_indent=indent,
        break_on_hyphens=False, break_long_words=False,
    )  # fmt: skip
    formatter.write(f"{text}\n")


def wrong_option(name: str, context: Any, every: TyperGroup) -> str:
    """Return the line for an option that its command does not have, with the right one.

    `every` holds all commands: the option may belong to another one.
    """
    owners = [path for path, options in _options_of(every, "stopgo") if name in options]
    own = [
        known for param in context.command.get_params(context) for known in param.opts if known[:2] == "--"
    ]
    near = get_close_matches(name, own, n=1)
    line = f"{context.command_path} has no option {name}"
    if near and not 0 < len(owners) <= MOST_OWNERS:
        return f"{line}; the nearest is {near[0]}"
    if owners:
        others = "" if len(owners) <= MOST_OWNERS else ", …"
        return f"{line}; it belongs to {', '.join(owners[:MOST_OWNERS])}{others}"
    return _near_elsewhere(line, name, every)


def _near_elsewhere(line: str, name: str, every: TyperGroup) -> str:
    for word, olds in RENAMED.items():
        if isinstance(new := olds.get(name), NewName):
            return f"{line}; it is now {new.option} of stopgo {word}"
    elsewhere = {
        option: path for path, options in reversed([*_options_of(every, "stopgo")]) for option in options
    }
    near = get_close_matches(name, elsewhere, n=1, cutoff=0.75)
    return f"{line}; the nearest is {near[0]} of {elsewhere[near[0]]}" if near else line


MOST_OWNERS = 3


def _options_of(command: TyperGroup, path: str) -> Iterator[tuple[str, set[str]]]:
    """Yield every command below one that is shown to people, with its options."""
    for word, made in command.commands.items():
        if made.hidden:
            continue
        if isinstance(made, TyperGroup):
            yield from _options_of(made, f"{path} {word}")
        else:
            yield f"{path} {word}", {name for param in made.params for name in param.opts if name[0] == "-"}
