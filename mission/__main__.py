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
        result = command.main(args=arguments, prog_name="stopgo", standalone_mode=False)
        if result == INTERRUPTED:  # the command library has caught the Ctrl-C
            raise KeyboardInterrupt
        return result if isinstance(result, int) else 0
    except StopgoError as error:
        return _say(str(error), error.exit_code)
    except ModuleNotFoundError as error:
        return _say(*_missing(error))
    except TyperException as error:
        return _say(f"{error.format_message()} (see --help)", 2)
    except (KeyboardInterrupt, typer.Abort):
        return _say("stopped by Ctrl-C", INTERRUPTED)
    except BrokenPipeError:
        return 0


def _terminated(number: int, frame: object) -> NoReturn:
    """Leave by way of every open `with`: links are closed and recordings finished."""
    raise SystemExit(128 + number)


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
