"""A vehicle's parameters by name: requested together, and again those that have not come; or set."""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Collection

from stopgo.bridge.mavlink.vehicle_link.messages import parameter_request, parameter_setting
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.mavlink.telemetry import Message

ROUNDS = 4
ROUND_S = 0.7
"""Wait of each round after the last answer; a vehicle does not answer for names that it has not."""
WHOLE = {1: "<B", 2: "<b", 3: "<H", 4: "<h", 5: "<I", 6: "<i"}
"""MAV_PARAM_TYPE of whole numbers, and the format of their first bytes."""


def read_parameters(peer: Peer, names: Collection[str]) -> dict[str, float]:
    """Values of those parameters that the vehicle has."""
    found: dict[str, float] = {}
    with peer.waiting("PARAM_VALUE") as waiting:
        for _ in range(ROUNDS):
            missing = [name for name in names if name and name not in found]
            if not missing:
                break
            for name in missing:
                peer.send(parameter_request(peer.who, name))
            until = time.monotonic() + ROUND_S
            while (message := waiting.get(until - time.monotonic())) is not None:
                if message.param_id in names:
                    found[message.param_id] = value_of(message, bytewise=peer.autopilot.whole_bytewise)
                    until = time.monotonic() + ROUND_S
    return found


def set_parameter(peer: Peer, name: str, value: float) -> float | None:
    """Set a parameter of type float32; return the value that the vehicle then reports, `None` if none."""
    found: float | None = None
    with peer.waiting("PARAM_VALUE") as waiting:
        for _ in range(ROUNDS):
            peer.send(parameter_setting(peer.who, name, value))
            until = time.monotonic() + ROUND_S
            while (message := waiting.get(until - time.monotonic())) is not None:
                if message.param_id == name:
                    found = float(message.param_value)
                    until = -math.inf
            if found is not None:
                break
    return found


def value_of(message: Message, *, bytewise: bool) -> float:
    """The value in a PARAM_VALUE; `bytewise`: the float holds the bytes of a whole number."""
    form = WHOLE.get(message.param_type)
    if not bytewise or form is None:
        return float(message.param_value)
    packed = struct.pack("<f", message.param_value)
    return float(struct.unpack(form, packed[: struct.calcsize(form)])[0])
