"""Whether a replay shows that the mission was driven as planned: one answer, and why."""

from __future__ import annotations

from collections.abc import Iterator

from stopgo.mission.comparing.acquired import Certainty
from stopgo.mission.comparing.comparison import DONE, StopComparison
from stopgo.mission.comparing.run_verdict import Judgement, named
from stopgo.mission.stages.figures import percent
from stopgo.recordings.replay.replayed import Replay


def judged(replay: Replay) -> Judgement:
    """Yes, if the robot stood at every stop within its tolerance for as long as its scan takes.

    Where the floor is known, all that was asked for must have been in sight as well.
    """
    unseen = replay.sight is not None and not replay.sight.enough
    answer: Certainty = "no" if missing(replay) or outside(replay) or unseen else "yes"
    return DriveJudgement(answer, tuple(_sentences(replay)))


class DriveJudgement(Judgement):
    """An answer to how a mission was driven; whether it was scanned is another question."""

    @property
    def headline(self) -> str:
        return HEADLINES[self.answer]


def missing(replay: Replay) -> list[StopComparison]:
    """Stops at which the robot did not stand, or not long enough."""
    return [item for item in replay.comparison.asked if item.outcome not in DONE]


def outside(replay: Replay) -> list[StopComparison]:
    """Stops at which it stood too far away, or, by a simulator's truth, in truth did."""
    return [item for item in replay.comparison.asked if item.seen_beside]


def _sentences(replay: Replay) -> Iterator[str]:
    asked = replay.comparison.asked
    good = len(asked) - len(missing(replay)) - len(outside(replay))
    yield f"{good} of {len(asked)} stops were visited within tolerance."
    for outcome, words in WORDS.items():
        stops = [item.stop for item in asked if item.outcome == outcome]
        if stops:
            yield f"{words} {named(stops)}."
    for item in outside(replay):
        far, limit = 1000 * (item.deviation_m or 0.0), 1000 * (item.tolerance_m or 0.0)
        yield f"{item.stop} was missed by {far:.0f} mm ({limit:.0f} mm are tolerated)."
    if replay.sight is not None:
        whole = replay.sight.shares.whole
        short = [share for share in replay.sight.shares.short if share is not whole]
        for share in (whole, *short):
            name, least = share.name if share is not whole else "what is visible", percent(share.required)
            yield f"Of {name}, {percent(share.coverage)} was in sight; {least} was asked."
    if replay.extra:
        yield f"The robot halted {len(replay.extra)} times at no stop."
    if replay.inferred:
        yield "Visits were told from where the robot stood; that scans were made is not in the log."
    if replay.log.lost:
        yield f"The log is damaged, and this is of what could be read: {replay.log.lost}."


WORDS = {
    "skipped": "No halt at",
    "failed": "Too short a halt at",
    "arrived": "No scan at",
    "not reached": "Not reached:",
}
HEADLINES: dict[Certainty, str] = {
    "yes": "Driven as planned",
    "no": "Not driven as planned",
    "unknown": "Not known",
}
