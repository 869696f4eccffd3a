"""Faults that a simulated robot is to have, and the shape and reader of those of a vehicle too."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import isfinite
from typing import Any, Generic, Literal, TypeVar

from stopgo.mission.errors import InputError

T = TypeVar("T", bound=str)


@dataclass(frozen=True)
class Fault(Generic[T]):
    """A fault that occurs once; `FAULTS` of its simulator explains `at` and `amount`."""

    kind: T
    at: int
    amount: float = 0.0


@dataclass(frozen=True)
class Faults(Generic[T]):
    """The faults to simulate."""

    all: tuple[Fault[T], ...] = ()

    def due(self, kind: T, at: int) -> Fault[T] | None:
        return next((fault for fault in self.all if (fault.kind, fault.at) == (kind, at)), None)

    def any(self, kind: T) -> Fault[T] | None:
        """The first fault of a kind, whenever it is due."""
        return next((fault for fault in self.all if fault.kind == kind), None)


NO_FAULTS: Faults[Any] = Faults()


def read_fault(text: str, kinds: dict[T, str], nonsense: Callable[[Fault[T]], str | None]) -> Fault[T]:
    """Read a fault from KIND@N or KIND@N=AMOUNT, such as `slip@2=0.2`; `nonsense` names a rule it breaks."""
    name, _, rest = text.partition("@")
    at, _, amount = rest.partition("=")
    try:
        fault = Fault({str(kind): kind for kind in kinds}[name], int(at), float(amount or 0.0))
    except (KeyError, ValueError):
        known = ", ".join(kinds)
        raise InputError(f"--fault {text}: write it KIND@N or KIND@N=AMOUNT, KIND of {known}") from None
    if (wrong := nonsense(fault)) is not None:
        raise InputError(f"--fault {text}: {wrong}")
    return fault


FaultKind = Literal["slip", "blocked", "shaking", "drain", "scanner", "empty", "crash", "crashed"]
RobotFaults = Faults[FaultKind]

FAULTS: dict[FaultKind, str] = {
    "slip": "drive N ends AMOUNT metres to the left of where it should",
    "blocked": "drive N meets an obstacle halfway",
    "shaking": "after drive N the robot shakes for AMOUNT seconds",
    "drain": "after drive N the battery is at AMOUNT (0 to 1)",
    "scanner": "scan N fails",
    "empty": "scan N holds no points",
    "crash": "the process dies just before journal entry N is stored",
    "crashed": "the process dies just after journal entry N is stored",
}


def read_faults(texts: Iterable[str] | None) -> RobotFaults:
    """Read faults of a robot."""
    return Faults(tuple(read_fault(text, FAULTS, _nonsense) for text in texts or ()))


def _nonsense(fault: Fault[FaultKind]) -> str | None:
    possible = fault.at >= 0 and isfinite(fault.amount)
    return None if possible else "N must be 0 or more, and AMOUNT a finite number"
