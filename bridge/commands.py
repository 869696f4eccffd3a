"""What each command does to a run, or why it is refused: decided here, without touching anything."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from bridge import route
from bridge.battery import what_is_missing
from bridge.lease import FREE_VERBS, Denied, claimed
from bridge.protocol import LONGEST_VALID_S, Command, Lease, Reason
from bridge.run import Change, Run, Telling, changed, ended, sent_home, skipped, stop_of
from mission.document import Mission
from mission.events import Paused, Pose, Resumed, Skipped, Started, TakenOver


@dataclass(frozen=True)
class Situation:
    """All that a decision depends on."""

    run: Run
    mission: Mission | None
    has_run: bool
    """Whether this mission has been run before."""
    pose: Pose
    now_ns: int
    """On the run's clock."""
    command_ns: int
    """On the clock of commands."""
    new_run_id: str
    lease: Lease | None
    battery: float
    endurance_s: float | None
    not_ready: str = ""
    """Why the robot's base cannot drive at present."""


@dataclass(frozen=True)
class Refused:
    reason: Reason
    message: str


@dataclass(frozen=True)
class Decision:
    """What an order leads to, and who commands the robot from then on."""

    change: Change
    lease: Lease | None


def decide(command: Command, situation: Situation) -> Decision | Refused:
    """What a command leads to; late, foreign, misdirected and impossible ones are refused."""
    late = _too_late(command, situation)
    if late:
        return late
    lease = situation.lease if command.verb in FREE_VERBS else _claim(command, situation)
    if isinstance(lease, Refused):
        return lease
    change = _misdirected(command, situation) or _verb(command, situation)
    if isinstance(change, Refused):
        return change
    return Decision(Change(change.run, (*handed_over(situation.lease, lease), *change.events)), lease)


def _claim(command: Command, situation: Situation) -> Lease | Refused:
    lease = claimed(
        situation.lease, command.commander,
        fence=command.fence, take_over=command.take_over, now_ns=situation.command_ns,
    )  # fmt: skip
    return Refused(lease.reason, lease.message) if isinstance(lease, Denied) else lease


def handed_over(before: Lease | None, after: Lease | None) -> tuple[Telling, ...]:
    """What is told when the robot changes hands."""
    if before is None or after is None or before.commander == after.commander:
        return ()
    return (partial(TakenOver, commander=after.commander, before=before.commander),)


def _too_late(command: Command, situation: Situation) -> Refused | None:
    if not 0 < command.valid_for_s <= LONGEST_VALID_S:
        return Refused(
            "expired", f"valid for {command.valid_for_s:g} s; at most {LONGEST_VALID_S:g} s are taken"
        )
    age = (situation.command_ns - command.issued_ns) / 1e9
    if not -command.valid_for_s <= age <= command.valid_for_s:
        return Refused(
            "expired", f"{command.verb} is {age:.1f} s old and was valid for {command.valid_for_s:g} s"
        )
    return None


def _misdirected(command: Command, situation: Situation) -> Refused | None:
    run = situation.run
    if command.expect_state is not None and run.state not in command.expect_state:
        return Refused("wrong_state", f"the robot is {run.state}, not {' or '.join(command.expect_state)}")
    if command.run_id is not None and command.run_id != run.run_id:
        return Refused("wrong_run", f"the robot's run is {run.run_id}, not {command.run_id}")
    if command.mission_id is not None and command.mission_id != run.mission_id:
        return Refused("wrong_mission", f"the robot's mission is {run.mission_id}, not {command.mission_id}")
    if command.revision is not None and command.revision != run.revision:
        return Refused("wrong_mission", f"the robot holds revision {run.revision}, not {command.revision}")
    return None


def _verb(command: Command, situation: Situation) -> Change | Refused:
    needed = STATES[command.verb]
    if situation.mission is None:
        return Refused("no_mission", "the robot holds no mission; push one first")
    if situation.run.state not in needed:
        return Refused(
            "wrong_state", f"{command.verb} needs {' or '.join(needed)}; the robot is {situation.run.state}"
        )
    if situation.not_ready and command.verb in DRIVING:
        return Refused("not_ready", situation.not_ready)
    return VERBS[command.verb](command, situation.mission, situation)


def _start(command: Command, mission: Mission, situation: Situation) -> Change | Refused:
    if situation.has_run and not command.again:
        return Refused(
            "finished_before", f"mission {mission.name} has been run before; start --again runs it anew"
        )
    leg = _starting_leg(command, mission, situation.pose)
    if isinstance(leg, Refused):
        return leg
    missing = what_is_missing(
        mission, battery=situation.battery, endurance_s=situation.endurance_s, first=leg
    )
    if missing:
        return Refused("infeasible", missing)
    left_out = tuple(stop.id for stop in mission.stops[:leg])
    run = Run(
        state="RUNNING", mission_id=mission.id, revision=mission.revision,
        run_id=situation.new_run_id, started_ns=situation.now_ns, leg=leg, at=leg, skipped=left_out,
    )  # fmt: skip
    skips = (partial(Skipped, stop=stop, reason="started beyond it") for stop in left_out)
    return Change(run, (partial(Started, commander=command.commander), *skips))


def _starting_leg(command: Command, mission: Mission, pose: Pose) -> int | Refused:
    tolerance = mission.stops[0].tolerance_m
    start = mission.start
    away = math.hypot(pose.x - start.x, pose.y - start.y)
    if not command.from_here:
        if away <= tolerance:
            return 0
        return Refused("not_at_start", f"the robot is {away:.2f} m from the mission's start {_xy(start)}; "
                       "drive it there, or start --from-here on the route")  # fmt: skip
    leg, place = route.nearest_leg(mission, pose)
    if place.distance > mission.stops[leg].tolerance_m:
        return Refused("off_route", f"the robot is {place.distance:.2f} m from the route's nearest point")
    return leg


def _pause(command: Command, mission: Mission, situation: Situation) -> Change:
    run = situation.run
    # A scan under way is let finish: the robot stands still anyway, and no stop is scanned twice.
    keep = run.stop_state in ("SCANNING", "VERIFYING", "RETRIABLE")
    reason = f"pause by {command.commander}"
    paused = changed(
        run, state="PAUSED", stop_state=run.stop_state if keep else "WAITING", reason=reason,
        homing=run.homing or run.state == "HOMING",
    )  # fmt: skip
    return Change(paused, (partial(Paused, reason=reason),))


def _resume(command: Command, mission: Mission, situation: Situation) -> Change | Refused:
    run = situation.run
    off = off_route(run, mission, situation.pose)
    if off:
        return off
    stop_state = run.stop_state if run.stop_state in ("SCANNING", "VERIFYING") else "WAITING"
    onward = changed(run, state="HOMING" if run.homing else "RUNNING", stop_state=stop_state, reason="")
    if run.state == "HELD" or run.stop_state == "RETRIABLE":
        onward = changed(onward, attempt=0, approaches=0)
    if run.homing:
        onward = changed(onward, reason=run.reason)
    return Change(onward, (partial(Resumed, commander=command.commander),))


def off_route(run: Run, mission: Mission, pose: Pose) -> Refused | None:
    """Refused if the robot stands farther from its leg than the stop's tolerance."""
    legs = route.legs_of(mission)
    leg = min(run.leg, len(legs) - 1)
    tolerance = mission.stops[min(leg, len(mission.stops) - 1)].tolerance_m
    near = [route.nearest(legs[index], pose).distance for index in {leg, max(0, leg - 1)}]
    if min(near) <= tolerance:
        return None
    return Refused("off_route", f"the robot is {min(near):.2f} m off its route (tolerance {tolerance:g} m); "
                   "bring it back onto it")  # fmt: skip


def _skip(command: Command, mission: Mission, situation: Situation) -> Change | Refused:
    run = situation.run
    stop = stop_of(run, mission)
    if stop is None or (command.stop is not None and command.stop != stop.id):
        return Refused(
            "not_at_stop", f"the robot works on {stop.id if stop else 'no stop'}, not {command.stop}"
        )
    # A skip is an answer to a hold, so the robot goes on; one that pauses stays paused.
    going = changed(run, state="RUNNING", reason="") if run.state == "HELD" else run
    return skipped(going, mission, f"skip by {command.commander}")


def _retry(command: Command, mission: Mission, situation: Situation) -> Change | Refused:
    stop = stop_of(situation.run, mission)
    if command.stop is not None and (stop is None or command.stop != stop.id):
        return Refused(
            "not_at_stop", f"the robot works on {stop.id if stop else 'no stop'}, not {command.stop}"
        )
    return _resume(command, mission, situation)


def _abort(command: Command, mission: Mission, situation: Situation) -> Change:
    return ended(changed(situation.run, reason=f"abort by {command.commander}"), "ABORTED")


def _home(command: Command, mission: Mission, situation: Situation) -> Change | Refused:
    off = off_route(situation.run, mission, situation.pose)
    if off:
        return off
    reason = f"sent home by {command.commander}"
    return sent_home(changed(situation.run, state="RUNNING"), mission, then="ABORTED", reason=reason)


Verb = Callable[[Command, Mission, Situation], Change | Refused]

VERBS: dict[str, Verb] = {
    "start": _start, "pause": _pause, "resume": _resume, "skip": _skip,
    "retry": _retry, "abort": _abort, "home": _home,
}  # fmt: skip

STATES: dict[str, tuple[str, ...]] = {
    "start": ("READY", "FINISHED", "ABORTED"),
    "pause": ("RUNNING", "HOMING"),
    "resume": ("PAUSED",),
    "skip": ("RUNNING", "PAUSED", "HELD"),
    "retry": ("HELD",),
    "abort": ("RUNNING", "PAUSED", "HELD", "HOMING"),
    "home": ("RUNNING", "PAUSED", "HELD"),
}
"""The states in which each verb means something."""

DRIVING = ("start", "resume", "retry", "home")
"""Verbs that a base which cannot drive refuses at once."""


def _xy(start: object) -> str:
    return f"({getattr(start, 'x', 0.0):.2f}, {getattr(start, 'y', 0.0):.2f})"
