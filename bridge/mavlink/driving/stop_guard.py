"""Guard of a vehicle that a program drives: a process of its own stops it when the program ends or hangs.

An autopilot drives on for seconds with its last set point. The guard sends HOLD within half a second, also
after a kill that no program can catch. It does not help where the computer itself or the link fails.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from importlib.resources import files

from stopgo.bridge.console import say
from stopgo.bridge.mavlink.vehicle_link.messages import command_long
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.mavlink.items import Command

PROGRAM = "stop_process.py"
SIGN_S = 0.1
FRESH_SIGNS = 50
"""Number of signs of life after which new frames are made: signed ones must not be too old."""
APART_SIGNS = 20
"""Number of signs between two processes, where one after another ends."""
FRAMES = 40
"""HOLD this often, for four seconds: the link may lose some."""
FORMER_S = 6.0
"""Longest wait for the guard of a former program, which stops the same vehicle."""
FORMER_TICK_S = 0.02
"""Interval between two looks if it has ended: no message says so."""
FORMER = "the guard of a former program still stops the vehicle; waiting for its end"
END_S = 2.0
STUCK_S = 1
"""Longest time for which a sign of life waits for a process that reads none, in whole seconds."""
ENDED = "the process that stops the vehicle if this program ends has ended or hangs; starting another"


class StopGuard:
    """The process that guards one vehicle; `drives` says whether the vehicle has to be stopped if we end."""

    def __init__(self, peer: Peer, drives: Callable[[], bool], stopped: Callable[[], None]) -> None:
        """`stopped` is called when the process has stopped the vehicle because this program hung.

        A former program's guard that still sends HOLD is waited for: else it would end a drive of this one.
        """
        self._name = _name_of(peer)
        _await_former(self._name)
        self._peer = peer
        self._drives = drives
        self._stopped = stopped
        self._signs = self._replaced_until = 0
        self._frames: list[str] = []
        self._closing = threading.Event()
        self._line, self._process = _started(self._name)
        self._thread = threading.Thread(target=self._show_life, name="stop guard", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def close(self) -> None:
        """End the process: the vehicle needs no guard any more."""
        self._closing.set()
        self._thread.join()
        self._line.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._kill()

    def _kill(self) -> None:
        self._process.kill()
        self._process.wait()

    def _show_life(self) -> None:
        while not self._closing.wait(SIGN_S):
            try:
                self._show_sign(drives=self._drives())
                self._take_report()
            except OSError:
                self._replace()
        with suppress(OSError):
            self._show_sign(drives=False)

    def _replace(self) -> None:
        """Start another process, and show it a sign of life: at once, then at most one in `APART_SIGNS`.

        One that cannot be started is tried again then.
        """
        if self._signs < self._replaced_until:
            return
        self._replaced_until = self._signs + APART_SIGNS
        say(ENDED)
        with suppress(OSError):
            line, process = _started(self._name)
            self._line.close()
            self._kill()
            self._line, self._process = line, process
            self._show_sign(drives=self._drives())

    def _show_sign(self, *, drives: bool) -> None:
        """Send a sign of life, with the link's present descriptors and frames for a stop."""
        if self._signs % FRESH_SIGNS == 0:
            hold = command_long(self._peer.who, Command.DO_SET_MODE, *self._peer.autopilot.modes.hold.params)
            self._frames = [frame.hex() for frame in self._peer.wire.packed_apart(hold, FRAMES)]
        self._signs += 1
        ends = self._peer.wire.ends(self._peer.who)
        sign = {"drives": drives, "frames": self._frames, "to": [to for _, to in ends]}
        socket.send_fds(self._line, [json.dumps(sign).encode()], [descriptor for descriptor, _ in ends])

    def _take_report(self) -> None:
        with suppress(BlockingIOError):
            if self._line.recv(100, socket.MSG_DONTWAIT):
                self._stopped()


def _name_of(peer: Peer) -> str:
    """Name held by the guard of a program that has ended while it stops this vehicle."""
    link = f"{os.getuid()} {peer.wire.name} {peer.who.system}"
    return f"stopgo-stop-{hashlib.sha256(link.encode()).hexdigest()}"


def _await_former(name: str) -> None:
    """Wait until no guard of a former program stops this vehicle any more."""
    if _is_held(name):
        say(FORMER)
    until_s = time.monotonic() + FORMER_S
    while _is_held(name) and time.monotonic() < until_s:
        time.sleep(FORMER_TICK_S)


def _is_held(name: str) -> bool:
    """Return True if another process holds this name."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
            probe.bind(f"\0{name}")
    except OSError as error:
        return error.errno == errno.EADDRINUSE
    return False


def _started(name: str) -> tuple[socket.socket, subprocess.Popen[bytes]]:
    """Start the process, in a session of its own: no signal for this program's group ends it."""
    source = files("stopgo.bridge.mavlink.driving").joinpath(PROGRAM).read_text(encoding="utf-8")
    ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", STUCK_S, 0))
    with its:
        process = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", source, str(its.fileno()), name],
            pass_fds=(its.fileno(),), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
    return ours, process


def is_available() -> bool:
    """Return True where a process can be given descriptors over a socket, as on Linux."""
    return hasattr(socket, "SOCK_SEQPACKET") and hasattr(socket, "send_fds") and sys.platform == "linux"
