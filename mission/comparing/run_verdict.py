"""Verdict on a run: did it acquire what its plan was made for? Decided only here, with its words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from msgspec import UNSET

from stopgo.mission.comparing.acquired import Acquired, Certainty
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.evidence import missing_events
from stopgo.mission.run.events import Aborted
from stopgo.mission.stages.figures import percent

EXIT_CODES: dict[Certainty, int] = {"yes": 0, "no": 1, "unknown": 3}
HEADLINES: dict[Certainty, str] = {"yes": "Acquired", "no": "Not acquired", "unknown": "Undecided"}
MOST_NAMED = 6
"""Number of stops named in a sentence; of more, only their number is given."""


@dataclass(frozen=True)
class Judgement:
    """A verdict, and its reasons in sentences."""

    answer: Certainty
    sentences: tuple[str, ...]

    @property
    def headline(self) -> str:
        return HEADLINES[self.answer]

    @property
    def exit_code(self) -> int:
        return EXIT_CODES[self.answer]

    @property
    def text(self) -> str:
        return " ".join((f"{self.headline}.", *self.sentences))


def exit_code_of(judgements: Iterable[Judgement]) -> int:
    """Return the exit code of several runs together: one `no` decides, then what is undecided."""
    codes = {judgement.exit_code for judgement in judgements}
    return next((code for code in (EXIT_CODES["no"], EXIT_CODES["unknown"]) if code in codes), 0)


def judge(comparison: Comparison) -> Judgement:
    """Return the verdict: did the scans see what was required, each from within its stop's tolerance?

    All stops must have been scanned without visibility data, and for a mission that shares its floor.
    """
    return Judgement(_answer(comparison), tuple(_sentences(comparison)))


def _answer(comparison: Comparison) -> Certainty:
    acquired = comparison.acquired
    if comparison.outside:
        return "no"
    if acquired is not None and comparison.mission.share is UNSET:
        disputed = any(item.is_disputed for item in comparison.asked)
        return "unknown" if disputed and acquired.answer == "yes" else acquired.answer
    if any(not item.is_doubtful for item in comparison.missing):
        return "no"
    return "unknown" if any(item.is_doubtful for item in comparison.asked) else "yes"


def _sentences(comparison: Comparison) -> Iterator[str]:
    if comparison.acquired is not None:
        yield from _coverage(comparison.acquired)
        if (share := comparison.mission.share) is not UNSET:
            yield f"The required coverage applies to all {share.of} missions of the floor together."
    else:
        yield (
            f"{comparison.scanned} of {len(comparison.asked)} stops were scanned; "
            "their coverage is unknown without the plan's recording."
        )
    yield from _outcomes(comparison)
    for item in comparison.outside:
        yield f"{item.stop} was {item.outside_text}."
    yield from _missing_evidence(comparison)
    for event in comparison.log.events:
        if isinstance(event, Aborted):
            yield f"The run was aborted: {event.reason}."


def _missing_evidence(comparison: Comparison) -> Iterator[str]:
    """Yield what the evidence lacks, and what would supply it."""
    for item in comparison.asked:
        if item.is_disputed:
            yield f"{item.stop} is undecided: {item.disputed_text}; check the scan's cloud."
    if any(item.outcome == "unconfirmed" for item in comparison.asked):
        yield "The scanner's files would show which of the unconfirmed scans were made."
    if not comparison.log.ended:
        yield "The run has not ended."
    missing = missing_events(comparison.log)
    if missing:
        yield f"The recording lacks {missing}; `stopgo watch --run` would fetch them from the robot."


def _coverage(acquired: Acquired) -> Iterator[str]:
    whole, planned = acquired.coverage.whole, acquired.planned.whole
    asked = "" if whole.required is None else f"{percent(whole.required)} was required, "
    least = "at least " if acquired.unknown else ""
    yield (
        f"{least}{percent(whole.coverage)} of what is visible was scanned; "
        f"{asked}{percent(planned.coverage)} planned."
    )
    for group in [group for group in acquired.coverage.short if group is not whole][:MOST_NAMED]:
        covered, required = percent(group.coverage), percent(group.required)
        yield f"Of {group.name}, {covered} was scanned; {required} was required."
    if acquired.unknown:
        yield f"Coverage of {named(acquired.unknown)} is unknown: no plan of that revision was given."


def _outcomes(comparison: Comparison) -> Iterator[str]:
    for outcome in ("skipped", "failed", "arrived", "not reached", "unconfirmed"):
        stops = [item.stop for item in comparison.asked if item.outcome == outcome]
        if stops:
            yield f"{named(stops)} {'were' if len(stops) > 1 else 'was'} {_WORDS.get(outcome, outcome)}."


_WORDS = {"arrived": "reached and not scanned", "unconfirmed": "passed without a confirmed scan"}


def named(stops: Sequence[str], what: str = "stops") -> str:
    """Return stops, or what else has names, as part of a sentence: `s04 and s06`."""
    if len(stops) > MOST_NAMED:
        return f"{len(stops)} {what} ({', '.join(stops[:MOST_NAMED])}, …)"
    *others, last = stops
    return f"{', '.join(others)} and {last}" if others else last
