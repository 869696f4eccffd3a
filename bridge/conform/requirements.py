"""A requirement of the protocol, how it is tried, and what came of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, Literal, Protocol, TypeVar

TriedOutcome = Literal["passed", "failed", "not tried"]


class Nonconforming(Exception):
    """The peer did something else than the protocol says; the message tells what."""


class NotTried(Exception):
    """A requirement could not be tried; the message says why."""


class PeerNotResponding(Exception):
    """The peer answers nothing any more."""


class Bench(Protocol):
    """What requirements are tried on."""

    def check_in(self, *, may_drive: bool) -> None:
        """After each: leave the peer at rest.

        Raises
        ------
        Nonconforming
            If it drives and nothing told it to.
        PeerGone
            If it is there no more, or does not obey.
        """


B = TypeVar("B", bound=Bench)


@dataclass(frozen=True)
class Requirement(Generic[B]):
    """One thing that the protocol wants, and the function that finds out."""

    section: str
    """The heading of docs/reference/protocol.md under which it stands."""
    text: str
    find_out: Callable[[B], None]
    """Returns if it is met; raises `Nonconforming` or `NotTried`."""
    drives: bool = False
    """Whether the robot moves for it."""


@dataclass(frozen=True)
class ConformVerdict:
    """What came of one requirement."""

    section: str
    text: str
    outcome: TriedOutcome
    reason: str = ""
    gone: bool = False
    """Whether the peer answered nothing any more after it."""


def tried(
    requirements: Iterable[Requirement[B]],
    bench: B,
    *,
    drive: bool = False,
    undrivable: str = "",
) -> Iterator[ConformVerdict]:
    """Each requirement's verdict, in order; once the peer is gone, the rest are not tried."""
    gone = ""
    for requirement in requirements:
        told = (requirement.section, requirement.text)
        if gone:
            yield ConformVerdict(*told, "not tried", gone)
        elif requirement.drives and not drive:
            yield ConformVerdict(*told, "not tried", undrivable)
        else:
            outcome, reason = _found_out(requirement, bench)
            try:
                bench.check_in(may_drive=requirement.drives)
            except Nonconforming as wrong:
                outcome, reason = "failed", reason or str(wrong)
            except PeerNotResponding as error:
                gone = str(error)
                outcome, reason = "failed", reason or gone
            yield ConformVerdict(*told, outcome, reason, gone=bool(gone))


def _found_out(requirement: Requirement[B], bench: B) -> tuple[TriedOutcome, str]:
    try:
        requirement.find_out(bench)
    except Nonconforming as wrong:
        return "failed", str(wrong)
    except NotTried as why:
        return "not tried", str(why)
    return "passed", ""


def counted(verdicts: Iterable[ConformVerdict]) -> dict[str, int]:
    """How many there are of each outcome."""
    found = Counter(verdict.outcome for verdict in verdicts)
    return {outcome: found[outcome] for outcome in ("passed", "failed", "not tried")}


def must(holds: object, otherwise: str) -> None:
    """Raise `Nonconforming` unless something holds."""
    if not holds:
        raise Nonconforming(otherwise)


def short(value: Any, most: int = 120) -> str:
    """What was said, cut to a length that stands in a table."""
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
    return text if len(text) <= most else f"{text[:most]}…"
