"""Decisions on commands: the next run, or the reason for a refusal. Pure: nothing is touched here."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from stopgo.mission.document import Mission
from stopgo.mission.run import route_position
from stopgo.mission.run.battery import battery_shortfall
from stopgo.mission.run.events import Pose, TakenOver
from stopgo.mission.run.lease import Lease, claimed
from stopgo.mission.run.run_commands import DRIVING, FREE_VERBS, LONGEST_VALID_S, Refused, RunCommand
from stopgo.mission.run.states import (
    Change,
    DetailedState,
    Run,
    UnstampedEvent,
    changed,
    ended,
    paused,
    resumed,
    sent_home,
    skipped,
    started,
    stop_of,
)


@dataclass(frozen=True)
class Situation:
    """All that a decision depends on."""

    run: Run
    mission: Mission | None
    has_run: bool
    """True if this mission has been run before."""
    pose: Pose
    now_ns: int
    """On the run's clock."""
    command_ns: int
    """On the clock that commands are dated by."""
    new_run_id: str
    lease: Lease | None
    battery: float | None
    endurance_s: float | None
    not_ready: str = ""
    """Reason why the robot's base cannot drive at present."""
    finds_way: bool = False
    """True if the base finds its own way to a stop, as the mission allows."""
    boot_id: str = ""
    """Id of the robot program's present start; `command_ns` may go back from one start to the next."""


@dataclass(frozen=True)
class Decision:
    """Change that a command leads to, and who commands the robot from then on."""

    change: Change
    lease: Lease | None
    note: str = ""
    """Difference between what a stop named and what it stopped; empty if there is none."""


def decide(order: RunCommand, situation: Situation) -> Decision | Refused:
    """Return the change that a command leads to; late, foreign and impossible commands are refused.

    A pause or an abort is refused by the table of states alone, whatever run, mission or state it names.
    """
    late = _too_late(order, situation)
    if late:
        return late
    lease = situation.lease if order.verb in FREE_VERBS else _claim(order, situation)
    if isinstance(lease, Refused):
        return lease
    misdirected = _misdirected(order, situation)
    if misdirected and order.verb not in FREE_VERBS:
        return misdirected
    change, note = _verb(order, situation), misdirected.message if misdirected else ""
    if isinstance(change, Refused):
        return Refused(change.reason, f"{change.message}; {note}") if note else change
    return Decision(Change(change.run, (*handed_over(situation.lease, lease), *change.events)), lease, note)


def _claim(order: RunCommand, situation: Situation) -> Lease | Refused:
    return claimed(
        situation.lease, order.commander,
        fence=order.fence, take_over=order.take_over, now_ns=situation.command_ns,
    )  # fmt: skip


def handed_over(before: Lease | None, after: Lease | None) -> tuple[UnstampedEvent, ...]:
    """Return the event of a change of commander; none if the commander is the same."""
    if before is None or after is None or before.commander == after.commander:
        return ()
    return (partial(TakenOver, commander=after.commander, before=before.commander),)


def _too_late(order: RunCommand, situation: Situation) -> Refused | None:
    """Refuse a command that is too old; `pause` and `abort` never are, and need no earlier query."""
    if order.verb in FREE_VERBS:
        return None
    if not 0 < order.valid_for_s <= LONGEST_VALID_S:
        return Refused("expired", f"valid for {order.valid_for_s:g} s; the limit is {LONGEST_VALID_S:g} s")
    if order.boot_id not in (None, situation.boot_id):
        return Refused("expired", f"the robot restarted after {order.verb} was sent; send it again")
    age = (situation.command_ns - order.issued_ns) / 1e9
    if not 0 <= age < order.valid_for_s:
        return Refused(
            "expired", f"{order.verb} is {age:.1f} s old and was valid for {order.valid_for_s:g} s"
        )
    return None


def _misdirected(order: RunCommand, situation: Situation) -> Refused | None:
    run = situation.run
    if order.expect_state is not None and run.state not in order.expect_state:
        return Refused("wrong_state", f"the robot is {run.state}, not {' or '.join(order.expect_state)}")
    if order.run_id is not None and order.run_id != run.run_id:
        return Refused("wrong_run", f"the robot's run is {run.run_id}, not {order.run_id}")
    if order.mission_id is not None and order.mission_id != run.mission_id:
        return Refused("wrong_mission", f"the robot's mission is {run.mission_id}, not {order.mission_id}")
    if order.revision is not None and order.revision != run.revision:
        return Refused("wrong_mission", f"the robot holds revision {run.revision}, not {order.revision}")
    return None


def _verb(order: RunCommand, situation: Situation) -> Change | Refused:
    needed = STATES[order.verb]
    if situation.mission is None:
        return Refused("no_mission", "the robot holds no mission; push one first")
    state = situation.run.detailed_state
    if state not in needed:
        return Refused("wrong_state", f"{order.verb} needs {' or '.join(needed)}; the robot is {state}")
    if situation.not_ready and order.verb in DRIVING:
        return Refused("not_ready", situation.not_ready)
    return VERBS[order.verb](order, situation.mission, situation)


def _start(order: RunCommand, mission: Mission, situation: Situation) -> Change | Refused:
    if situation.has_run and not order.again:
        return Refused(
            "finished_before", f"mission {mission.name} has been run before; start --again repeats it"
        )
    leg = _starting_leg(order, mission, situation.pose)
    if isinstance(leg, Refused):
        return leg
    missing = battery_shortfall(
        mission, battery=situation.battery, endurance_s=situation.endurance_s, first=leg
    )
    if missing:
        return Refused("infeasible", missing)
    left_out = tuple(stop.id for stop in mission.stops[:leg])
    return started(
        situation.run, run_id=situation.new_run_id, now_ns=situation.now_ns, by=order.commander,
        left_out=left_out,
    )  # fmt: skip


def _starting_leg(order: RunCommand, mission: Mission, pose: Pose) -> int | Refused:
    start = mission.start
    away, limit = math.hypot(pose.x - start.x, pose.y - start.y), _limit(mission, 0)
    if not order.from_here:
        if away <= limit:
            return 0
        return Refused("not_at_start", f"the robot is {away:.2f} m from the mission's start {_xy(start)}; "
                       f"drive it there, within {limit:g} m, or start --from-here on the route")  # fmt: skip
    leg, place = route_position.nearest_leg(mission, pose)
    if place.distance > _limit(mission, leg):
        return Refused("off_route", f"the robot is {place.distance:.2f} m from the route's nearest point")
    return leg


def _limit(mission: Mission, stop: int) -> float:
    """Return the distance from its route within which a robot drives straight back to it, metres.

    The robot's circle is free where it is and on the route. On the straight line of at most a radius between
    the two, no more than a seventh of the radius lies outside of both circles.
    """
    return max(mission.robot.radius, mission.stops[min(stop, len(mission.stops) - 1)].tolerance_m)


def _pause(order: RunCommand, mission: Mission, situation: Situation) -> Change:
    return paused(situation.run, f"pause by {order.commander}")


def _resume(order: RunCommand, mission: Mission, situation: Situation) -> Change | Refused:
    off = off_route(situation, mission)
    return off or resumed(situation.run, order.commander)


def off_route(situation: Situation, mission: Mission) -> Refused | None:
    """Return a refusal if the robot is farther from its leg than its radius, and the stop's tolerance.

    It would drive straight back to the leg. A robot that finds its own way may be anywhere.
    """
    if situation.finds_way:
        return None
    run, pose = situation.run, situation.pose
    legs = route_position.legs_of(mission)
    leg = min(run.leg, len(legs) - 1)
    limit = _limit(mission, leg)
    near = [route_position.nearest(legs[index], pose) for index in (leg, max(0, leg - 1))]
    back = min(near, key=lambda point: point.distance)
    if back.distance <= limit:
        return None
    x, y = back.point
    return Refused(
        "off_route",
        f"the robot is {back.distance:.2f} m off its route;"
        f" drive it by hand to ({x:.2f}, {y:.2f}), within {limit:g} m, and send the command again",
    )


def _skip(order: RunCommand, mission: Mission, situation: Situation) -> Change | Refused:
    run = situation.run
    stop = stop_of(run, mission)
    if stop is None or (order.stop is not None and order.stop != stop.id):
        return Refused("not_at_stop", f"current stop is {stop.id if stop else 'none'}, not {order.stop}")
    # A skip is an answer to a hold, so the robot goes on; one that pauses stays paused.
    going = changed(run, state="RUNNING", reason="") if run.state == "HELD" else run
    return skipped(going, mission, f"skip by {order.commander}")


def _retry(order: RunCommand, mission: Mission, situation: Situation) -> Change | Refused:
    stop = stop_of(situation.run, mission)
    if order.stop is not None and (stop is None or order.stop != stop.id):
        return Refused("not_at_stop", f"current stop is {stop.id if stop else 'none'}, not {order.stop}")
    return _resume(order, mission, situation)


def _abort(order: RunCommand, mission: Mission, situation: Situation) -> Change:
    return ended(changed(situation.run, reason=f"abort by {order.commander}"), "ABORTED")


def _home(order: RunCommand, mission: Mission, situation: Situation) -> Change | Refused:
    off = off_route(situation, mission)
    if off:
        return off
    reason = f"sent home by {order.commander}"
    return sent_home(changed(situation.run, state="RUNNING"), mission, then="ABORTED", reason=reason)


Deciding = Callable[[RunCommand, Mission, Situation], Change | Refused]

VERBS: dict[str, Deciding] = {
    "start": _start, "pause": _pause, "resume": _resume, "skip": _skip,
    "retry": _retry, "abort": _abort, "home": _home,
}  # fmt: skip

STATES: dict[str, tuple[DetailedState, ...]] = {
    "start": ("READY", "FINISHED", "ABORTED"),
    "pause": ("RUNNING", "HOMING"),
    "resume": ("PAUSED", "PAUSED homing"),
    "skip": ("RUNNING", "PAUSED", "HELD"),
    "retry": ("HELD", "HELD homing"),
    "abort": ("RUNNING", "PAUSED", "HELD", "HOMING", "PAUSED homing", "HELD homing"),
    "home": ("RUNNING", "PAUSED", "HELD", "PAUSED homing", "HELD homing"),
}
"""States in which each verb is allowed; no verb reverses a robot that is on its way home."""


def _xy(start: object) -> str:
    return f"({getattr(start, 'x', 0.0):.2f}, {getattr(start, 'y', 0.0):.2f})"
