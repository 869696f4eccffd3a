"""A command that is asked to end leaves by its own exit, and one that nobody reads ends silently."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import stopgo
import stopgo.command_line as front
from stopgo.bridge.commands.spawn import start
from tests.journeys.readme import ROOT
from tests.ports import free_port

RUN = """
import os, signal, sys
from contextlib import contextmanager
import stopgo.command_line as front

signal.signal(signal.SIGINT, signal.default_int_handler)  # a background process inherits that it is ignored

def hit(number=signal.SIGINT):
    os.kill(os.getpid(), number)

@contextmanager
def left_open():
    try:
        yield
    finally:
        print("closed", flush=True)

def run(arguments):
    {body}

front._run = run
sys.argv[1:] = []
sys.exit(front.main())
"""


def process(body: str, **options: object) -> subprocess.CompletedProcess[str]:
    """A whole process of ours whose command has this body."""
    lines = "\n    ".join(body.strip().splitlines())
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return subprocess.run(
        [sys.executable, "-c", RUN.format(body=lines)],
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "cwd": ROOT, "text": True, "timeout": 60}
        | {"env": buffered}
        | options,
        check=False,
    )  # type: ignore[call-overload, no-any-return]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_closes_what_is_open(number: signal.Signals) -> None:
    done = process(f"with left_open():\n    hit({int(number)})\n    signal.pause()")
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "closed\n", "")


FROM_ANOTHER_THREAD = """
import threading, time
from stopgo.mission.console.process import wait_for

def later():
    time.sleep(0.5)
    signal.pthread_kill(threading.get_ident(), signal.SIGTERM)

threading.Thread(target=later, daemon=True).start()
with left_open():
    wait_for(threading.Event())
"""


def test_a_signal_that_another_thread_got_ends_a_wait() -> None:
    done = process(FROM_ANOTHER_THREAD)
    assert (done.returncode, done.stdout, done.stderr) == (128 + signal.SIGTERM, "closed\n", "")


@pytest.mark.skipif(sys.platform != "linux", reason="tgkill is of Linux")
@pytest.mark.parametrize("command", ["robot", "simulate"])
def test_a_process_that_was_frozen_is_ended_by_one_signal(command: str, tmp_path: Path) -> None:
    """The system gives a signal to any thread of a process that goes on."""
    options = {
        "robot": ("--name", "r1", "--state", str(tmp_path), "--listen", f"tcp/127.0.0.1:{free_port()}"),
        "simulate": ("vehicle", "--mavlink", f"udpin:127.0.0.1:{free_port()}"),
    }
    running = start(command, *options[command], called=command)
    try:
        time.sleep(0.5)  # it is ready just before it waits
        threads = [int(name) for name in os.listdir(f"/proc/{running.pid}/task")]
        assert ctypes.CDLL(None).tgkill(running.pid, max(threads), signal.SIGTERM) == 0
        assert running.wait(60) == 0
    finally:
        running.kill()


def test_a_ctrl_c_before_the_command_line_is_loaded_has_its_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first tenth of a second of a command printed a traceback."""

    def interrupted() -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(stopgo, "_incomplete", interrupted)
    assert stopgo.main() == 130
    assert capsys.readouterr().err == "stopgo: stopped by Ctrl-C\n"


def test_a_second_ctrl_c_during_the_exit_leaves_no_traceback() -> None:
    done = process("try:\n    hit()\nfinally:\n    hit()")
    assert (done.returncode, done.stderr) == (130, "stopgo: stopped by Ctrl-C\n")


def test_a_ctrl_c_in_the_end_of_an_object_is_not_lost() -> None:
    done = process("class Ends:\n    def __del__(self):\n        hit()\nEnds()\nwhile True:\n    pass")
    assert (done.returncode, done.stderr) == (130, "stopgo: stopped by Ctrl-C\n")


def test_a_ctrl_c_when_all_is_done_ends_the_process_at_once() -> None:
    done = process("import atexit\natexit.register(hit)\nreturn 0")
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "")


def test_a_hangup_that_is_to_be_ignored_is() -> None:
    done = process("hit(signal.SIGHUP)\nreturn 0", preexec_fn=_ignore_hangup)
    assert (done.returncode, done.stderr) == (0, "")


def _ignore_hangup() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)


class Raises:
    """A command that is interrupted, and raises something of its own instead."""

    def __init__(self, error: BaseException) -> None:
        self._error = error

    def __call__(self, arguments: list[str]) -> int:
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            raise self._error from None
        return 0


@pytest.mark.parametrize("error", [RuntimeError(), ImportError("numpy failed to import"), OSError(4, "no")])
def test_what_an_interrupted_library_raises_is_still_ctrl_c(
    error: BaseException, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(front, "_run", Raises(error))
    assert front.main([]) == 130
    assert capsys.readouterr().err == "stopgo: stopped by Ctrl-C\n"


def test_a_closed_pipe_ends_a_command_silently() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = process("print('x' * 100_000)\nreturn 0", stdout=writer)
        small = process("print('x')\nreturn 0", stdout=writer)
        told = process("print('x', file=sys.stderr)\nreturn 0", stderr=writer)
    finally:
        os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")
    assert (small.returncode, small.stderr) == (141, "")
    assert told.returncode == 141


def test_a_broken_pipe_that_is_not_the_output_is_reported() -> None:
    done = process("raise BrokenPipeError(32, 'Broken pipe')")
    assert (done.returncode, done.stderr) == (2, "stopgo: output: Broken pipe\n")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_output_without_room_is_2() -> None:
    with open("/dev/full", "w") as full:
        done = process("print('x')\nreturn 0", stdout=full)
        told = process("raise front.StopgoError('no')", stderr=full)
    assert (done.returncode, done.stderr) == (2, "stopgo: output: No space left on device\n")
    assert told.returncode == 2


@pytest.mark.parametrize("number", [1, 2])
def test_a_process_without_output_works_and_no_file_takes_its_place(number: int) -> None:
    body = """
print("told")
print("said", file=sys.stderr)
with open(os.devnull) as file:
    return 40 + file.fileno()
"""
    done = process(body, preexec_fn=_closing(number))
    assert done.returncode > 42
    assert done.stdout + done.stderr == {1: "said\n", 2: "told\n"}[number]


def _closing(number: int) -> Callable[[], None]:
    return lambda: os.close(number)
