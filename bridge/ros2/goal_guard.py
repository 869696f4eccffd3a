"""Guard of a robot that Nav2 drives: a process that cancels its goals if the program ends or hangs.

Nav2 ends a goal without the program that sent it. The guard is a node of its own, so that it needs no
discovery when it must act. Each byte on its input is a sign of life: 1 while the program drives, else 0. The
guard answers each of them, so that the program knows one that hangs.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from stopgo.bridge.ros2.ros_port import RosNode

SIGN_S = 0.1
SILENT_S = 0.5
"""Time without a sign of life after which a driving program counts as hung."""
STOPS_S = 2.0
END_S = 2.0
FIRST, LAST = 0, -1
DRIVES, STANDS = b"1", b"0"
READY = b"ready\n"
ANSWER = b"."
MOST_UNANSWERED = 50
"""Number of signs without an answer after which the guard counts as hung; a stop takes it 20."""
MOST_UNREADY = 300
"""The same until it is ready."""
MOST_BYTES = 4096
CANCEL = "action_msgs/srv/CancelGoal"
READY_S = 30.0
"""Longest wait for the first guard."""
NOT_READY = "the process that stops the robot if this program ends is not ready"
ENDED = "the process that stops the robot if this program ends has ended or hangs; starting another"


class GoalGuard:
    """The process that guards one robot, and the thread that shows it this program's life."""

    def __init__(
        self, wanted: dict[str, Any], drives: Callable[[], bool], report: Callable[[str], None],
        module: str,
    ) -> None:  # fmt: skip
        """Start it, and wait until it is ready.

        `report` takes why no guard runs, and an empty text once one runs again; `module` is run.
        """
        self._drives = drives
        self._report = report
        self._command = [sys.executable, "-m", module, json.dumps(wanted)]
        self._closing = threading.Event()
        self._lock = threading.Lock()
        self._process = self._started()
        self._is_missing, self._unanswered = True, 0
        self._hear(within_s=READY_S)
        if self._is_missing:
            report(NOT_READY)
        self._thread = threading.Thread(target=self._show_life, name="goal guard", daemon=True)
        self._thread.start()

    def _started(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True,
        )  # fmt: skip

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def close(self) -> None:
        """End the process: the robot needs no guard any more."""
        self._closing.set()
        self._thread.join(END_S)
        with suppress(OSError):
            self._write(STANDS)
            self._pipe.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._kill()

    def _kill(self) -> None:
        self._process.kill()
        self._process.wait()

    @property
    def _pipe(self) -> Any:
        assert self._process.stdin is not None
        return self._process.stdin

    def will_drive(self) -> None:
        """Say that a goal follows: a program may be killed right after it has sent one."""
        try:
            self._write(DRIVES)
        except OSError:
            self._report(ENDED)

    def _write(self, sign: bytes) -> None:
        with self._lock:
            self._pipe.write(sign)
            self._unanswered += 1

    def _show_life(self) -> None:
        while not self._closing.wait(SIGN_S):
            try:
                self._write(DRIVES if self._drives() else STANDS)
                was_missing = self._is_missing
                self._hear()
                if self._is_missing != was_missing:
                    self._report("")
                self._check_answers()
            except OSError:
                self._replace()

    def _hear(self, within_s: float = 0.0) -> None:
        """Take that the node is there, before which nothing may drive, and answers to signs of life."""
        out = self._process.stdout
        assert out is not None
        if select.select([out], [], [], within_s)[FIRST]:
            said = os.read(out.fileno(), MOST_BYTES)
            self._is_missing = self._is_missing and READY not in said
            with self._lock:
                self._unanswered = max(0, self._unanswered - said.count(ANSWER))

    def _check_answers(self) -> None:
        """Raise TimeoutError if the process hangs."""
        if self._unanswered > (MOST_UNREADY if self._is_missing else MOST_UNANSWERED):
            raise TimeoutError

    def _replace(self) -> None:
        """Start another process, at most one in `END_S`; one that cannot be started is tried again then."""
        self._report(ENDED)
        if self._is_missing and self._closing.wait(END_S):
            return
        self._is_missing = True
        with self._lock, suppress(OSError):
            fresh = self._started()
            with suppress(OSError):
                self._pipe.close()
            self._kill()
            self._process, self._unanswered = fresh, 0


class Signs:
    """Signs of life of a program, and the verdict on them; time comes from outside."""

    def __init__(self, now_s: float, silent_s: float = SILENT_S) -> None:
        self._last_s = now_s
        self._silent_s = silent_s
        self._drives = False
        self.ended = False

    def take(self, data: bytes, now_s: float) -> None:
        """Take what was read; nothing means that the program has ended."""
        self.ended = self.ended or not data
        if data:
            self._drives, self._last_s = data[LAST:] == DRIVES, now_s

    def must_stop(self, now_s: float) -> bool:
        """Return True, once, if the robot must be stopped."""
        must = self._drives and (self.ended or now_s - self._last_s > self._silent_s)
        if must:
            self._drives = False
        return must


def guard(node: RosNode, wanted: dict[str, Any], source: int) -> None:
    """Read signs of life from a file descriptor until the program ends, and stop the robot if need be.

    `wanted` names the services that cancel, and the topic that takes velocities.
    """
    robot = GoalStop(node, wanted)
    os.write(sys.stdout.fileno(), READY)
    signs = Signs(time.monotonic())
    while not signs.ended:
        if select.select([source], [], [], SIGN_S)[FIRST]:
            data = os.read(source, MOST_BYTES)
            signs.take(data, time.monotonic())
            with suppress(OSError):  # the program has ended: it must be stopped all the same
                os.write(sys.stdout.fileno(), ANSWER * len(data))
        if signs.must_stop(time.monotonic()):
            robot.stop()


class GoalStop:
    """Cancels a robot's goals, and commands zero velocity."""

    def __init__(self, node: RosNode, wanted: dict[str, Any]) -> None:
        self.wanted = wanted
        self._clients = [node.client(CANCEL, name) for name in wanted["cancel"]]
        topic = wanted["cmd_vel"]
        self._velocity = node.publisher(wanted["velocity_type"], topic) if topic else None

    def stop(self) -> None:
        """Do so for `STOPS_S`, whatever is answered."""
        end_s = time.monotonic() + STOPS_S
        while time.monotonic() < end_s:
            for client in self._clients:
                if not client.missing():
                    client.call({})  # no id and no time: every goal
            if self._velocity is not None:
                self._velocity.publish({})
            time.sleep(SIGN_S)
