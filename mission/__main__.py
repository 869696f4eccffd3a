"""The front door: one command per verb, and the one place where an error becomes a line and an exit code."""

from __future__ import annotations

import signal
import sys
import threading
from importlib import import_module
from typing import NoReturn

import typer
from typer.exceptions import TyperException

from mission import __version__
from mission.errors import MissingExtra, StopgoError

FOLDERS = ("planner.cli", "bridge.cli", "recordings.cli", "mission.cli")
"""Each folder's commands; each module has `add_commands(app)` and imports slow libraries where used."""

INTERRUPTED = 130

EXTRAS = {
    "shapely": "plan", "scipy": "plan", "networkx": "plan", "ezdxf": "plan", "highspy": "plan",
    "numba": "plan", "pyproj": "plan", "ifcopenshell": "bim",
    "rerun": "record", "rosbags": "record", "pyulog": "record",
}  # fmt: skip
"""The extra that installs each optional library."""


def build_app() -> typer.Typer:
    """The `stopgo` command with every folder's verbs."""
    app = typer.Typer(
        name="stopgo",
        help="Plan where a laser scanner must stand, and drive a robot through those stops.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )

    @app.callback(invoke_without_command=True)
    def root(
        version: bool = typer.Option(False, "--version", help="Print the version and leave."),
    ) -> None:
        if version:
            typer.echo(__version__)
            raise typer.Exit

    for folder in FOLDERS:
        import_module(folder).add_commands(app)
    return app


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns its exit code: 0 done, 1 no, 2 bad input, 3 unknown, 130 Ctrl-C."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _terminated)
    try:
        command = typer.main.get_command(build_app())
        given = sys.argv[1:] if arguments is None else arguments
        result = command.main(args=given or ["--help"], prog_name="stopgo", standalone_mode=False)
        if result == INTERRUPTED:  # the command library has caught the Ctrl-C
            raise KeyboardInterrupt
        return result if isinstance(result, int) else 0
    except BrokenPipeError:
        return 0
    except (StopgoError, ModuleNotFoundError, TyperException, OSError) as error:
        return _say(*_told(error))
    except (KeyboardInterrupt, typer.Abort):
        return _say("stopped by Ctrl-C", INTERRUPTED)


def _terminated(number: int, frame: object) -> NoReturn:
    """Leave by way of every open `with`: links are closed and recordings finished."""
    raise SystemExit(128 + number)


def _told(error: Exception) -> tuple[str, int]:
    """What a user is told of an error, and the exit code."""
    if isinstance(error, StopgoError):
        return str(error), error.exit_code
    if isinstance(error, ModuleNotFoundError):
        return _missing(error)
    if isinstance(error, TyperException):
        return f"{error.format_message()} (see --help)", StopgoError.exit_code
    assert isinstance(error, OSError)  # such as a full disk under the output
    return f"{error.filename or 'output'}: {error.strerror}", StopgoError.exit_code


def _missing(error: ModuleNotFoundError) -> tuple[str, int]:
    library = (error.name or "").partition(".")[0]
    if library not in EXTRAS:
        raise error
    extra = EXTRAS[library]
    message = f'{library} is not installed; install it with: pip install "stopgo[{extra}]"'
    return message, MissingExtra.exit_code


def _say(message: str, code: int) -> int:
    print(f"stopgo: {' '.join(message.split())}", file=sys.stderr)  # noqa: T201
    return code


if __name__ == "__main__":
    sys.exit(main())
