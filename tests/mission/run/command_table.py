"""Effect of every command in every state of a run: computed by `decide` itself, printed in the protocol."""

from __future__ import annotations

from typing import get_args

from stopgo.mission.run.decision import Decision, Situation, decide
from stopgo.mission.run.events import Pose
from stopgo.mission.run.run_commands import FREE_VERBS, RunCommand, Verb
from stopgo.mission.run.states import DetailedState, Run
from tests.bridge.world import corridor

VERBS: tuple[Verb, ...] = get_args(Verb)
PLACES: tuple[DetailedState, ...] = (
    "IDLE", "READY", "RUNNING", "PAUSED", "HELD", "HOMING", "PAUSED homing", "HELD homing",
    "FINISHED", "ABORTED",
)  # fmt: skip


def table_text() -> str:
    """The table as Markdown: a line per state, a column per verb; a dash is a refusal with `wrong_state`."""
    rows = [("", *(f"`{verb}`" for verb in VERBS)), ("---",) * (len(VERBS) + 1)]
    rows += [(place, *(_cell(effect(verb, place)) for verb in VERBS)) for place in PLACES]
    free = ("needs the lease", *("no" if verb in FREE_VERBS else "yes" for verb in VERBS))
    return "\n".join(f"| {' | '.join(row)} |" for row in (*rows, free))


def effect(verb: Verb, place: DetailedState) -> str:
    """The state that an order leads to, or the reason for which it is refused."""
    decided = decide(_order(verb), _situation(place))
    if isinstance(decided, Decision):
        return decided.change.run.detailed_state
    if decided.reason != "finished_before":
        return decided.reason
    again = decide(_order(verb, again=True), _situation(place))
    return f"{again.change.run.detailed_state} with `again`" if isinstance(again, Decision) else again.reason


def _cell(effect: str) -> str:
    return {"wrong_state": "–", "no_mission": "`no_mission`"}.get(effect, effect)


def _order(verb: Verb, *, again: bool = False) -> RunCommand:
    return RunCommand(
        cmd_id="c", verb=verb, commander="station", issued_ns=0, valid_for_s=5.0, again=again,
    )  # fmt: skip


def _situation(place: DetailedState) -> Situation:
    """A robot at the first of two stops of its mission, in a given state."""
    mission = None if place == "IDLE" else _MISSION
    return Situation(
        run=_run(place), mission=mission, has_run=place in ("FINISHED", "ABORTED"),
        pose=Pose(x=0.0, y=0.0, heading=0.0), now_ns=0, command_ns=0, new_run_id="run",
        lease=None, battery=1.0, endurance_s=None,
    )  # fmt: skip


def _run(place: DetailedState) -> Run:
    state, _, homing = place.partition(" ")
    under_way = state not in ("IDLE", "READY")
    return Run(
        state=state,
        mission_id=None if place == "IDLE" else _MISSION.id, revision=None if place == "IDLE" else 1,
        run_id="run" if under_way else None, homing=bool(homing) or state == "HOMING", then="ABORTED",
    )  # fmt: skip


_MISSION = corridor(stops=2)
