"""The interface between an agent and its run: our controller, or a follower of an autopilot's own run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from stopgo.bridge.robot.base import BaseHealth
from stopgo.mission.document import Mission
from stopgo.mission.run.events import STOPS_LISTED, Pose, StateReport, reported_charge
from stopgo.mission.run.run_commands import Answer, RunCommand
from stopgo.mission.run.states import Run, stop_of


@dataclass(frozen=True)
class Position:
    """Pose and speed (m/s) of a robot, with their time on the run's clock."""

    pose: Pose
    speed: float
    ns: int


class Runner(Protocol):
    """Carries out a run, and reports its progress."""

    changed: Callable[[], None]
    """Called after every change that stations may see; the agent sets it."""
    works: tuple[Callable[[], None], ...]
    """Functions, each for its own thread, that run until the runner is closed; it then stops its base."""

    @property
    def boot_id(self) -> str: ...

    def snapshot(self) -> tuple[Run, Mission | None]:
        """The run and its mission at one moment."""

    def position(self) -> Position | None:
        """Return where the robot is; `None` if there is nothing newer than the last call returned."""

    def battery(self) -> float | None:
        """0 to 1; `None` if it is not known."""

    def health(self) -> BaseHealth:
        """Return the health besides the battery's charge."""

    def execute(self, order: RunCommand) -> Answer:
        """Carry out a command once, however often it comes."""

    def on_link_silence(self, silent_s: float) -> None:
        """React to `silent_s` seconds without a message from the commander."""

    def stand_still(self, error: BaseException) -> None:
        """Command the base to stand until the program ends, because of `error`; nothing is stored before."""

    def close(self) -> None:
        """End all works."""


def state_report(runner: Runner, *, robot: str, seq: int, ns: int, newest: int) -> StateReport:
    """Return the robot's state; `newest`, the number of the newest event, must be read before the run is.

    So a state never names an event that it does not include yet.
    """
    run, mission = runner.snapshot()
    stop, health = stop_of(run, mission), runner.health()
    return StateReport(
        robot=robot, boot_id=runner.boot_id, seq=seq, robot_ns=ns, state=run.state, run_id=run.run_id,
        mission_id=run.mission_id, revision=run.revision, stop=stop.id if stop else None,
        stop_state=run.stop_state if stop else None, done=run.done[-STOPS_LISTED:],
        skipped=run.skipped[-STOPS_LISTED:], done_count=len(run.done), skipped_count=len(run.skipped),
        outside=run.outside[-STOPS_LISTED:], outside_count=len(run.outside),
        battery=reported_charge(runner.battery()), last_event=newest, next_revision=run.next_revision,
        battery_ok=health.battery_ok, position_ok=health.position_ok, fence_ok=health.fence_ok,
    )  # fmt: skip
