"""The front door: one command per verb, and the one place where an error becomes a line and an exit code."""

from __future__ import annotations

import os
import shlex
import signal
import sys
from functools import cache
from typing import TYPE_CHECKING, Any

from stopgo.mission.console.json_answer import answering
from stopgo.mission.console.notice import notice
from stopgo.mission.console.plain_output import have_plain_output
from stopgo.mission.console.process import (
    PIPE_CLOSED,
    ProcessEnd,
    Signals,
    drop_output,
    have_output,
    output_is_closed,
)
from stopgo.mission.console.state_folder import have_home
from stopgo.mission.errors import InputError, MissingExtra, StopgoError
from stopgo.renamed_options import with_new_names
from stopgo.root_help import must_be_command, root_help

if TYPE_CHECKING:
    from collections.abc import Callable

    import typer
    from typer.exceptions import TyperException
    from typer.models import CommandInfo

COMMANDS = {
    "plan_command": ("plan",),
    "floor_commands": ("convert", "floors"),
    "batch_command": ("batch",),
    "prove_command": ("prove",),
    "demo_command": ("demo",),
    "bridge_commands": (
        "robot", "guard", "push", "fetch-mission", "clear", "doctor", "start", "pause", "resume", "skip",
        "retry", "abort", "home", "status", "session", "watch", "simulate", "keys", "conform", "tunnel",
    ),
    "review_command": ("review",),
    "runs_command": ("runs",),
    "site_command": ("site",),
    "importer_command": ("rerun-importer",),
    "replay_command": ("replay",),
    "document_commands": ("show", "check", "export", "import", "align"),
}  # fmt: skip
"""The modules of `stopgo.commands`, in the order of the help, and the words of each; each has
`add_commands(app)` and imports slow libraries where used. A word loads its own module only."""

INTERRUPTED = 130
ROS_ARGUMENTS = "--ros-args"
HELP = (["--help"], ["-h"], ["--help-all"])
COMPLETING = "_STOPGO_COMPLETE"
"""Set by the shell's completion that `--install-completion` sets up."""

EXTRAS = {
    "shapely": "plan", "scipy": "plan", "networkx": "plan", "ezdxf": "plan", "highspy": "plan",
    "pyproj": "plan", "ifcopenshell": "bim",
    "rerun": "record", "rosbags": "record", "pyulog": "record",
    "laspy": "clouds", "pye57": "clouds", "reportlab": "plan", "PIL": "plan",
    "embreex": "prove", "small_gicp": "prove", "kiss_matcher": "prove", "pyvrp": "fleet",
    "starlette": "site", "uvicorn": "site",
}  # fmt: skip
"""The extra that installs each optional library."""


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns its exit code: 0 done, 1 no, 2 bad input, 3 unknown, 130 Ctrl-C.

    Without `arguments` it is the process's own command, and the process must end with that code.
    """
    if arguments is not None:
        return _with_signals(arguments, whole_process=False)
    end = ProcessEnd()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its matrices are small: other threads only wait
    have_output()
    have_home()
    have_plain_output(escaped=not {"--json", "--print-config"}.isdisjoint(sys.argv))
    if sys.argv[1:2] == ["plan"]:
        from stopgo.mission.console.freed_memory import look_seldom

        look_seldom()  # also in the last moments: what it would find then is freed with the process
    code = _with_signals(sys.argv[1:], whole_process=True)
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:  # and not once more at the very end
        drop_output()
    end.code = code
    return code


def _with_signals(arguments: list[str], *, whole_process: bool) -> int:
    try:
        with Signals(whole_process=whole_process) as signals, answering(arguments) as answer:
            try:
                code = _run(arguments)
                sys.stdout.flush()
                return code
            except BaseException as error:  # noqa: BLE001  the process ends here
                message, code = _ended_by(error, signals)
                notice(message)
                answer.fail(message, code)
                return code
    except KeyboardInterrupt:  # a second one, while the first is reported
        return INTERRUPTED


def build_app(verb: str = "") -> typer.Typer:
    """The `stopgo` command with all its subcommands; with `verb`, with those of that word's module."""
    from importlib import import_module

    import typer

    from stopgo.option_help import GroupedCommand, GroupedCommands, RootCommand

    app = typer.Typer(
        name="stopgo",
        cls=RootCommand,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )

    @app.callback(invoke_without_command=True)
    def root(
        version: bool = typer.Option(False, "--version", help="Print the version and leave."),
    ) -> None:
        if version:
            from stopgo.mission import __version__

            typer.echo(__version__)
            raise typer.Exit

    for name in [name for name, words in COMMANDS.items() if verb in words] or COMMANDS:
        import_module(f"stopgo.commands.{name}").add_commands(app)
    for group in app.registered_groups:
        group.cls = GroupedCommands
    groups = [group.typer_instance for group in app.registered_groups if group.typer_instance is not None]
    for made in [made for holder in (app, *groups) for made in holder.registered_commands]:
        made.cls = GroupedCommand
    return app


@cache
def front_door(verb: str = "") -> Any:
    """The app, ready to run; made once, however many commands a process runs.

    With a known `verb` it has that subcommand alone: to make all takes longer than most of them run.
    """
    from typer.main import get_command, get_command_name

    app = build_app(verb)
    commands = [made for made in app.registered_commands if _name_of(made, get_command_name) == verb]
    groups = [made for made in app.registered_groups if made.name == verb]
    if not commands and not groups:
        return front_door() if verb else get_command(app)
    app.registered_commands, app.registered_groups = commands, groups
    return get_command(app)


def _name_of(made: CommandInfo, get_command_name: Callable[[str], str]) -> str:
    """The name that a person types for a command."""
    assert made.callback is not None
    return made.name or get_command_name(made.callback.__name__)


def _run(arguments: list[str]) -> int:
    """Run one command and return its exit code, if it does not raise."""
    _must_be_text(arguments)
    arguments, renamed = with_new_names(with_ros_arguments(arguments))
    for line in renamed:
        notice(line)
    if COMPLETING in os.environ:  # a shell asks what the words typed so far may become
        front_door().main(list(arguments), prog_name="stopgo")
    if arguments in ([], *HELP):
        print(root_help())  # noqa: T201
        return 0
    must_be_command(arguments[0], sum(COMMANDS.values(), ()))
    command = front_door(arguments[0])
    with command.make_context("stopgo", list(arguments)) as context:
        result = command.invoke(context)
    return result if isinstance(result, int) else 0


def with_ros_arguments(arguments: list[str]) -> list[str]:
    """Return the arguments with those after --ros-args as its one value, up to a -- as of every ROS node."""
    if ROS_ARGUMENTS not in arguments:
        return arguments
    at = arguments.index(ROS_ARGUMENTS) + 1
    end = arguments.index("--", at) if "--" in arguments[at:] else len(arguments)
    return [*arguments[:at], shlex.join(arguments[at:end]), *arguments[end + 1 :]]


def _must_be_text(arguments: list[str]) -> None:
    """Refuse a name of bytes that are not UTF-8 before anything is written: no message could show it."""
    from stopgo.mission.console.table import printable
    from stopgo.mission.files.file_name import NOT_TEXT, is_text

    for argument in arguments:
        if not is_text(argument):
            raise InputError(f"{printable(argument)}: {NOT_TEXT}")


def _ended_by(error: BaseException, signals: Signals) -> tuple[str, int]:
    """The line for the user and the exit code of a command that raised; raises unexpected errors again."""
    if isinstance(error, StopgoError):
        return str(error), error.exit_code
    if isinstance(error, KeyboardInterrupt) or signals.first is not None:
        return _stopped(signals)
    if isinstance(error, BrokenPipeError) and output_is_closed():
        return "", PIPE_CLOSED
    if isinstance(error, ModuleNotFoundError):
        return _missing(error)
    if isinstance(error, OSError):  # such as a full disk under the output
        return f"{error.filename or 'output'}: {error.strerror}", StopgoError.exit_code
    return _raised_by_typer(error)


def _stopped(signals: Signals) -> tuple[str, int]:
    """Line and exit code of a command that a signal ended; only Ctrl-C gets a line."""
    if signals.first not in (None, signal.SIGINT):
        return "", signals.exit_code
    return "stopped by Ctrl-C", INTERRUPTED


def _raised_by_typer(error: BaseException) -> tuple[str, int]:
    """Line and exit code of an error of typer, the library of commands."""
    from typer import Abort, Exit
    from typer.exceptions import TyperException

    if isinstance(error, Exit):
        return "", error.exit_code
    if isinstance(error, Abort):
        return "", INTERRUPTED
    if isinstance(error, TyperException):
        return f"{_misused(error)} (see --help)", StopgoError.exit_code
    raise error


def _misused(error: TyperException) -> str:
    """The usage error in words; after a group such as `stopgo keys`, with its subcommands."""
    unknown = getattr(error, "option_name", "") if hasattr(error, "possibilities") else ""
    context = getattr(error, "ctx", None)
    if unknown.startswith("--"):
        from stopgo.option_help import wrong_option

        return wrong_option(unknown, context, front_door())
    verbs = () if context is None or context.parent is None else getattr(context.command, "commands", ())
    known = f" {context.command_path} has: {', '.join(verbs)}" if context and verbs else ""
    return f"{error.format_message()}{known}"


def _missing(error: ModuleNotFoundError) -> tuple[str, int]:
    library = (error.name or "").partition(".")[0]
    if library not in EXTRAS:
        raise error
    extra = EXTRAS[library]
    message = f'{library} is not installed; install it with: pip install "stopgo[{extra}]"'
    return message, MissingExtra.exit_code
