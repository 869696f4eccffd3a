"""Fitness of a robot for a mission: by its base, its current run and its battery."""

from __future__ import annotations

from stopgo.bridge.robot.base import Base
from stopgo.mission.document import Mission
from stopgo.mission.run import revision
from stopgo.mission.run.battery import battery_shortfall
from stopgo.mission.run.revision import RevisionPolicy
from stopgo.mission.run.run_commands import Refused
from stopgo.mission.run.states import Run


def why_unfit(
    mission: Mission, *, base: Base, run: Run, held: Mission | None, revisions: RevisionPolicy
) -> Refused | None:
    """Return why a mission cannot be accepted; `None` if it can. `held` is the mission of the run."""
    unfit = base.unfit(mission)
    if unfit:
        return Refused("infeasible", unfit)
    if run.over or held is None:
        return _too_long(mission, base, first=0)
    return _unfit_now(mission, run, held, revisions) or _too_long(mission, base, first=run.at)


def _unfit_now(mission: Mission, run: Run, held: Mission, revisions: RevisionPolicy) -> Refused | None:
    """Return why the run cannot follow `mission` from the next stop on."""
    if mission.id != held.id:
        return Refused("running", f"the robot is {run.state} with mission {held.id}")
    if revisions == "refuse":
        return Refused("running", f"the robot is {run.state} and takes no revision during a run")
    if run.homing and run.then != "PAUSED":
        return Refused("running", "the robot drives home and takes no revision")
    differs = revision.driven_route_change(run, held, mission)
    return Refused("way_differs", f"revision {mission.revision}: {differs}") if differs else None


def _too_long(mission: Mission, base: Base, *, first: int) -> Refused | None:
    battery, endurance_s = base.battery(), base.endurance_s()
    missing = battery_shortfall(mission, battery=battery, endurance_s=endurance_s, first=first)
    return Refused("infeasible", missing) if missing else None


def follows(run: Run, mission: Mission) -> bool:
    """True if the run follows this mission already, or will from the next stop on."""
    return run.mission_id == mission.id and mission.revision in (run.revision, run.next_revision)


def fitness_inputs(run: Run) -> tuple[object, ...]:
    """Return the values of a run that fitness depends on; a pause changes none of them."""
    wanted = (run.mission_id, run.revision, run.next_revision)
    return (*wanted, run.run_id, run.at, run.over, run.homing, run.then)
