"""A process ends after its threads and exit functions, with all its output, and frees nothing."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import atexit, sys, threading
from stopgo.mission.console.process import ProcessEnd

class Held:
    def __del__(self):
        print("freed")

end = ProcessEnd()
held = Held()
atexit.register(print, "exit function")
threading.Thread(target=lambda: (threading.main_thread().join(), print("thread"))).start()
end.code = {code}
sys.exit(4)
"""


@pytest.mark.parametrize(
    ("code", "ends", "prints"),
    [
        (3, 3, ["thread", "exit function"]),
        (0, 0, ["thread", "exit function"]),
        (None, 4, ["thread", "exit function", "freed"]),
    ],
)
def test_all_that_must_be_done_is_done_before_the_end(code: int | None, ends: int, prints: list[str]) -> None:
    program = [sys.executable, "-c", PROGRAM.format(code=code)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout.split("\n")[:-1]) == (ends, prints), done.stderr
