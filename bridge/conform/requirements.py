"""Requirements of the protocol, and the verdict that a test of each gives.

A `Requirement` has a function that tests it on a `Bench`, which is a robot or a station under test. `tried`
tests requirements in order and gives one `ConformVerdict` each. After every test the bench returns the peer
to rest. Once the peer stops responding, the remaining requirements are not tested.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, Literal, Protocol, TypeVar

TriedOutcome = Literal["passed", "failed", "not tried"]


class Nonconforming(Exception):
    """The peer violated the protocol; the message says how."""


class NotTried(Exception):
    """A requirement could not be tested; the message gives the reason."""


class PeerNotResponding(Exception):
    """The peer stopped responding, or does not execute an abort."""


class Bench(Protocol):
    """Peer under test, on which requirements are tested."""

    def return_to_rest(self, *, may_drive: bool) -> None:
        """End a run after a test.

        Raises
        ------
        Nonconforming
            If the robot drives without a command.
        PeerNotResponding
            If the peer does not respond, or does not execute an abort.
        """


B = TypeVar("B", bound=Bench)


@dataclass(frozen=True)
class Requirement(Generic[B]):
    """Requirement of the protocol, and the function that tests it."""

    section: str
    """Heading of docs/reference/protocol.md that contains the requirement."""
    text: str
    test: Callable[[B], None]
    """Returns if the requirement is met; raises `Nonconforming` or `NotTried`."""
    drives: bool = False
    """True if the robot moves in the test."""
    needed: bool = False
    """True if no peer conforms while this is not tested."""


@dataclass(frozen=True)
class ConformVerdict:
    """Outcome of the test of one requirement."""

    section: str
    text: str
    outcome: TriedOutcome
    reason: str = ""
    lost: bool = False
    """True if the peer did not respond after the test."""
    needed: bool = False
    """True if no peer conforms while this is not tested."""


def untested(verdicts: Iterable[ConformVerdict]) -> tuple[str, ...]:
    """Return the needed requirements that were not tested."""
    return tuple(one.text for one in verdicts if one.needed and one.outcome == "not tried")


def tried(
    requirements: Iterable[Requirement[B]],
    bench: B,
    *,
    drive: bool = False,
    undrivable: str = "",
) -> Iterator[ConformVerdict]:
    """Test requirements in order, and yield their verdicts.

    `undrivable` is the reason for requirements that drive, where `drive` is false.
    """
    lost = ""
    for requirement in requirements:
        name = (requirement.section, requirement.text)
        if lost:
            yield ConformVerdict(*name, "not tried", lost, needed=requirement.needed)
        elif requirement.drives and not drive:
            yield ConformVerdict(*name, "not tried", undrivable, needed=requirement.needed)
        else:
            outcome, reason = _outcome(requirement, bench)
            try:
                bench.return_to_rest(may_drive=requirement.drives)
            except Nonconforming as wrong:
                outcome, reason = "failed", reason or str(wrong)
            except PeerNotResponding as error:
                lost = str(error)
                outcome, reason = "failed", reason or lost
            yield ConformVerdict(*name, outcome, reason, lost=bool(lost), needed=requirement.needed)


def _outcome(requirement: Requirement[B], bench: B) -> tuple[TriedOutcome, str]:
    try:
        requirement.test(bench)
    except Nonconforming as wrong:
        return "failed", str(wrong)
    except NotTried as why:
        return "not tried", str(why)
    return "passed", ""


def count_outcomes(verdicts: Iterable[ConformVerdict]) -> dict[str, int]:
    """Return the number of verdicts of each outcome."""
    counts = Counter(verdict.outcome for verdict in verdicts)
    return {outcome: counts[outcome] for outcome in ("passed", "failed", "not tried")}


def must(holds: object, otherwise: str) -> None:
    """Raise `Nonconforming` with the message `otherwise`, unless `holds` is true."""
    if not holds:
        raise Nonconforming(otherwise)


def short(value: Any, most: int = 120) -> str:
    """Return a value as text, cut to a length that fits a table."""
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
    return text if len(text) <= most else f"{text[:most]}…"
