"""JSON answer of a command with `--json`: one object on stdout, also if the command fails."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Iterator, Sequence
from typing import Any, TextIO


class JsonAnswer:
    """Stdout of a command, with a record of whether anything was written to it."""

    def __init__(self, stream: TextIO, *, wanted: bool) -> None:
        self._stream = stream
        self._wanted = wanted
        self._begun = False

    def write(self, text: str) -> int:
        """Write as the stream does."""
        self._begun = self._begun or bool(text)
        return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def fail(self, message: str, code: int) -> None:
        """Print the command's error as JSON, unless it has printed an answer before."""
        if not self._wanted or self._begun or not message:
            return
        told = {"error": {"message": " ".join(message.split()), "exit_code": code}}
        with contextlib.suppress(OSError):  # nobody reads it
            self._stream.write(f"{json.dumps(told)}\n")
            self._stream.flush()


@contextlib.contextmanager
def answering(arguments: Sequence[str]) -> Iterator[JsonAnswer]:
    """Make the output of the block the answer of a command with these arguments."""
    before = sys.stdout
    answer = JsonAnswer(before, wanted="--json" in arguments)
    if answer._wanted:
        sys.stdout = answer
    try:
        yield answer
    finally:
        sys.stdout = before
