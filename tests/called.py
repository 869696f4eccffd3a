"""Commands called in this process, reported as if they had run in one of their own."""

from __future__ import annotations

import io
from contextlib import redirect_stderr, redirect_stdout
from subprocess import CompletedProcess

from stopgo.command_line import main


def stopgo(*arguments: str) -> CompletedProcess[str]:
    """Output and exit code of a command; for all but signals, killed processes and imports."""
    out, error = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(error):
        code = main(list(arguments))
    return CompletedProcess(["stopgo", *arguments], code, out.getvalue(), error.getvalue())
