"""Check that a run in one of stopgo's own logs followed the given mission, in this revision."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from stopgo.mission.comparing.run_verdict import named
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import AnyEvent
from stopgo.recordings.logs.field_log import FieldLog

PARTS = ("start", "return_", "robot", "scanner", "frame", "georeference", "policy", "origin")
"""Parts of a mission besides its stops."""


def must_be_driven(log: FieldLog, mission: Mission, events: Sequence[AnyEvent]) -> None:
    """Refuse a mission that the run's events are not of.

    Raises
    ------
    InputError
        With the differences between the mission and the one in the log.
    """
    followed = list(dict.fromkeys(event.revision for event in events))
    if mission.revision not in followed:
        revisions = f"revision {', '.join(map(str, followed))}"
        what = differences(log, mission, followed[-1])
        raise InputError(
            f"{log.path}: its run followed {revisions} of mission {mission.name}, not {mission.revision}"
            f"{what}; give the mission.json of that revision"
        )
    what = differences(log, mission, mission.revision)
    if what:
        raise InputError(
            f"{log.path}: its run followed another version of mission {mission.name}, revision "
            f"{mission.revision}{what}; give the mission.json that was sent"
        )


def differences(log: FieldLog, mission: Mission, revision: int) -> str:
    """Return the differences to the mission of that revision in the log, in words; empty without any."""
    own = [one for one in log.missions if (one.id, one.revision) == (mission.id, revision)]
    if not own or own[-1].digest == mission.digest:
        return ""
    return f" ({'; '.join(_differences(own[-1], mission)) or 'the digests differ'})"


def _differences(driven: Mission, given: Mission) -> Iterator[str]:
    before, now = ({stop.id: stop for stop in one.stops} for one in (driven, given))
    changed = [name for name in before if name in now and before[name] != now[name]]
    for words, stops in (
        ("changed", changed),
        ("not in the log", [name for name in now if name not in before]),
        ("only in the log", [name for name in before if name not in now]),
    ):
        if stops:
            yield f"{words}: {named(stops)}"
    parts = [name.rstrip("_") for name in PARTS if getattr(driven, name) != getattr(given, name)]
    if parts:
        yield f"changed: {', '.join(parts)}"
