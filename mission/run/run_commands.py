"""Commands of a station to a robot's run, and the robot's answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Literal

import msgspec

from stopgo.mission.run.events import State

LONGEST_VALID_S: Final = 60.0
"""Longest validity that a command may claim."""

Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
"""A number that JSON readers and SQLite hold exactly."""
ShortText = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]

Verb = Literal["start", "pause", "resume", "skip", "retry", "abort", "home"]
FREE_VERBS: tuple[Verb, ...] = ("pause", "abort")
"""Commands that any station may give at any time."""
DRIVING: tuple[Verb, ...] = ("start", "resume", "retry", "home")
"""Commands that a robot which cannot drive refuses at once."""

Reason = Literal[
    "malformed", "expired", "id_reused", "wrong_state", "wrong_run", "wrong_mission", "no_mission",
    "finished_before", "not_at_start", "off_route", "not_at_stop", "not_the_commander", "fenced",
    "running", "revision_taken", "older_revision", "too_large", "incomplete", "digest", "infeasible",
    "storage", "untrusted", "replayed", "way_differs",
    "unsupported", "not_armed", "wrong_origin", "mission_differs", "no_position", "denied", "not_ready",
    "not_stopped",
]  # fmt: skip
"""Reason why a robot refuses a command, or a mission."""


class RunCommand(msgspec.Struct, frozen=True, kw_only=True, tag="Command", tag_field="is"):
    """A command; sent again with the same `cmd_id` it is executed once."""

    cmd_id: ShortText
    verb: Verb
    commander: ShortText
    issued_ns: int
    valid_for_s: float
    boot_id: ShortText | None = None
    """Robot program's start that `issued_ns` is dated by; after another start the command is refused."""
    fence: Count | None = None
    """Fencing token that the commander knew."""
    take_over: bool = False
    expect_state: tuple[State, ...] | None = None
    """Refused in any other state, so that a late command does no harm.

    `pause` and `abort` are carried out all the same; the answer reports the difference. So are they if
    `run_id`, `mission_id` or `revision` differ.
    """
    run_id: ShortText | None = None
    mission_id: ShortText | None = None
    revision: Count | None = None
    stop: ShortText | None = None
    """The stop that skip and retry are meant for."""
    again: bool = False
    from_here: bool = False


class Answer(msgspec.Struct, frozen=True, kw_only=True, tag=True, tag_field="is"):
    """Outcome of a command, stored before it is sent."""

    cmd_id: str
    verb: str
    outcome: Literal["ok", "refused"]
    reason: str | None
    """One of `Reason`, or another word of a newer robot."""
    message: str
    run_id: str | None
    state: str
    """One of `State`, or another word of a newer robot."""


@dataclass(frozen=True)
class Refused:
    """Refusal of a command, or of a mission."""

    reason: Reason
    message: str
