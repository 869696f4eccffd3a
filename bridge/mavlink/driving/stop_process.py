"""Process that stops a vehicle when the program that drives it ends, or hangs.

`StopGuard` starts it, gives it the link's descriptors and frames ready to send, and a sign of life ten times
a second. When the signs cease while the vehicle drives, it writes the frames to the descriptors. It imports
nothing but the standard library, so that it starts at once and has little to fail by. While it stops the
vehicle of a program that has ended, it holds a name, for which the next program's guard waits.
"""

from __future__ import annotations

import json
import os
import select
import socket
import sys
from contextlib import closing, suppress
from typing import Any

SILENT_S = 0.35
"""Time without a sign of life after which the program counts as hanging."""
AGAIN_S = 0.1
"""Interval between two frames of the stop."""
MOST_BYTES, MOST_ENDS = 65536, 16
NOTHING: dict[str, Any] = {"drives": False, "frames": [], "to": []}


def main(descriptor: int, name: str) -> None:
    """Watch the program at the other end of this socket until it closes it."""
    line = socket.socket(fileno=descriptor)
    told, is_open = NOTHING, True
    ends: list[int] = []
    while is_open:
        is_open, sign = next_sign(line, SILENT_S if told["drives"] else None)
        if sign is not None:
            for end in ends:
                os.close(end)
            told, ends = sign
        elif told["drives"]:
            stop(line, told, ends, name="" if is_open else name)
            told = {**told, "drives": False}  # once: the next sign of life says it again


def next_sign(
    line: socket.socket, timeout_s: float | None
) -> tuple[bool, tuple[dict[str, Any], list[int]] | None]:
    """Wait for a sign of life; whether the other end is open, and the sign with its descriptors."""
    if not select.select([line], [], [], timeout_s)[0]:
        return True, None
    try:
        data, descriptors, _, _ = socket.recv_fds(line, MOST_BYTES, MOST_ENDS)
    except OSError:
        return False, None
    return (True, (json.loads(data), descriptors)) if data else (False, None)


def stop(line: socket.socket, told: dict[str, Any], ends: list[int], *, name: str) -> None:
    """Write the frames, one after another, until the program shows a sign of life again.

    `name` is held meanwhile, and empty if the program hangs; one that has ended shows no sign.
    """
    holder = None
    for frame in told["frames"]:
        for end, to in zip(ends, told["to"], strict=True):
            write(end, bytes.fromhex(frame), to)
        holder = holder or bound(name)
        if select.select([] if name else [line], [], [], AGAIN_S)[0]:
            break
    if holder is not None:
        holder.close()
    with suppress(OSError):
        line.send(b"stopped")


def bound(name: str) -> socket.socket | None:
    """Return an abstract socket of this name; None without one, or while another process has it."""
    if not name:
        return None
    with suppress(OSError):
        holder = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            holder.bind(f"\0{name}")
        except OSError:
            holder.close()
        else:
            return holder
    return None


def write(end: int, data: bytes, to: list[Any] | None) -> None:
    """Write to a descriptor, or send to an address by it; one that takes nothing is left out."""
    with suppress(OSError):
        if to is None:
            os.write(end, data)
            return
        with closing(socket.socket(fileno=os.dup(end))) as sender:
            sender.sendto(data, tuple(to))


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
