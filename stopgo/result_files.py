"""Preparation of the files that `plan` and `prove` write: folder, JSON option, optional libraries."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from stopgo.mission.errors import InputError

JsonOption = Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")]


def result_folder(out: Path) -> Path:
    """Return the folder for the results; it is created if it does not exist.

    Raises
    ------
    InputError
        When the folder cannot be created.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{out}: the folder cannot be created ({error.strerror}); choose another with -o"
        ) from None
    return out


def is_missing(error: ModuleNotFoundError, library: str) -> bool:
    """True if the import failed because this library is not installed."""
    return (error.name or "").partition(".")[0] == library


def report_missing_rerun(error: ModuleNotFoundError, files: str) -> None:
    """Print on stderr that files are not written because Rerun is not installed.

    Raises
    ------
    ModuleNotFoundError
        When another library than Rerun is missing.
    """
    if not is_missing(error, "rerun"):
        raise error
    typer.echo(f'{files}: not written, rerun is not installed; pip install "stopgo[record]"', err=True)
