"""Faults that the simulated vehicle is to have."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from stopgo.bridge.robot.simulated_faults import Fault, Faults, read_fault

VehicleFaultKind = Literal[
    "loss", "duplicates", "jitter", "lostack", "nack", "silent", "reboot-upload", "reboot-mission",
    "beside", "finish", "scanner", "unsigned", "unplaced", "camera", "jump", "gap", "restart",
    "failsafe", "lostpicture", "stuck", "switch",
]  # fmt: skip


MOST_JITTER_MS = 60_000
RESULTS = range(15)
"""MAV_MISSION_RESULT without OPERATION_CANCELLED, by which a vehicle refuses no item."""
POSITIONS = range(3)
"""Positions of a remote control's mode switch that the fault sets."""
CAUSES = range(6)
"""Causes of a failsafe, in the order of `Autopilot.failsafe_texts`."""


VehicleFault = Fault[VehicleFaultKind]
VehicleFaults = Faults[VehicleFaultKind]

FAULTS: dict[VehicleFaultKind, str] = {
    "loss": "N percent of the frames are lost in each direction; AMOUNT is the seed",
    "duplicates": "N percent of the frames come twice in each direction; AMOUNT is the seed",
    "jitter": "frames are late by up to N ms in each direction, and overtake each other; AMOUNT is the seed",
    "lostack": "the last ACK of upload N is not sent",
    "nack": "item N of an upload is refused once, with MAV_MISSION_RESULT AMOUNT (0: ERROR)",
    "silent": "once, from item N of an upload on, nothing is sent or received for AMOUNT s (0: for good)",
    "reboot-upload": "the vehicle reboots once, when item N of an upload has come",
    "reboot-mission": "the vehicle reboots once, on the path to item N",
    "beside": "the vehicle stops AMOUNT metres to the left of item N's waypoint, and reports it as reached",
    "finish": "item N's waypoint is reported as reached AMOUNT metres before it, in passing",
    "scanner": "scan N fails",
    "jump": "N seconds after it was switched on, its estimated position jumps by AMOUNT metres, for good",
    "gap": "N seconds after it was switched on, nothing is sent or received for AMOUNT seconds",
    "restart": "N seconds after it was switched on, it reboots, and takes AMOUNT seconds more for that",
    "failsafe": "N seconds after it was switched on, a failsafe holds it; AMOUNT is the cause: 0 battery,"
    " 1 remote control, 2 ground station, 3 geofence, 4 crash, 5 position estimate",
    "switch": "N seconds after it was switched on, somebody moves the mode switch of its remote control;"
    " AMOUNT is the position: 0 manual, 1 hold, 2 auto",
    "stuck": "on the path to item N it stands, in AUTO, for AMOUNT s (0: until AUTO is commanded again)",
    "lostpicture": "the report of scan N is not sent, unless a station requests it",
    "unplaced": "its origin came too soon: it reports it, but no position on earth (N means nothing)",
    "camera": "its scanner reports scans as a component of its own, 100 (N means nothing)",
    "unsigned": "it signs nothing, though it has a key; it accepts only signed messages (N means nothing)",
}


class Mishaps:
    """The faults of one vehicle, and which of them have happened."""

    def __init__(self, faults: VehicleFaults) -> None:
        self._faults = faults
        self._happened: set[VehicleFault] = set()

    def due(self, kind: VehicleFaultKind, at: int) -> VehicleFault | None:
        """A fault that happens whenever it is due."""
        return self._faults.due(kind, at)

    def once(self, kind: VehicleFaultKind, at: int) -> VehicleFault | None:
        """A fault that happens the first time it is due."""
        fault = self._faults.due(kind, at)
        if fault is None or fault in self._happened:
            return None
        self._happened.add(fault)
        return fault

    def by(self, kind: VehicleFaultKind, seconds: float) -> list[VehicleFault]:
        """The faults of a kind whose time has come just now."""
        came = [f for f in self._faults.all if f.kind == kind and f.at <= seconds and f not in self._happened]
        self._happened.update(came)
        return came


def read_vehicle_faults(texts: Iterable[str]) -> VehicleFaults:
    """Read faults of a vehicle."""
    return Faults(tuple(read_fault(text, FAULTS, _nonsense) for text in texts))


def _nonsense(fault: VehicleFault) -> str | None:
    """Rule that a fault breaks, as it could not happen; `None` if it breaks none."""
    kind, at, amount = fault.kind, fault.at, fault.amount
    if not (at >= 0 and 0 <= amount < 1e9):
        return "N and AMOUNT must be 0 or more"
    percent = at > 100, f"N is a percentage, 0 to 100, such as {kind}@20"
    counted = at == 0, f"N counts from 1: {kind}@1 is the first"
    metres = amount == 0, f"AMOUNT is metres, more than 0, such as {kind}@{at}=0.4"
    results = f"RESULT is a MAV_MISSION_RESULT, {RESULTS[0]} to {RESULTS[-1]} (0: ERROR)"
    rules: dict[VehicleFaultKind, tuple[bool, str]] = {
        "loss": percent, "duplicates": percent, "lostack": counted, "scanner": counted,
        "lostpicture": counted,
        "beside": metres, "finish": metres, "jump": metres,
        "jitter": (at > MOST_JITTER_MS, f"N is milliseconds, 0 to {MOST_JITTER_MS}, such as jitter@300"),
        "gap": (amount == 0, f"AMOUNT is seconds, more than 0, such as gap@{at}=2"),
        "failsafe": (amount not in CAUSES, f"AMOUNT is the cause, 0 to {CAUSES[-1]}, such as {kind}@{at}=3"),
        "switch": (
            amount not in POSITIONS, f"AMOUNT is the position, 0 to {POSITIONS[-1]}, such as {kind}@{at}=1"
        ),
        "nack": (amount not in RESULTS, f"{results}, such as nack@{at}=5"),
    }  # fmt: skip
    wrong, why = rules.get(kind, (False, ""))
    return why if wrong else None
